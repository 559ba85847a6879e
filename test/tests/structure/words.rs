//! Words of the pages and of doc comments, as far as a test can see them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::root;
use super::source::{files, files_ending_in};

/// Longest sentence of a page, in words.
const LONGEST_SENTENCE: usize = 40;

/// Metaphors for code, where a term of the field says it.
const METAPHORS: &str = "desk|desks|hub|hubs|workbench|portfolio|hope|hopes|tell|tells|told|speak|speaks|spoken|\
    hear|hears|heard|deaf|goes on|go on|went on|goodbye|stranger|strangers|a look";

/// Pages that show the newest figures or one use alone, with their most words.
const SHORT: [(&str, usize); 2] = [
    ("docs/calibration.md", 1500),
    ("docs/dev/benchmarks.md", 1500),
];

/// Pages outside of the folders of pages.
const FRONT: [&str; 9] = [
    "README.md",
    "CONTRIBUTING.md",
    "RELEASING.md",
    "SECURITY.md",
    "lattice_core/README.md",
    "msgs/README.md",
    "msgs/generator/README.md",
    "nodes/bag/README.md",
    "nodes/runtime/README.md",
];

/// Metaphors in doc comments: a number to lower, never to raise.
const METAPHORS_IN_COMMENTS: usize = 6;

/// First sentences of doc comments that end in `at most`, `about` or `too`: a number to lower, never to raise.
const BAD_ENDS_IN_COMMENTS: usize = 3;

/// A part of a page: its line, its text, and whether it is prose (no table, no heading).
struct Part {
    line: usize,
    text: String,
    is_prose: bool,
}

/// Paragraphs, items, rows of tables and headings of a page, without blocks of code and HTML.
fn parts(page: &str) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let (mut in_code, mut is_open) = (false, false);
    for (line, text) in (1..).zip(page.lines()) {
        let trimmed = text.trim();
        let is_fence = trimmed.starts_with("```");
        in_code ^= is_fence;
        let is_indented = text.starts_with("    ") && !is_open;
        let is_skipped = trimmed.is_empty() || trimmed.starts_with('<') || is_indented;
        if in_code || is_fence || is_skipped {
            is_open = false;
            continue;
        }
        let is_prose = !["|", "#", "!["]
            .iter()
            .any(|mark| trimmed.starts_with(mark));
        let item = item(trimmed);
        if is_prose && is_open && item.is_none() {
            let last = parts.last_mut().unwrap();
            last.text += &format!(" {trimmed}");
            continue;
        }
        is_open = is_prose;
        parts.push(Part {
            line,
            text: item.unwrap_or(trimmed).to_owned(),
            is_prose,
        });
    }
    parts
}

/// Text of an item of a list.
fn item(line: &str) -> Option<&str> {
    let number = line.trim_start_matches(|c: char| c.is_ascii_digit());
    let numbered = number.strip_prefix(". ").filter(|_| number != line);
    line.strip_prefix("- ").or(numbered)
}

/// A text without code in backticks and targets of links.
fn plain(text: &str) -> String {
    let code = text.split('`').enumerate();
    let code = code.map(|(i, part)| if i % 2 == 0 { part } else { "X" });
    let mut plain = String::new();
    for (i, part) in code.collect::<String>().split("](").enumerate() {
        let part = match part.split_once(')') {
            Some((_, rest)) if i > 0 => rest,
            _ => part,
        };
        plain += part;
    }
    plain.replace("**", "")
}

/// A text without quotations.
fn unquoted(text: &str) -> String {
    text.split('"').step_by(2).collect::<Vec<_>>().join(" X ")
}

/// Sentences of a plain text.
fn sentences(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut begin = 0;
    for (at, _) in text.match_indices(['.', '!', '?']) {
        let rest = &text[at + 1..];
        let behind = rest.trim_start_matches([')', '"', '*']);
        let next = behind.trim_start();
        let begins = |c: char| c.is_uppercase() || c.is_ascii_digit() || "\"(*_[".contains(c);
        if behind.len() > next.len() && next.starts_with(begins) {
            let end = text.len() - next.len();
            found.push(&text[begin..end]);
            begin = end;
        }
    }
    found.push(&text[begin..]);
    found
}

