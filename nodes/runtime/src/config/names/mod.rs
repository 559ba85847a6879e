//! ROS names: expansion, remapping and validation as in rcl and rmw.

mod remap;
mod renamed;
mod shown;

pub(crate) use remap::{NameKind, RemapRule, RemapTarget, split_node};
pub use renamed::renamed_topic;
pub(crate) use shown::shown;

use thiserror::Error;

/// Limits of rmw: full topic or service name, namespace and node name, bytes.
const TOPIC_LENGTH_MAX: usize = 247;
const NAMESPACE_LENGTH_MAX: usize = 245;
const NODE_NAME_LENGTH_MAX: usize = 255;

/// Reason for rejecting a name. Names are shortened for the message.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NameError {
    #[error("the {what} {name:?} {problem}")]
    Invalid {
        what: &'static str,
        name: String,
        problem: &'static str,
    },
    #[error(
        "the topic {name:?} has the unknown substitution {{{key}}}; use {{node}}, {{ns}} or {{namespace}}"
    )]
    UnknownSubstitution { name: String, key: String },
    /// Length above rmw's limit, bytes.
    #[error("the {what} {name:?} has {length} bytes, more than {length_max}")]
    TooLong {
        what: &'static str,
        name: String,
        length: usize,
        length_max: usize,
    },
}

/// True if `text` is one token of a remap rule: an identifier with single underscores.
pub(crate) fn is_token(text: &str) -> bool {
    is_identifier(text) && !text.contains("__")
}

/// True if `text` is one part of a name: letters, digits and underscores, no digit first.
pub(crate) fn is_identifier(text: &str) -> bool {
    text.bytes().all(is_word) && !text.starts_with(|c: char| c.is_ascii_digit()) && !text.is_empty()
}

/// Full name of a topic or service of the node, after the first matching remap rule.
///
/// Supports `/absolute`, `relative`, `~/private`, `{node}`, `{ns}` and `{namespace}`. If no rule has the name of a
/// renamed topic, the first one with its former name applies.
pub(crate) fn resolve(
    kind: NameKind,
    name: &str,
    node_name: &str,
    namespace: &str,
    remaps: &[RemapRule],
) -> Result<String, NameError> {
    let full = expand(name, node_name, namespace)?;
    let rule_of = |full: &str| {
        for rule in remaps.iter().filter(|rule| rule.applies_to(node_name)) {
            let RemapTarget::Name { kind: of, from, to } = &rule.target else {
                continue;
            };
            if (*of == NameKind::Any || *of == kind) && expand(from, node_name, namespace)? == full
            {
                return Ok(Some((from, to)));
            }
        }
        Ok(None)
    };
    let mut rule = rule_of(&full)?;
    if rule.is_none()
        && kind == NameKind::Topic
        && let Some(former) = renamed::former_name(&full)
    {
        rule = rule_of(&former)?;
        if let Some((from, to)) = rule {
            renamed::warn_of_rule(from, to);
        }
    }
    let full = rule.map_or(Ok(full), |(_, to)| expand(to, node_name, namespace))?;
    validate_full_name(&full)?;
    Ok(full)
}

/// Full name of a topic before remapping; `//` and lengths are not checked yet.
fn expand(name: &str, node_name: &str, namespace: &str) -> Result<String, NameError> {
    validate_node_name(node_name)?;
    validate_namespace(namespace)?;
    validate_unexpanded(name)?;
    let node = fully_qualified(node_name, namespace);
    let mut text = match name.strip_prefix('~') {
        Some(rest) => format!("{node}{rest}"),
        None => name.to_owned(),
    };
    while let Some((head, tail)) = text.split_once('{') {
        let (key, tail) = tail.split_once('}').unwrap_or((tail, ""));
        let value = match key {
            "node" => node_name,
            "ns" | "namespace" => namespace,
            _ => {
                let (name, key) = (cut(name), cut(key));
                return Err(NameError::UnknownSubstitution { name, key });
            }
        };
        text = format!("{head}{value}{tail}");
    }
    Ok(match text.starts_with('/') {
        true => text,
        false => fully_qualified(&text, namespace),
    })
}

