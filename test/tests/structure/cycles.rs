//! Files of a crate depend on each other one way.
//!
//! A file uses another if a path in it leads to an item that the other defines, through re-exports and
//! imports, or if it declares the other as a module. An item in `mod.rs` that one of its children uses
//! therefore makes a cycle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::root;
use super::tokens::tokens;

type Names = Vec<String>;

/// One file of a crate.
#[derive(Default)]
struct File {
    children: Vec<String>,
    defined: BTreeSet<String>,
    macros: BTreeSet<String>,
    /// Imports: path, name here (`*` for all), whether others can import it from here.
    imports: Vec<(Names, String, bool)>,
    /// Paths of more than one word outside of imports.
    paths: Vec<Names>,
}

impl File {
    fn read(text: &str) -> Self {
        let tokens = tokens(text);
        let mut file = Self::default();
        let (mut at, mut depth) = (0, 0_usize);
        let word = |at: usize| tokens.get(at).map_or("", String::as_str);
        while at < tokens.len() {
            match word(at) {
                "use" => {
                    let public = at > 0 && matches!(word(at - 1), "pub" | ")");
                    let mut leaves = Vec::new();
                    at = use_tree(&tokens, at + 1, &[], &mut leaves);
                    let with_flag = leaves.into_iter().map(|(path, name)| (path, name, public));
                    file.imports.extend(with_flag);
                    continue;
                }
                "mod" if word(at + 2) == ";" => file.children.push(word(at + 1).to_owned()),
                "macro_rules" => {
                    file.macros.insert(word(at + 2).to_owned());
                }
                "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union"
                | "mod"
                    if depth == 0 =>
                {
                    let skip = usize::from(word(at + 1) == "mut");
                    file.defined.insert(word(at + 1 + skip).to_owned());
                }
                "{" => depth += 1,
                "}" => depth = depth.saturating_sub(1),
                // `pub(in path)` says who sees an item.
                "in" if at > 1 && word(at - 1) == "(" && word(at - 2) == "pub" => {
                    while at < tokens.len() && word(at) != ")" {
                        at += 1;
                    }
                }
                first if is_word(first) && word(at + 1) == "::" => {
                    let mut path = vec![first.to_owned()];
                    while word(at + 1) == "::" && is_word(word(at + 2)) {
                        path.push(word(at + 2).to_owned());
                        at += 2;
                    }
                    file.paths.push(path);
                }
                _ => {}
            }
            at += 1;
        }
        file
    }
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Leaves of a tree of imports, as paths and their names here; the place after the tree.
fn use_tree(
    tokens: &[String],
    mut at: usize,
    prefix: &[String],
    leaves: &mut Vec<(Names, String)>,
) -> usize {
    let word = |at: usize| tokens.get(at).map_or(";", String::as_str);
    let mut path = prefix.to_vec();
    loop {
        match word(at) {
            "::" => at += 1,
            "{" => {
                at += 1;
                while word(at) != "}" && word(at) != ";" {
                    at = use_tree(tokens, at, &path, leaves);
                    at += usize::from(word(at) == ",");
                }
                return at + 1;
            }
            "as" => {
                leaves.push((path, word(at + 1).to_owned()));
                return at + 2;
            }
            "*" => {
                leaves.push((path, "*".to_owned()));
                return at + 1;
            }
            "self" if !path.is_empty() => at += 1,
            name if is_word(name) => {
                path.push(name.to_owned());
                at += 1;
            }
            _ => {
                let name = path.last().cloned().unwrap_or_default();
                leaves.push((path, name));
                return at;
            }
        }
    }
}

/// Files of a crate by the paths of their modules.
struct Crate(BTreeMap<Names, File>);

/// Target of a path.
#[derive(Clone, PartialEq)]
enum Target {
    Module(Names),
    Item(Names),
}

impl Crate {
    fn read(source: &Path) -> Self {
        let mut files = BTreeMap::new();
        let mut waiting = vec![Names::new()];
        while let Some(module) = waiting.pop() {
            let file = File::read(&fs::read_to_string(file_of(source, &module)).unwrap());
            for child in &file.children {
                waiting.push([module.clone(), vec![child.clone()]].concat());
            }
            files.insert(module, file);
        }
        Self(files)
    }

    /// Follows a path that stands in `module`. `seen` ends imports of each other.
    fn follow(
        &self,
        module: &Names,
        path: &[String],
        seen: &mut Vec<(Names, String)>,
    ) -> Option<Target> {
        let (first, mut rest) = path.split_first()?;
        let mut here = module.clone();
        match first.as_str() {
            "crate" => here.clear(),
            "self" => {}
            "super" => {
                here.pop();
                while let Some((_, more)) = rest.split_first().filter(|(name, _)| *name == "super")
                {
                    here.pop();
                    rest = more;
                }
            }
            _ => match self.named(module, first, seen)? {
                Target::Module(found) => here = found,
                item => return Some(item),
            },
        }
        for name in rest {
            match self.named(&here, name, seen) {
                Some(Target::Module(found)) => here = found,
                Some(item) => return Some(item),
                // Of another crate.
                None if self.imports(&here, name) => return None,
                // A macro, or something that another macro made.
                None => {
                    let holder = self.0.iter().find(|(_, file)| file.macros.contains(name));
                    let holder = holder.map_or(&here, |(module, _)| module);
                    return Some(Target::Item(holder.clone()));
                }
            }
        }
        Some(Target::Module(here))
    }