fn words(text: &str) -> usize {
    let is_word = |word: &&str| word.chars().any(char::is_alphanumeric);
    text.split_whitespace().filter(is_word).count()
}

/// Metaphors of a text, outside of code and quotations.
fn metaphors(text: &str) -> Vec<&'static str> {
    let text = unquoted(&plain(text)).to_lowercase();
    let words = text.split(|c: char| !c.is_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let words = format!(" {} ", words.join(" "));
    let times = |phrase: &&'static str| words.matches(&format!(" {phrase} ")).count();
    METAPHORS
        .split('|')
        .flat_map(|phrase| vec![phrase; times(&phrase)])
        .collect()
}

/// Doc comments of a source with their first lines, the marks left out.
fn comments(source: &str) -> Vec<(usize, Vec<&str>)> {
    let mut found: Vec<(usize, Vec<&str>)> = Vec::new();
    let mut is_open = false;
    for (number, line) in (1..).zip(source.lines()) {
        let line = line.trim_start();
        let text = line.strip_prefix("///").or(line.strip_prefix("//!"));
        if let Some(text) = text {
            match found.last_mut() {
                Some((_, lines)) if is_open => lines.push(text.trim()),
                _ => found.push((number, vec![text.trim()])),
            }
        }
        is_open = text.is_some();
    }
    found
}

/// Comments of a message, service or action with their lines, the marks left out.
fn comments_of_definition(text: &str) -> Vec<(usize, Vec<&str>)> {
    let lines = (1..).zip(text.lines());
    let comments = lines.filter_map(|(number, line)| Some((number, line.split_once('#')?.1)));
    comments
        .map(|(number, comment)| (number, vec![comment.trim()]))
        .collect()
}

/// True for a doc comment whose first sentence ends as none should.
fn ends_badly(lines: &[&str]) -> bool {
    let paragraph = lines.iter().take_while(|line| !line.is_empty());
    let paragraph = paragraph.copied().collect::<Vec<_>>().join(" ");
    let first = paragraph.split(". ").next().unwrap_or_default();
    let first = first.trim_end_matches(['.', ':', ';', '!', '?']);
    let first = format!(" {first}");
    [" at most", " about", " too"]
        .iter()
        .any(|end| first.ends_with(end))
}

/// Pages of a folder.
fn pages_in(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let is_page = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "md");
    let mut pages: Vec<PathBuf> = paths.filter(is_page).collect();
    pages.sort();
    pages
}

fn pages_to_read() -> Vec<PathBuf> {
    let front = FRONT.map(|page| root().join(page));
    let folders = ["docs", "docs/dev"].into_iter().flat_map(pages_in);
    front.into_iter().chain(folders).collect()
}

fn shown(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().display().to_string()
}

/// Sentences of a page that are too long, with their places; a quotation counts as a word.
fn long_sentences(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).unwrap();
    let prose = parts(&text).into_iter().filter(|part| part.is_prose);
    let mut found = Vec::new();
    for part in prose {
        let plain = unquoted(&plain(&part.text));
        let long = sentences(&plain).into_iter();
        let long = long.filter(|sentence| words(sentence) > LONGEST_SENTENCE);
        found.extend(long.map(|text| format!("{}:{}: {text}", shown(page), part.line)));
    }
    found
}

/// The crate of a source, by its folder.
fn crate_of(path: &Path) -> String {
    let name = shown(path);
    let depth = if name.starts_with("nodes/") { 2 } else { 1 };
    name.split('/').take(depth).collect::<Vec<_>>().join("/")
}

