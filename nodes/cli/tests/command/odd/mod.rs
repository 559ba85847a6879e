//! Odd files and logs, row by row of the tables in `docs/files.md`.

mod files;
mod logs;

use std::collections::BTreeSet;
use std::fs;

use crate::pages::blocks::root;

/// A row of a table: its first cell, and the texts in its last one, of a warning or an error.
pub struct Row {
    pub name: String,
    pub says: Vec<String>,
}

/// Rows of the table that begins with a head.
fn table(head: &str) -> Vec<Row> {
    let page = fs::read_to_string(root().join("docs/files.md")).unwrap();
    let lines = page.lines().skip_while(|line| !line.starts_with(head));
    let rows = lines.skip(2).take_while(|line| line.starts_with('|'));
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        let [name, _, says] = cells[..] else {
            panic!("{line}")
        };
        let says = says.split('`').skip(1).step_by(2).map(str::to_owned);
        Row {
            name: name.to_owned(),
            says: says.collect(),
        }
    };
    let rows: Vec<Row> = rows.map(row).collect();
    assert!(!rows.is_empty(), "{head}");
    rows
}

/// The rows of a table, which must be those that a test drives, each with its driver.
pub fn driven<T>(head: &str, drivers: Vec<(&str, T)>) -> Vec<(Row, T)> {
    let rows = table(head);
    let names = |of: &mut dyn Iterator<Item = String>| of.collect::<BTreeSet<_>>();
    let told = names(&mut rows.iter().map(|row| row.name.clone()));
    let tested = names(&mut drivers.iter().map(|(name, _)| (*name).to_owned()));
    assert_eq!(told, tested, "rows of docs/files.md and of the test");
    assert_eq!(rows.len(), drivers.len());
    let row = |(name, driver): (&str, T)| {
        let row = table(head).into_iter().find(|row| row.name == name);
        (row.unwrap(), driver)
    };
    drivers.into_iter().map(row).collect()
}

impl Row {
    /// Checks that standard error has the texts of the row, and nothing if there are none.
    pub fn check(&self, errors: &str) {
        for text in &self.says {
            assert!(
                errors.contains(text),
                "{}: no '{text}' in {errors}",
                self.name
            );
        }
        let silent = self.says.is_empty();
        assert!(!silent || errors.is_empty(), "{}: {errors}", self.name);
    }
}
