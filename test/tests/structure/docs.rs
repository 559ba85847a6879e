//! Pages for newcomers name only what is there.

use std::fs;

use super::root;
use super::source::{files, files_ending_in};

const PAGES: [&str; 2] = ["docs/dev/architecture.md", "CONTRIBUTING.md"];

/// Texts in backticks of a line.
fn quoted(line: &str) -> Vec<&str> {
    line.split('`').skip(1).step_by(2).collect()
}

/// True for a file or folder of the repository by its name; a file that each node has goes without one.
fn is_path(text: &str) -> bool {
    let of_each_node = ["machine.rs", "node.rs", "options.rs", "parameters.rs"];
    if of_each_node.contains(&text) {
        return false;
    }
    let plain = text
        .chars()
        .all(|c| c.is_alphanumeric() || "/._-".contains(c));
    let ending = [
        ".rs", ".md", ".yaml", ".toml", ".py", ".msg", ".srv", ".action", ".xml", ".txt",
    ];
    plain && (ending.iter().any(|ending| text.ends_with(ending)) || text.ends_with('/'))
}

/// True if a file defines or names this: each word of `Type::function` or `function`.
fn names(text: &str, item: &str) -> bool {
    item.split("::")
        .all(|part| text.contains(part.trim_end_matches("()")))
}

#[test]
fn every_path_and_name_in_the_pages_exists() {
    for page in PAGES {
        let text = fs::read_to_string(root().join(page)).unwrap();
        let mut paths = 0;
        for (number, line) in (1..).zip(text.lines()) {
            let quoted = quoted(line);
            let mut file: Option<&str> = None;
            for item in quoted {
                if is_path(item) {
                    let path = root().join(item);
                    assert!(path.exists(), "{page}:{number}: there is no {item}");
                    file = path.is_file().then_some(item);
                    paths += 1;
                } else if let Some(file) = file
                    && line
                        .trim_start()
                        .starts_with(['-', '1', '2', '3', '4', '5', '6', '7', '8', '9'])
                {
                    // A step of a journey: a file, then what happens in it.
                    let content = fs::read_to_string(root().join(file)).unwrap();
                    assert!(
                        names(&content, item),
                        "{page}:{number}: {file} has no {item}"
                    );
                }
            }
        }
        assert!(paths > 10, "{page} names {paths} paths");
    }
}

/// Names after `--example` in a text.
fn examples(text: &str) -> Vec<&str> {
    let behind = text.split("--example").skip(1);
    let names = behind.filter_map(|rest| {
        let rest = rest.trim_start_matches([' ', '"', ',']);
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
        rest.get(..end.unwrap_or(rest.len()))
    });
    names.filter(|name| !name.is_empty()).collect()
}

#[test]
fn examples_that_pages_and_scripts_run_exist() {
    let sources = ["lattice_core", "msgs", "nodes"].map(|folder| root().join(folder));
    let sources: Vec<_> = sources.iter().flat_map(|folder| files(folder)).collect();
    let mut texts = files_ending_in(&["md"], &root().join("docs"));
    for folder in ["lattice_core", "msgs", "nodes"] {
        texts.extend(files_ending_in(&["md"], &root().join(folder)));
    }
    texts.extend(["README.md", "test/peers/instructions"].map(|name| root().join(name)));
    let mut found = 0;
    for path in texts {
        let text = fs::read_to_string(&path).unwrap();
        for name in examples(&text) {
            let file = format!("examples/{name}.rs");
            let exists = sources.iter().any(|source| source.ends_with(&file));
            assert!(exists, "{}: there is no {file}", path.display());
            found += 1;
        }
    }
    assert!(found > 3, "{found}");
}
