//! Fenced blocks of the pages.

use std::fs;
use std::path::{Path, PathBuf};

/// The repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

/// A fenced block of a page.
pub struct Block {
    /// Path of the page in the repository.
    pub page: String,
    /// Line of its fence.
    pub number: usize,
    pub text: String,
}

impl Block {
    /// Commands: lines without comments, those that end in a backslash joined with the next.
    pub fn commands(&self) -> Vec<String> {
        let mut commands = vec![String::new()];
        for line in self.text.lines() {
            let line = uncommented(line).trim_end();
            let last = commands.last_mut().unwrap();
            match line.strip_suffix('\\') {
                Some(part) => *last += part,
                None => {
                    *last += line;
                    commands.push(String::new());
                }
            }
        }
        let words = |line: String| line.split_whitespace().collect::<Vec<_>>().join(" ");
        let commands = commands.into_iter().map(words);
        commands.filter(|line| !line.is_empty()).collect()
    }
}

/// A line without its comment, which begins with `#` outside of quotes behind a space.
fn uncommented(line: &str) -> &str {
    let (mut quote, mut before) = (None, ' ');
    for (i, c) in line.char_indices() {
        match (quote, c) {
            (None, '#') if before == ' ' => return &line[..i],
            (None, '\'' | '"') => quote = Some(c),
            (Some(open), c) if open == c => quote = None,
            _ => {}
        }
        before = c;
    }
    line
}

/// README and the pages of `docs` and `docs/dev`.
pub fn pages() -> Vec<String> {
    let mut pages = vec!["README.md".to_owned()];
    for folder in ["docs", "docs/dev"] {
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if name.ends_with(".md") {
                pages.push(format!("{folder}/{name}"));
            }
        }
    }
    pages.sort();
    pages
}

/// Blocks of a language, by page.
pub fn blocks(language: &str) -> Vec<Block> {
    pages()
        .iter()
        .flat_map(|page| of_page(page, language))
        .collect()
}

fn of_page(page: &str, language: &str) -> Vec<Block> {
    let text = fs::read_to_string(root().join(page)).unwrap();
    let (fence, mut found, mut open) = (format!("```{language}"), Vec::new(), None);
    for (number, line) in (1..).zip(text.lines()) {
        match &mut open {
            None if line == fence => {
                open = Some(Block {
                    page: page.to_owned(),
                    number,
                    text: String::new(),
                });
            }
            Some(_) if line == "```" => found.extend(open.take()),
            Some(block) => block.text += &format!("{line}\n"),
            None => {}
        }
    }
    assert!(open.is_none(), "{page}: a block does not end");
    found
}

#[test]
fn comments_and_continued_lines_are_told_apart() {
    let block = Block {
        page: String::new(),
        number: 0,
        text: "a 'b # c' \\\n  -d#e   # f\n# g\n\nh\n".to_owned(),
    };
    assert_eq!(block.commands(), ["a 'b # c' -d#e", "h"]);
}
