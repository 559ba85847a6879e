use super::{is_token, shown, validate_namespace};
use std::str::FromStr;

/// Names that a rule applies to: `rostopic://`, `rosservice://` or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NameKind {
    Any,
    Topic,
    Service,
}

/// Replacement by a rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum RemapTarget {
    /// `__node:=name`.
    NodeName(String),
    /// `__ns:=/namespace`.
    Namespace(String),
    /// `from:=to`, both sides still relative to the node.
    Name {
        kind: NameKind,
        from: String,
        to: String,
    },
}

/// One remap rule (`-r`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RemapRule {
    /// Node that the rule is restricted to; `None`: all nodes.
    pub node: Option<String>,
    pub target: RemapTarget,
}

impl RemapRule {
    /// True if the rule applies to the node of this name.
    pub(crate) fn applies_to(&self, node_name: &str) -> bool {
        self.node.as_deref().is_none_or(|node| node == node_name)
    }
}

impl FromStr for RemapRule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (node, rule) = split_node(text);
        let (from, to) = rule.split_once(":=").ok_or("`:=` is missing")?;
        let target = match from {
            "__node" | "__name" if is_token(to) => RemapTarget::NodeName(to.to_owned()),
            "__node" | "__name" => return Err(format!("`{}` is not a valid node name", shown(to))),
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

/// Splits `node:rest`; `rostopic://` and `rosservice://` are not node prefixes.
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
    let topic = from.strip_prefix("rostopic://");
    let service = from.strip_prefix("rosservice://");
    let (kind, from) = match (topic, service) {
        (Some(rest), _) => (NameKind::Topic, rest),
        (_, Some(rest)) => (NameKind::Service, rest),
        _ => (NameKind::Any, from),
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
    let rooted = name.strip_prefix("~/").or(name.strip_prefix('/'));
    if rooted.unwrap_or(name).split('/').all(is_token) {
        return Ok(());
    }
    let shown = shown(name);
    Err(match name {
        "" => "one side of `:=` is empty".to_owned(),
        _ if name.contains('*') => {
            format!("`{shown}` has a wildcard, which ROS remap rules do not support")
        }
        _ => format!("`{shown}` is not a valid name"),
    })
}
