use super::{is_token, shown, validate_namespace};
use std::str::FromStr;

/// Kind of names that a rule applies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NameKind {
    /// Topics and services.
    Any,
    /// `rostopic://`: topics only.
    Topic,
    /// `rosservice://`: services only.
    Service,
}

/// Replacement that a rule makes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RemapTarget {
    /// `__node:=name`.
    NodeName(String),
    /// `__ns:=/namespace`.
    Namespace(String),
    /// `from:=to`, both sides still relative to the node.
    Name {
        /// Topics, services or both.
        kind: NameKind,
        /// The name to replace.
        from: String,
        /// What takes its place.
        to: String,
    },
}

/// One `-r` rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemapRule {
    /// The only node the rule is for, or all of them.
    pub node: Option<String>,
    /// What it replaces.
    pub target: RemapTarget,
}

impl RemapRule {
    /// True if the rule is for the node of this name.
    pub fn applies_to(&self, node_name: &str) -> bool {
        self.node.as_deref().is_none_or(|node| node == node_name)
    }
}

impl FromStr for RemapRule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (node, rule) = split_node(text);
        let (from, to) = rule.split_once(":=").ok_or("there is no `:=`")?;
        let target = match from {
            "__node" | "__name" if is_token(to) => RemapTarget::NodeName(to.to_owned()),
            "__node" | "__name" => return Err(format!("`{}` is no node name", shown(to))),
            "__ns" => {
                validate_namespace(to).map_err(|error| error.to_string())?;
                RemapTarget::Namespace(to.to_owned())
            }
            _ => name_rule(from, to)?,
        };
        Ok(RemapRule {
            node: node.map(str::to_owned),
            target,
        })
    }
}

/// Splits `node:rest`; `rostopic://` and `rosservice://` are no node prefixes.
pub(crate) fn split_node(text: &str) -> (Option<&str>, &str) {
    match text.split_once(':') {
        Some((node, rest))
            if is_token(node)
                && !rest.starts_with('=')
                && !(matches!(node, "rostopic" | "rosservice") && rest.starts_with("//")) =>
        {
            (Some(node), rest)
        }
        _ => (None, text),
    }
}

fn name_rule(from: &str, to: &str) -> Result<RemapTarget, String> {
    let (kind, from) = if let Some(rest) = from.strip_prefix("rostopic://") {
        (NameKind::Topic, rest)
    } else if let Some(rest) = from.strip_prefix("rosservice://") {
        (NameKind::Service, rest)
    } else {
        (NameKind::Any, from)
    };
    check_name(from)?;
    check_name(to)?;
    Ok(RemapTarget::Name {
        kind,
        from: from.to_owned(),
        to: to.to_owned(),
    })
}

/// `[~/ or /] token (/ token)*`
fn check_name(name: &str) -> Result<(), String> {
    let tokens = name
        .strip_prefix("~/")
        .or_else(|| name.strip_prefix('/'))
        .unwrap_or(name);
    if tokens.split('/').all(is_token) {
        return Ok(());
    }
    Err(if name.is_empty() {
        "one side of `:=` is empty".to_owned()
    } else if name.contains('*') {
        format!(
            "`{}` has a wildcard, which ROS remap rules do not know",
            shown(name)
        )
    } else {
        format!("`{}` is no name", shown(name))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_prefixes_are_not_urls() {
        assert_eq!(split_node("mapper:a:=b"), (Some("mapper"), "a:=b"));
        assert_eq!(split_node("rostopic:///a:=b"), (None, "rostopic:///a:=b"));
        assert_eq!(split_node("rostopic:/a:=b"), (Some("rostopic"), "/a:=b"));
        assert_eq!(split_node("a:=b"), (None, "a:=b"));
    }

    #[test]
    fn problems_say_what_is_wrong() {
        let problem = |text: &str| text.parse::<RemapRule>().unwrap_err();
        assert_eq!(problem("points"), "there is no `:=`");
        assert_eq!(problem("points:="), "one side of `:=` is empty");
        assert!(problem("/**:=points").contains("wildcard"));
        assert!(problem("__node:=/a/b").contains("`/a/b` is no node name"));
        assert!(problem("__ns:=robot").contains("robot"));
    }
}
