//! Links of the pages to files and headings of the repository.

use std::fs;
use std::path::Path;

use super::blocks::{pages, root};

/// Targets of the links of a page, without those in fenced blocks and to other sites.
fn targets(text: &str) -> Vec<String> {
    let outside = text.split("\n```").step_by(2);
    let links = outside.flat_map(|part| part.split("](").skip(1));
    let targets = links.filter_map(|rest| rest.split_once(')'));
    let targets = targets.map(|(target, _)| target.to_owned());
    let is_ours = |target: &String| !target.starts_with("http") && !target.contains(' ');
    targets.filter(is_ours).collect()
}

/// Names of the headings of a page, as a link has them behind `#`.
fn has_heading(text: &str, name: &str) -> bool {
    let simple = |heading: &str| -> String {
        let kept = heading.trim().to_lowercase();
        let kept = kept
            .chars()
            .filter(|c| c.is_alphanumeric() || "-_ ".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let mut headings = headings.map(|line| simple(line.trim_start_matches('#')));
    headings.any(|heading| heading == name) || text.contains(&format!("id=\"{name}\""))
}

#[test]
fn links_of_the_pages_lead_to_what_is_there() {
    let mut wrong = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(root().join(&page)).unwrap();
        for target in targets(&text) {
            let (path, heading) = target.split_once('#').unwrap_or((&target, ""));
            let file = match path {
                "" => root().join(&page),
                path => root().join(Path::new(&page).parent().unwrap()).join(path),
            };
            let found = file.exists()
                && (heading.is_empty()
                    || file.extension().is_some_and(|ending| ending != "md")
                    || has_heading(&fs::read_to_string(&file).unwrap(), heading));
            if !found {
                wrong.push(format!("{page}: {target}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
