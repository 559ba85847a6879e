//! Checks on YAML before parsing: anchors and aliases, which the parser would resolve and rcl rejects, and
//! deep nesting, for which parsing time grows with the square of the depth.

use thiserror::Error;

/// Limit of nested brackets, braces and list dashes around a value.
const NESTING_MAX: usize = 64;

/// Reason for rejecting a YAML text before parsing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ScanError {
    /// `&name` or `*name` at the start of a value.
    #[error(
        "line {line}: YAML anchors and aliases are not allowed; \
         write the value out, or quote a text that starts with & or *"
    )]
    Anchor {
        /// The line, from 1.
        line: usize,
    },
    /// Nesting of brackets, braces or list dashes above the limit.
    #[error("line {line}: nesting is deeper than 64")]
    Deep {
        /// The line, from 1.
        line: usize,
    },
}

/// Rejects anchors, aliases and deep nesting outside quotes, comments and block texts.
pub(crate) fn scan(text: &str) -> Result<(), ScanError> {
    let mut scan = Scan::default();
    for (index, text) in text.lines().enumerate() {
        let line = index.saturating_add(1);
        match scan.line(text) {
            Found::Nothing => {}
            Found::Anchor => return Err(ScanError::Anchor { line }),
            Found::Deep => return Err(ScanError::Deep { line }),
        }
    }
    Ok(())
}

enum Found {
    Nothing,
    Anchor,
    Deep,
}

/// Scanner state at the end of a line: open quotes, brackets and block texts.
#[derive(Default)]
struct Scan {
    /// Quote character of the open text.
    quote: Option<char>,
    /// Open brackets and braces.
    flow_depth: usize,
    /// Lines indented at least this far belong to a block text.
    block: Option<usize>,
}

impl Scan {
    /// Scans a line up to the first rejected construct.
    fn line(&mut self, line: &str) -> Found {
        let indent = line.chars().take_while(|c| *c == ' ').count();
        if self.block.is_some_and(|block| indent >= block) || line.trim().is_empty() {
            return Found::Nothing;
        }
        self.block = None;
        // Whether the next character begins a node, and the column of the enclosing node.
        let mut begins = true;
        let mut parent = None;
        let mut before = ' ';
        let mut in_tag = false;
        let mut dashes = 0usize;
        let mut chars = line.chars().enumerate();
        while let Some((column, c)) = chars.next() {
            let last = std::mem::replace(&mut before, c);
            let next = chars.clone().next().map(|(_, next)| next);
            let spaced = next.is_none_or(char::is_whitespace);
            if let Some(quote) = self.quote {
                let escaped = (quote == '"' && c == '\\')
                    || (quote == '\'' && c == quote && next == Some(quote));
                if escaped {
                    let _ = chars.next();
                } else if c == quote {
                    self.quote = None;
                }
                continue;
            }
            let in_flow = self.flow_depth > 0;
            match c {
                _ if c.is_whitespace() => in_tag = false,
                _ if in_tag => {}
                '#' if last.is_whitespace() => return Found::Nothing,
                '&' | '*' if begins && !spaced => return Found::Anchor,
                '!' if begins => in_tag = true,
                '-' | '?' if begins && spaced && !in_flow => {
                    parent = Some(column);
                    dashes = dashes.saturating_add(1);
                }
                '|' | '>' if begins && !in_flow => {
                    self.block = Some(parent.map_or(indent, |parent| parent.saturating_add(1)));
                    return Found::Nothing;
                }
                '[' | '{' if begins || in_flow => {
                    self.flow_depth = self.flow_depth.saturating_add(1);
                    begins = true;
                }
                ']' | '}' if in_flow => {
                    self.flow_depth = self.flow_depth.saturating_sub(1);
                    begins = false;
                }
                ',' if in_flow => begins = true,
                ':' if spaced || (in_flow && matches!(last, '"' | '\'')) => begins = true,
                _ => {
                    if begins {
                        parent = Some(column);
                        self.quote = Some(c).filter(|c| matches!(c, '"' | '\''));
                    }
                    begins = false;
                }
            }
            if self.flow_depth > NESTING_MAX || dashes > NESTING_MAX {
                return Found::Deep;
            }
        }
        Found::Nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn anchors_and_aliases_are_found() {
        for (text, line) in [
            ("a: &x 1\nb: *x", 1),
            ("a: 1\nb: *x", 2),
            ("- *x", 1),
            ("- - *x", 1),
            ("[1, *x]", 1),
            ("{a: *x}", 1),
            ("{\"a\":*x}", 1),
            ("*x : 1", 1),
            ("a: !!str &x 1", 1),
            ("a: |\n  *text\nb: *x", 3),
            ("- key: |\n    text\n  other: *x", 3),
            ("a: 'it''s: *no'\nb: *x", 2),
            ("a: \"\\\": *no\"\nb: *x", 2),
            ("a: [1,\n  *x]", 2),
            ("a:\n  *x", 2),
        ] {
            assert_eq!(scan(text), Err(ScanError::Anchor { line }), "{text}");
        }
    }

    #[test]
    fn other_uses_of_the_characters_are_not() {
        for text in [
            "/**:\n  ros__parameters:\n    a: 1",
            "\"*\": 1",
            "a: 'x *y'",
            "a: b & c * d",
            "a: 1 # *x",
            "a: b*c",
            "a: |\n  *x\n  &y\nb: 1",
            "- |\n  *x",
            "a: >-\n\n  *x",
            "a: \"one\n  *two\"",
            "a: [b*, c&d]",
            "a: http://x/*y",
        ] {
            assert_eq!(scan(text), Ok(()), "{text}");
        }
    }

    #[test]
    fn deep_nesting_is_found() {
        for opening in ["[", "{a: ", "- ", "? "] {
            assert_eq!(scan(&opening.repeat(NESTING_MAX)), Ok(()), "{opening}");
            let deep = format!("a: 1\n{}", opening.repeat(NESTING_MAX + 1));
            assert_eq!(scan(&deep), Err(ScanError::Deep { line: 2 }), "{opening}");
        }
        assert_eq!(scan(&"[]".repeat(1000)), Ok(()));
    }

    proptest! {
        #[test]
        fn any_text_is_scanned(text in "\\PC{0,60}|[-\\[\\]{}:,'\"&*#|>! \n\\\\a]{0,60}") {
            let _ = scan(&text);
        }

        #[test]
        fn an_alias_is_found_behind_any_quoted_text(text in "[^\n\r\u{85}\u{2028}\u{2029}]{0,30}") {
            let single = format!("a: '{}'\nb: *x", text.replace('\'', "''"));
            prop_assert_eq!(scan(&single), Err(ScanError::Anchor { line: 2 }));
            let double = format!("a: \"{}\"\nb: *x", text.replace('\\', "\\\\").replace('"', "\\\""));
            prop_assert_eq!(scan(&double), Err(ScanError::Anchor { line: 2 }));
        }
    }
}
