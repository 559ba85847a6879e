//! Comments of definitions as documentation.

use std::fmt::Write as _;

/// Documentation of a comment: sentences with a capital and a full stop; `None` for a comment without text.
pub fn doc(comment: &[String]) -> Option<Vec<String>> {
    let lines = comment.iter().map(|line| line.trim());
    // A fence would make a test of the block behind it.
    let lines = lines.filter(|line| !line.starts_with("```"));
    let mut lines: Vec<String> = lines.map(escaped).collect();
    while lines.last().is_some_and(String::is_empty) {
        lines.pop();
    }
    let start = lines.iter().position(|line| !line.is_empty())?;
    lines.drain(..start);
    if let Some(first) = lines.first_mut() {
        let mut chars = first.chars();
        let capital = chars.next().map(|c| c.to_ascii_uppercase());
        // A name such as x_offset or sensor-fixed is written as it is.
        let word = first.split_whitespace().next().unwrap_or_default();
        if word
            .chars()
            .all(|c| c.is_ascii_lowercase() || ",;:.".contains(c))
        {
            *first = capital.into_iter().chain(chars).collect();
        }
    }
    if let Some(last) = lines.last_mut()
        && !last.ends_with(['.', '!', '?', ':', ')', '`'])
    {
        last.push('.');
    }
    Some(lines)
}

/// A line whose brackets make no link and no HTML.
fn escaped(line: &str) -> String {
    let mut escaped = String::new();
    for (i, part) in line.split('`').enumerate() {
        if i > 0 {
            escaped.push('`');
        }
        for c in part.chars() {
            if i % 2 == 0 && "[]<>".contains(c) {
                escaped.push('\\');
            }
            escaped.push(c);
        }
    }
    escaped
}

/// Writes documentation in front of an item.
pub fn add_doc(code: &mut String, indent: &str, lines: &[String]) {
    for line in lines {
        let space = if line.is_empty() { "" } else { " " };
        let _ = writeln!(code, "{indent}///{space}{line}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(lines: &[&str]) -> Option<Vec<String>> {
        let lines: Vec<_> = lines.iter().map(|line| (*line).to_owned()).collect();
        doc(&lines)
    }

    #[test]
    fn comments_become_sentences() {
        assert_eq!(of(&["first row, pixels"]).unwrap(), ["First row, pixels."]);
        assert_eq!(of(&["x_offset of it"]).unwrap(), ["x_offset of it."]);
        assert_eq!(
            of(&["", "one", "", "two!", ""]).unwrap(),
            ["One", "", "two!"]
        );
        assert_eq!(of(&["", " "]), None);
    }

    #[test]
    fn no_link_no_html_and_no_test_is_made() {
        let lines = of(&["in [0, 1] of <x>, `a[0]`", "```", "    code", "```"]).unwrap();
        assert_eq!(lines, [r"In \[0, 1\] of \<x\>, `a[0]`", "code."]);
    }
}
