//! Tables of a node's parameters, and their text for `--help`.

use super::about::{About, OF_EVERY_NODE};
use super::state::{Params, State};
use crate::sync::lock;

impl State {
    pub(super) fn about_of(&self, name: &str) -> Option<&'static About> {
        let tables = self.about.iter().copied().chain([OF_EVERY_NODE]);
        tables.flatten().find(|about| about.is_of(name))
    }
}

impl Params {
    /// Adds a table, for parameters declared after it.
    pub fn describe(&self, table: &'static [About]) {
        let about = &mut lock(&self.state).about;
        if !about.contains(&table) {
            about.push(table);
        }
    }

    /// Table of all parameters for `--help`: name, type, default, range, meaning.
    pub fn help(&self) -> String {
        let described = self.described();
        let lines = described.iter().map(|(name, declared)| {
            let fixed = declared.fixed().map_or("", |_| " [fixed]");
            let constraint = match declared.constraint() {
                range if range.is_empty() => range,
                range => format!(", {range}"),
            };
            format!(
                "  {name}{fixed}: {}{constraint} (default {})\n      {}\n",
                declared.default.ros_type_name(),
                declared.default,
                declared.text()
            )
        });
        lines.collect()
    }
}
