//! Source files of a crate, as text without tests and comments.

use std::fs;
use std::path::{Path, PathBuf};

/// All `.rs` files below a directory, sorted; without those that cargo has built.
pub fn files(directory: &Path) -> Vec<PathBuf> {
    files_ending_in(&["rs"], directory)
}

/// Files with one of the endings below a directory, in order.
pub fn files_ending_in(endings: &[&str], directory: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        // What cargo builds of a workspace of its own is none of its sources.
        if path.is_dir() && !path.ends_with("target") {
            found.extend(files_ending_in(endings, &path));
        } else if path
            .extension()
            .is_some_and(|ending| endings.iter().any(|other| ending == *other))
        {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Path of a module from the root of its crate, empty for the root itself; `None` for tests.
pub fn module(source: &Path, file: &Path) -> Option<Vec<String>> {
    let relative = file.strip_prefix(source).unwrap().with_extension("");
    let mut parts: Vec<String> = relative
        .iter()
        .map(|part| part.to_str().unwrap().to_owned())
        .collect();
    if matches!(
        parts.last().map(String::as_str),
        Some("mod" | "lib" | "main")
    ) {
        parts.pop();
    }
    let is_test = |part: &String| ["tests", "testing"].contains(&part.as_str());
    (!parts.iter().any(is_test)).then_some(parts)
}

/// Code of a file without its comments and its `mod tests`.
pub fn code(file: &Path) -> String {
    let text = fs::read_to_string(file).unwrap();
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    let lines = text
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}
