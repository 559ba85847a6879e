//! The page of counters: it has every counter that the code declares, and each has a test that drives it.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::root;
use super::source::{code, files};

const PAGE: &str = "docs/counters.md";

/// Numbers in reports and diagnostics that count nothing: sizes, states, rates, and a place in a log.
const STATES: &str = "address begin_ns camera_info clients clouds_waiting depth end_ns evidence images_waiting latest_ms map_bytes map_checksum mesh mesh_bytes \
    now_ns onnx origin paused rate submap voxels";

/// Functions that give the reasons by which nodes count what they refuse.
const REASONS: [&str; 2] = ["fn name(", "fn reason("];

/// Words between `"` that are counters or reasons.
fn quoted(text: &str) -> BTreeSet<String> {
    let is_word = |text: &&str| {
        let plain = |c: char| c.is_ascii_lowercase() || c == '_';
        !text.is_empty() && text.chars().all(plain)
    };
    let words = text.split('"').skip(1).step_by(2).filter(is_word);
    words.map(str::to_owned).collect()
}

/// The part of a text from a beginning on to the brace that closes it.
fn block(text: &str) -> &str {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 1 => return &text[..at],
            '}' => depth -= 1,
            _ => {}
        }
    }
    text
}

/// Fields of 64-bit numbers in structures that are shown as reports or diagnostics.
fn fields(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for derived in code.split("#[derive(").skip(1) {
        let (traits, item) = derived.split_once(")]").unwrap_or_default();
        let is_shown = traits.contains("Serialize");
        let head = item.trim_start();
        let item = head.lines().find(|line| !line.starts_with("#["));
        if !is_shown || !item.is_some_and(|line| line.contains("struct ")) {
            continue;
        }
        for line in block(head).lines().skip(1) {
            let line = line.trim().trim_start_matches("pub ");
            if let Some((name, kind)) = line.split_once(": ")
                && ["u64,", "Option<u64>,"].contains(&kind)
            {
                found.insert(name.to_owned());
            }
        }
    }
    found
}

/// Everything that the code of the nodes counts: fields of reports, keys of diagnostics, reasons.
fn declared() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let sources = ["nodes/src", "nodes/bag/src/recover.rs"];
    let folder = files(&root().join(sources[0])).into_iter();
    for file in folder.chain([root().join(sources[1])]) {
        if file.to_string_lossy().contains("tests") || file.ends_with("refusals.rs") {
            continue;
        }
        let code = code(&file);
        found.extend(fields(&code));
        found.extend(keys(&code));
        for start in REASONS {
            for (at, _) in code.match_indices(start) {
                // Names of files and options are no reasons.
                if is_of_reasons(&file) {
                    found.extend(quoted(block(&code[at..])));
                }
            }
        }
    }
    let status = code(&root().join("nodes/runtime/src/node/shared/status.rs"));
    for call in status.split("add(").skip(1) {
        found.extend(quoted(call.split(';').next().unwrap_or_default()));
    }
    found.extend(["participants_kept_out".to_owned()]);
    found.retain(|name| !STATES.split_whitespace().any(|state| state == name));
    found
}

fn is_of_reasons(file: &Path) -> bool {
    let name = file.to_string_lossy();
    let of = ["refusal", "error", "inputs", "image", "pinhole", "jpeg"];
    of.iter().any(|part| name.contains(part)) && !name.contains("src/files/")
}

/// Keys of values that a node states by hand: `("key".into(), number.to_string())`.
fn keys(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (at, _) in code.match_indices("to_string()") {
        // Its expression and the key before it.
        let before = &code[..at];
        let begin = before.rfind([';', '{', '}']).map_or(0, |at| at + 1);
        let pair = before[begin..]
            .rsplit("to_string()")
            .next()
            .unwrap_or_default();
        if pair.contains(',') && (pair.contains(".into(),") || pair.contains("\", ")) {
            found.extend(quoted(pair));
        }
    }
    found
}

/// Words in backticks.
fn named(page: &str) -> BTreeSet<String> {
    let quoted = page.split('`').skip(1).step_by(2);
    let words = quoted.flat_map(|text| text.split([' ', ',']));
    words.map(str::to_owned).collect()
}

#[test]
fn every_counter_is_on_the_page() {
    let page = named(&fs::read_to_string(root().join(PAGE)).unwrap());
    let declared = declared();
    assert!(declared.len() > 100, "{declared:?}");
    let is_there = |name: &String| {
        let behind = format!("_{name}");
        page.iter()
            .any(|word| word == name || word.ends_with(&behind))
    };
    let missing: Vec<_> = declared.iter().filter(|name| !is_there(name)).collect();
    assert!(missing.is_empty(), "{PAGE} lacks {missing:?}");
}

#[test]
fn every_counter_is_named_by_a_test() {
    let mut tests = String::new();
    for folder in ["test/tests", "nodes", "lattice_core/src"] {
        for file in files(&root().join(folder)) {
            let text = fs::read_to_string(&file).unwrap();
            let path = file.to_string_lossy();
            let own = path.contains("structure") || path.contains("/lab/");
            if path.contains("/tests") || path.ends_with("_tests.rs") {
                tests.push_str(if own { "" } else { &text });
            } else if let Some((_, own)) = text.split_once("#[cfg(test)]\nmod tests {") {
                tests.push_str(own);
            }
        }
    }
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let words: BTreeSet<&str> = tests.split(|c| !is_word(c)).collect();
    let declared = declared();
    let undriven: Vec<_> = declared
        .iter()
        .filter(|name| {
            let is_in = |word: &&str| *word == name.as_str() || word.ends_with(&format!("_{name}"));
            !words.iter().any(is_in)
        })
        .collect();
    assert!(undriven.is_empty(), "no test names {undriven:?}");
}

#[test]
fn declarations_are_found() {
    let text = "#[derive(Debug, Serialize)]\npub struct A {\n    pub lost: u64,\n    name: String,\n}\n\
                #[derive(Debug)]\nstruct B {\n    pub id: u64,\n}\n";
    assert_eq!(fields(text), BTreeSet::from(["lost".to_owned()]));
    let text =
        "values.push((\"late\".into(), late.to_string()));\nlet a = (\"odd\", 7.to_string());";
    let expected = ["late", "odd"].map(str::to_owned);
    assert_eq!(keys(text), BTreeSet::from(expected));
}