/// Counts of a rule's violations in doc comments by crate, and their places.
fn in_comments(
    violations: impl Fn(&[&str]) -> Vec<String>,
) -> (BTreeMap<String, usize>, Vec<String>) {
    let (mut counts, mut places) = (BTreeMap::new(), Vec::new());
    let folders = ["lattice_core", "msgs", "nodes", "test"].map(|folder| root().join(folder));
    let sources = folders.iter().flat_map(|folder| files(folder));
    // Comments of messages are documentation of their structs.
    let definitions = files_ending_in(&["msg", "srv", "action"], &root().join("msgs"));
    for path in sources.chain(definitions) {
        let text = fs::read_to_string(&path).unwrap();
        let found = match path.extension().is_some_and(|ending| ending == "rs") {
            true => comments(&text),
            false => comments_of_definition(&text),
        };
        for (line, lines) in found {
            for what in violations(&lines) {
                *counts.entry(crate_of(&path)).or_default() += 1;
                places.push(format!("{}:{line}: {what}", shown(&path)));
            }
        }
    }
    (counts, places)
}

/// Text of a doc comment without its blocks of code.
fn prose(lines: &[&str]) -> String {
    let text = lines.join("\n");
    text.split("```").step_by(2).collect::<Vec<_>>().join("\n")
}

#[test]
fn sentences_of_the_pages_are_short() {
    let pages = pages_to_read();
    assert!(pages.len() > 25, "{pages:?}");
    let decisions = pages_in("docs/decisions");
    let all = pages.iter().chain(&decisions);
    let long: Vec<String> = all.flat_map(|page| long_sentences(page)).collect();
    assert!(long.is_empty(), "over {LONGEST_SENTENCE} words: {long:#?}");
}

#[test]
fn pages_have_no_metaphors_for_code() {
    let mut found = Vec::new();
    for page in pages_to_read() {
        let text = fs::read_to_string(&page).unwrap();
        for part in parts(&text) {
            for word in metaphors(&part.text) {
                found.push(format!("{}:{}: '{word}'", shown(&page), part.line));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn pages_of_figures_stay_short() {
    for (page, most) in SHORT {
        let text = fs::read_to_string(root().join(page)).unwrap();
        let count = text.split_whitespace().count();
        assert!(count <= most, "{page} has {count} words, over {most}");
    }
}

#[test]
fn metaphors_in_doc_comments_become_fewer() {
    let (counts, places) = in_comments(|lines| {
        let found = metaphors(&prose(lines)).into_iter();
        found.map(str::to_owned).collect()
    });
    assert!(
        places.len() <= METAPHORS_IN_COMMENTS,
        "{} metaphors in doc comments, {METAPHORS_IN_COMMENTS} were: {counts:?} {places:#?}",
        places.len()
    );
}

#[test]
fn first_sentences_that_end_badly_become_fewer() {
    let (counts, places) = in_comments(|lines| match ends_badly(lines) {
        true => vec![lines[0].to_owned()],
        false => Vec::new(),
    });
    assert!(
        places.len() <= BAD_ENDS_IN_COMMENTS,
        "{} first sentences end in 'at most', 'about' or 'too', {BAD_ENDS_IN_COMMENTS} did: {counts:?} {places:#?}",
        places.len()
    );
}

#[test]
fn words_are_found() {
    let page = "# Head\n\nOne [link](a.md) of\ntwo. Three `a. B` four.\n\n- five\n  six\n\n| x | told |\n\n```sh\ntold\n```\n";
    let parts = parts(page);
    let texts: Vec<String> = parts.iter().map(|part| plain(&part.text)).collect();
    let expected = [
        "# Head",
        "One [link of two. Three X four.",
        "five six",
        "| x | told |",
    ];
    assert_eq!(texts, expected);
    assert_eq!(
        sentences(&texts[1]),
        ["One [link of two. ", "Three X four."]
    );
    assert_eq!(words("one, (two) - three"), 3);
    assert_eq!(
        metaphors("It goes on; \"it told\" `tell` a teller, Told."),
        ["told", "goes on"]
    );
    let source =
        "/// Bytes of a sample, at most.\nfn a() {}\n    /// What it is about. Too.\n//! x\n";
    let comments = comments(source);
    assert_eq!(comments.len(), 2);
    assert!(ends_badly(&comments[0].1) && ends_badly(&comments[1].1));
    assert!(!ends_badly(&["At most four."]));
    let comments = comments_of_definition("# Told.\nint32 a  # Metres, too.\n\nint32 b\n");
    assert_eq!(comments.len(), 2);
    assert!(ends_badly(&comments[1].1) && metaphors(comments[0].1[0]) == ["told"]);
}