    /// Tests whether a module imports a name.
    fn imports(&self, module: &Names, name: &str) -> bool {
        let file = self.0.get(module);
        file.is_some_and(|file| file.imports.iter().any(|(_, here, _)| here == name))
    }

    /// Target of a name in a module.
    fn named(&self, module: &Names, name: &str, seen: &mut Vec<(Names, String)>) -> Option<Target> {
        let file = self.0.get(module)?;
        let key = (module.clone(), name.to_owned());
        if seen.contains(&key) {
            return None;
        }
        if file.children.iter().any(|child| child == name) {
            return Some(Target::Module(
                [module.clone(), vec![name.to_owned()]].concat(),
            ));
        }
        if file.defined.contains(name) {
            return Some(Target::Item(module.clone()));
        }
        seen.push(key);
        let imports = file.imports.iter();
        let named = imports.clone().filter(|(_, here, _)| here == name);
        let mut found = named.filter_map(|(path, _, _)| self.follow(module, path, seen));
        if let Some(target) = found.next() {
            return Some(target);
        }
        imports
            .filter(|(_, here, _)| here == "*")
            .find_map(|(path, _, _)| match self.follow(module, path, seen)? {
                Target::Module(from) => self.named(&from, name, seen),
                Target::Item(_) => None,
            })
    }

    /// Files that a file uses, with a path that leads to each.
    fn edges(&self, module: &Names) -> BTreeMap<Names, String> {
        let file = &self.0[module];
        let mut found = BTreeMap::new();
        for child in &file.children {
            let child = [module.clone(), vec![child.clone()]].concat();
            found.insert(child, "mod".to_owned());
        }
        let mut add = |path: &Names, is_used: bool| {
            let target = match self.follow(module, path, &mut Vec::new()) {
                Some(Target::Item(target)) => target,
                Some(Target::Module(target)) if is_used => target,
                _ => return,
            };
            if target != *module {
                found.entry(target).or_insert_with(|| path.join("::"));
            }
        };
        for (path, name, public) in &file.imports {
            // A module that is imported is used by the paths that begin with its name.
            add(path, *public || name == "*");
        }
        for path in &file.paths {
            add(path, false);
        }
        found
    }

    /// Sets of files that use each other, the largest first.
    fn cycles(&self) -> Vec<Vec<Names>> {
        let edges: BTreeMap<&Names, BTreeMap<Names, String>> = self
            .0
            .keys()
            .map(|module| (module, self.edges(module)))
            .collect();
        let reached = |from: &Names| {
            let mut seen = BTreeSet::new();
            let mut waiting = vec![from];
            while let Some(module) = waiting.pop() {
                for to in edges[module].keys() {
                    if seen.insert(to) {
                        waiting.push(to);
                    }
                }
            }
            seen
        };
        let all: BTreeMap<&Names, BTreeSet<&Names>> = self
            .0
            .keys()
            .map(|module| (module, reached(module)))
            .collect();
        let mut found: Vec<Vec<Names>> = Vec::new();
        for (module, to) in &all {
            if to.contains(module) && !found.iter().flatten().any(|known| known == *module) {
                let both = to.iter().filter(|other| all[*other].contains(module));
                found.push(both.map(|other| (*other).clone()).collect());
            }
        }
        found.sort_by_key(|cycle| std::cmp::Reverse(cycle.len()));
        found
    }

    /// Edges within a cycle, one a line.
    fn describe(&self, cycle: &[Names]) -> String {
        let mut lines = String::new();
        for from in cycle {
            for (to, path) in self.edges(from) {
                if cycle.contains(&to) && path != "mod" {
                    lines += &format!("  {} uses {} ({path})\n", shown(from), shown(&to));
                }
            }
        }
        lines
    }
}

fn shown(module: &[String]) -> String {
    if module.is_empty() {
        "lib".to_owned()
    } else {
        module.join("::")
    }
}

fn file_of(source: &Path, module: &[String]) -> std::path::PathBuf {
    if module.is_empty() {
        let library = source.join("lib.rs");
        return if library.exists() {
            library
        } else {
            source.join("main.rs")
        };
    }
    let path = source.join(module.join("/"));
    let file = path.with_extension("rs");
    if file.exists() {
        file
    } else {
        path.join("mod.rs")
    }
}

/// Crates, and the number of their files that are in cycles. A number may fall, not rise.
const CRATES: [(&str, usize); 7] = [
    ("msgs/src", 0),
    ("lattice_core/src", 0),
    ("nodes/src", 0),
    ("nodes/runtime/src", 0),
    ("nodes/bag/src", 0),
    ("nodes/lab/src", 0),
    ("nodes/cli/src", 0),
];

#[test]
fn files_point_one_way() {
    for (source, allowed) in CRATES {
        let files = Crate::read(&root().join(source));
        let cycles = files.cycles();
        let count: usize = cycles.iter().map(Vec::len).sum();
        let mut report = String::new();
        for cycle in &cycles {
            let names: Vec<String> = cycle.iter().map(|module| shown(module)).collect();
            report += &format!("these use each other: {}\n", names.join(", "));
            report += &files.describe(cycle);
        }
        assert!(
            count <= allowed,
            "{source}: {count} files are in cycles, {allowed} are allowed:\n{report}"
        );
        assert!(
            count >= allowed,
            "{source}: {count} files are in cycles: write this number into CRATES"
        );
    }
}
