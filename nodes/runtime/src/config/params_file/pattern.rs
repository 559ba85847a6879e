use crate::config::names::is_identifier;

/// Node pattern of a section of a parameter file, for example `/**` or `/robot/*/mapper`.
///
/// `*` matches one part of a node's full name, `**` any number of parts.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodePattern {
    parts: Vec<Part>,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Name(String),
    One,
    Any,
}

impl NodePattern {
    /// Parses a pattern; one without a leading `/` is relative to the root.
    pub fn parse(text: &str) -> Result<NodePattern, &'static str> {
        let parts = text.strip_prefix('/').unwrap_or(text);
        if parts.is_empty() {
            return Err("parameters without a node above them");
        }
        let part = |part: &str| match part {
            "" => Err("a node name with an empty part"),
            "*" => Ok(Part::One),
            "**" => Ok(Part::Any),
            _ if is_identifier(part) => Ok(Part::Name(part.to_owned())),
            _ => Err("a node name with other characters than letters, digits, `_` and whole `*`"),
        };
        Ok(NodePattern {
            parts: parts.split('/').map(part).collect::<Result<_, _>>()?,
        })
    }

    /// Node name in the last part of the pattern; `None` for a wildcard.
    pub fn name(&self) -> Option<&str> {
        match self.parts.last() {
            Some(Part::Name(name)) => Some(name),
            _ => None,
        }
    }

    /// True if the last part of the pattern is exactly this node name.
    pub fn names(&self, node_name: &str) -> bool {
        self.name() == Some(node_name)
    }

    /// True if the pattern matches the node of this full name.
    pub fn matches(&self, node_fqn: &str) -> bool {
        let name: Vec<&str> = node_fqn
            .split('/')
            .filter(|part| !part.is_empty())
            .collect();
        // reached[i]: the parts so far can match the first i parts of the name.
        let mut reached: Vec<bool> = (0..=name.len()).map(|i| i == 0).collect();
        for part in &self.parts {
            let covers = |name: &str| match part {
                Part::Name(text) => text == name,
                _ => true,
            };
            let before = std::mem::take(&mut reached);
            let steps = before.iter().zip(&name).map(|(&r, name)| r && covers(name));
            reached = match part {
                Part::Any => (before.iter())
                    .scan(false, |any, &r| {
                        *any |= r;
                        Some(*any)
                    })
                    .collect(),
                _ => std::iter::once(false).chain(steps).collect(),
            };
        }
        reached.last().copied().unwrap_or(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn patterns_cover_what_rclcpp_covers() {
        for (pattern, node, expected) in [
            ("/**", "/mapper", true),
            ("/**", "/a/b/mapper", true),
            ("/*", "/mapper", true),
            ("/*", "/a/mapper", false),
            ("mapper", "/mapper", true),
            ("mapper", "/a/mapper", false),
            ("/a/mapper", "/a/mapper", true),
            ("/a/mapper", "/a/mappers", false),
            ("/a/**/mapper", "/a/mapper", true),
            ("/a/**/mapper", "/a/b/c/mapper", true),
            ("/a/**/mapper", "/b/mapper", false),
            ("/a/*/mapper", "/a/b/mapper", true),
            ("/a/*/mapper", "/a/mapper", false),
            ("/**/mapper", "/mapper", true),
            ("/a/**", "/a", true),
            ("/**/b/**/d", "/a/b/c/d", true),
            ("a__b", "/a__b", true),
            ("*", "/mapper", true),
        ] {
            let parsed = NodePattern::parse(pattern).unwrap();
            assert_eq!(parsed.matches(node), expected, "{pattern} on {node}");
        }
    }

    #[test]
    fn other_patterns_are_refused() {
        for bad in [
            "", "/", "//a", "a//b", "a/", "a b", "a*", "***", "/1a", "a.b", "ä",
        ] {
            assert!(NodePattern::parse(bad).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn many_stars_stay_cheap(stars in 1usize..200, depth in 1usize..100) {
            let pattern = NodePattern::parse(&"/**".repeat(stars)).unwrap();
            prop_assert!(pattern.matches(&"/a".repeat(depth)));
            let pattern = NodePattern::parse(&format!("{}/b", "/**".repeat(stars))).unwrap();
            prop_assert!(!pattern.matches(&"/a".repeat(depth)));
        }

        #[test]
        fn a_name_covers_itself_only(name in "(/[a-z][a-z0-9_]{0,5}){1,4}", other in "(/[a-z][a-z0-9_]{0,5}){1,4}") {
            let pattern = NodePattern::parse(&name).unwrap();
            prop_assert!(pattern.matches(&name));
            prop_assert_eq!(pattern.matches(&other), name == other);
        }
    }
}
