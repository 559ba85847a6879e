//! Parameters watched by a client.

use std::collections::BTreeMap;

/// Limit of name bytes per client.
const MAX_NAME_BYTES: usize = 64 << 10;

/// Watched names, or all.
#[derive(Debug, Default)]
pub struct Watched {
    /// True if all parameters except the named ones are watched.
    others: bool,
    named: BTreeMap<String, bool>,
}

impl Watched {
    /// Starts or stops watching these names (none: all); false above the limit.
    pub fn change(&mut self, names: Vec<String>, watch: bool) -> bool {
        if names.is_empty() {
            self.named.clear();
            self.others = watch;
            return true;
        }
        for name in names {
            self.named.remove(&name);
            if watch != self.others {
                self.named.insert(name, watch);
            }
        }
        let fits = self.named.keys().map(|name| name.len() + 64).sum::<usize>() <= MAX_NAME_BYTES;
        if !fits {
            *self = Self::default();
        }
        fits
    }

    /// True if the parameter is watched.
    pub fn wants(&self, name: &str) -> bool {
        self.named.get(name).copied().unwrap_or(self.others)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn names_and_all_come_and_go() {
        let mut watched = Watched::default();
        assert!(!watched.wants("/a.b"));
        assert!(watched.change(names(&["/a.b"]), true));
        assert_eq!(
            ["/a.b", "/a.c"].map(|name| watched.wants(name)),
            [true, false]
        );
        assert!(watched.change(Vec::new(), true));
        assert!(watched.change(names(&["/a.c"]), false));
        assert_eq!(
            ["/a.b", "/a.c"].map(|name| watched.wants(name)),
            [true, false]
        );
        assert!(watched.change(Vec::new(), false));
        assert!(!watched.wants("/a.b") && watched.named.is_empty());
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut watched = Watched::default();
        let many = (0..1000).map(|i| format!("/node.{i}"));
        assert!(!watched.change(many.collect(), true));
        assert!(watched.named.is_empty());
        assert!(!watched.change(vec!["x".repeat(65_536)], true));
    }
}
