//! The files of a report: `report.html`, `report.json`, a `.csv` for each table, an `.svg` for each figure.

use super::content::{Cell, Report, Table};
use super::html::html;
use crate::{AnyError, at};
use lattice_nodes::files::atomic_write;
use std::fs;
use std::path::Path;

/// Writes a report into a folder, which is made where it is missing; its files are replaced.
pub fn write_report(report: &Report, folder: &Path) -> Result<(), AnyError> {
    fs::create_dir_all(folder).map_err(at(folder))?;
    let put = |name: &str, text: &str| atomic_write::write_text(&folder.join(name), text);
    put(
        "report.json",
        &(serde_json::to_string_pretty(report)? + "\n"),
    )?;
    for section in report.sections() {
        for table in &section.tables {
            put(&format!("{}.csv", table.name), &csv(table))?;
        }
        for figure in &section.figures {
            put(&format!("{}.svg", figure.name), &figure.svg)?;
        }
    }
    put("report.html", &html(report))
}

/// A table as RFC 4180 has it, with all digits of its numbers.
fn csv(table: &Table) -> String {
    let mut text = String::new();
    let mut line = |fields: Vec<String>| {
        text.push_str(&fields.join(","));
        text.push_str("\r\n");
    };
    line(table.columns.iter().map(|name| quoted(name)).collect());
    for row in &table.rows {
        line(row.iter().map(field).collect());
    }
    text
}

fn field(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => quoted(text),
        Cell::Number(value, _) => value.to_string(),
        Cell::Count(count) => count.to_string(),
        Cell::Empty => String::new(),
    }
}

fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::report;
    use super::*;

    #[test]
    fn the_files_hold_all_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let into = folder.path().join("new");
        write_report(&report(), &into).unwrap();
        let read = |name: &str| fs::read_to_string(into.join(name)).unwrap();
        assert_eq!(
            read("sides.csv"),
            "lattice,side (m),cells,\"a, b\"\r\ncubic,0.1234567,6,\r\n\"a \"\"b\"\"\",NaN,7,<i>\r\n"
        );
        let json: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
        let section = &json["sections"][0];
        assert_eq!(section["tables"][0]["rows"][0][1], 0.1234567);
        assert_eq!(section["checks"][0]["holds"], true);
        assert_eq!(json["command"], "lattice paper");
        assert!(read("sketch.svg").starts_with("<svg"));
        assert!(read("report.html").starts_with("<!doctype html>"));
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = write_report(&report(), &file.path().join("in")).unwrap_err();
        assert!(error.to_string().contains("/in: "), "{error}");
    }
}