/// Full name of a node, for example `/robot/mapper`.
pub(crate) fn fully_qualified(node_name: &str, namespace: &str) -> String {
    format!("{}/{node_name}", namespace.trim_end_matches('/'))
}

/// Validates a node name by the rules of rmw.
pub(crate) fn validate_node_name(name: &str) -> Result<(), NameError> {
    let invalid = |problem| invalid("node name", name, problem);
    if name.is_empty() {
        Err(invalid("is empty"))
    } else if !name.bytes().all(is_word) {
        Err(invalid("may have letters, digits and underscores only"))
    } else if name.starts_with(|c: char| c.is_ascii_digit()) {
        Err(invalid("must not start with a digit"))
    } else {
        length("node name", name, NODE_NAME_LENGTH_MAX)
    }
}

/// Validates a namespace by the rules of rmw: `/`, or a full name.
pub(crate) fn validate_namespace(namespace: &str) -> Result<(), NameError> {
    if namespace == "/" {
        return Ok(());
    }
    full("namespace", namespace, NAMESPACE_LENGTH_MAX)
}

/// Validates a full topic or service name by the rules of rmw.
pub(crate) fn validate_full_name(name: &str) -> Result<(), NameError> {
    full("topic", name, TOPIC_LENGTH_MAX)
}

fn full(what: &'static str, name: &str, length_max: usize) -> Result<(), NameError> {
    let invalid = |problem| Err(invalid(what, name, problem));
    let Some(tokens) = name.strip_prefix('/') else {
        return invalid("must start with `/`");
    };
    if tokens.is_empty() || tokens.ends_with('/') {
        return invalid("must not end with `/`");
    }
    for token in tokens.split('/') {
        match token.bytes().next() {
            None => return invalid("must not have `//`"),
            Some(b'0'..=b'9') => return invalid("has a part that starts with a digit"),
            _ if !token.bytes().all(is_word) => {
                return invalid("may have letters, digits, underscores and `/` only");
            }
            _ => {}
        }
    }
    length(what, name, length_max)
}

/// Validates a name before expansion by the rules of rcl.
fn validate_unexpanded(name: &str) -> Result<(), NameError> {
    let invalid = |problem| Err(invalid("topic", name, problem));
    if name.is_empty() {
        return invalid("is empty");
    }
    if name.ends_with('/') {
        return invalid("must not end with `/`");
    }
    let rest = name.strip_prefix('~').unwrap_or(name);
    if rest.contains('~') || (rest != name && !rest.is_empty() && !rest.starts_with('/')) {
        return invalid("may have `~` only in front, alone or before `/`");
    }
    let mut key_length = None;
    let mut before = '/';
    for c in rest.chars() {
        let starts = key_length.map_or(before == '/', |length: usize| length == 0);
        match (c, key_length) {
            ('{', None) => key_length = Some(0),
            ('}', Some(1..)) => key_length = None,
            ('{' | '}', _) => return invalid("has braces that do not pair as `{name}`"),
            ('0'..='9', _) if starts => return invalid("has a part that starts with a digit"),
            ('/', None) => {}
            ('_' | '0'..='9' | 'a'..='z' | 'A'..='Z', None) => {}
            ('_' | '0'..='9' | 'a'..='z' | 'A'..='Z', Some(length)) => {
                key_length = Some(length.saturating_add(1));
            }
            _ => {
                return invalid("may have letters, digits, `_`, `/`, a leading `~` and `{…}` only");
            }
        }
        before = c;
    }
    if key_length.is_some() {
        return invalid("has braces that do not pair as `{name}`");
    }
    Ok(())
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

fn length(what: &'static str, name: &str, length_max: usize) -> Result<(), NameError> {
    let length = name.len();
    if length <= length_max {
        return Ok(());
    }
    Err(NameError::TooLong {
        what,
        name: cut(name),
        length,
        length_max,
    })
}

fn invalid(what: &'static str, name: &str, problem: &'static str) -> NameError {
    NameError::Invalid {
        what,
        name: cut(name),
        problem,
    }
}

/// Name, shortened for messages.
fn cut(name: &str) -> String {
    name.chars().take(NODE_NAME_LENGTH_MAX).collect()
}

#[cfg(test)]
mod tests;
