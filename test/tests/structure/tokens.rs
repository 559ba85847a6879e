//! Tokens of Rust source: identifiers and punctuation, without comments, strings and tests.

/// Tokens of a file in order. `::` is one token, literals are left out, items under `#[cfg(test)]` too.
pub fn tokens(text: &str) -> Vec<String> {
    without_tests(&lex(text))
}

fn lex(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if let Some(length) = raw_string(rest) {
            length
        } else if first == '"' {
            quoted(rest)
        } else if first == '\'' {
            character(rest)
        } else if first.is_alphanumeric() || first == '_' {
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            let length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            found.push(rest[..length].to_owned());
            length
        } else if rest.starts_with("::") {
            found.push("::".to_owned());
            2
        } else {
            if !first.is_whitespace() {
                found.push(first.to_string());
            }
            first.len_utf8()
        };
        rest = &rest[length..];
    }
    found
}

/// Length of the raw string that `text` begins with.
fn raw_string(text: &str) -> Option<usize> {
    let after = text.strip_prefix("br").or_else(|| text.strip_prefix('r'))?;
    let marks = after.len() - after.trim_start_matches('#').len();
    let body = after[marks..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(marks));
    let length = body.find(&end).map_or(body.len(), |at| at + end.len());
    Some(text.len() - body.len() + length)
}

/// Length of the string in quotes that `text` begins with.
fn quoted(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// Length of the character that `text` begins with, or of the mark of a lifetime.
fn character(text: &str) -> usize {
    let mut chars = text.char_indices().skip(1);
    match chars.next() {
        // The escaped character may be a quote itself.
        Some((_, '\\')) => text[3..].find('\'').map_or(1, |at| at + 4),
        Some((at, c)) if text[at + c.len_utf8()..].starts_with('\'') => at + c.len_utf8() + 1,
        _ => 1,
    }
}

/// Tokens without the items that `#[cfg(test)]` stands before.
fn without_tests(all: &[String]) -> Vec<String> {
    const TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut at = 0;
    while let Some(token) = all.get(at) {
        if all[at..].iter().take(TEST.len()).eq(TEST.iter()) {
            at += TEST.len();
            at += item_length(&all[at..]);
        } else {
            kept.push(token.clone());
            at += 1;
        }
    }
    kept
}

/// Number of tokens to the end of an item: a semicolon or comma outside of brackets, or a closed brace.
fn item_length(tokens: &[String]) -> usize {
    let mut depth = 0_i32;
    for (at, token) in tokens.iter().enumerate() {
        match token.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        let ends = matches!(token.as_str(), ";" | "," | "}");
        if depth < 0 {
            return at;
        }
        // The braces of a `use` are followed by its semicolon.
        let next = tokens.get(at + 1).map(String::as_str);
        if depth == 0 && ends && !(token == "}" && next == Some(";")) {
            return at + 1;
        }
    }
    tokens.len()
}

#[test]
fn comments_strings_and_tests_are_left_out() {
    let text = r##"
        use a::{b, c}; // d
        const E: &str = "\"f"; const G: &str = r#"h"#; const I: [char; 2] = ['\'', '"'];
        fn j<'k>() {}
        #[cfg(test)]
        use l::{m};
        #[cfg(test)]
        mod tests { fn n() {} }
    "##;
    let words: String = tokens(text)
        .into_iter()
        .filter(|token| token.len() == 1 && token.starts_with(char::is_alphabetic))
        .collect();
    assert_eq!(words, "abcEGIjk");
}
