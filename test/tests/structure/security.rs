//! Every test that the page on security names is there.

use std::collections::BTreeSet;
use std::fs;

use super::root;
use super::source::files;

/// Functions with `#[test]` in a text, including those of `proptest!`.
fn tests(text: &str) -> impl Iterator<Item = &str> {
    let after = text.split("#[test]").skip(1);
    after.filter_map(|rest| {
        let (_, rest) = rest.split_once("fn ")?;
        rest.split('(').next()
    })
}

#[test]
fn the_tests_that_the_page_names_exist() {
    let mut known = BTreeSet::new();
    for folder in ["lattice_core/src", "msgs", "nodes", "test/tests"] {
        for file in files(&root().join(folder)) {
            let text = fs::read_to_string(&file).unwrap();
            known.extend(tests(&text).map(str::to_owned));
        }
    }
    let page = fs::read_to_string(root().join("docs/security.md")).unwrap();
    let mut rows = 0;
    let mut table = false;
    for line in page.lines() {
        table = line.starts_with('|') && (table || line.ends_with("| test |"));
        if !table || line.ends_with("| test |") || line.starts_with("|---") {
            continue;
        }
        rows += 1;
        let last = line.trim_end_matches('|').rsplit('|').next().unwrap();
        let mut named = last.split('`').skip(1).step_by(2).peekable();
        assert!(named.peek().is_some(), "no test: {line}");
        for name in named {
            assert!(known.contains(name), "there is no test {name}: {line}");
        }
    }
    assert!(rows > 20, "{rows} rows");
}
