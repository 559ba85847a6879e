//! Validation of names by the rules of rcl and rmw.

use thiserror::Error;

/// Limits of rmw: full topic or service name, namespace and node name, bytes.
pub(super) const TOPIC_LENGTH_MAX: usize = 247;
pub(super) const NAMESPACE_LENGTH_MAX: usize = 245;

pub(super) const NODE_NAME_LENGTH_MAX: usize = 255;

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

pub(super) fn full(what: &'static str, name: &str, length_max: usize) -> Result<(), NameError> {
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

pub(super) fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

pub(super) fn length(what: &'static str, name: &str, length_max: usize) -> Result<(), NameError> {
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

pub(super) fn invalid(what: &'static str, name: &str, problem: &'static str) -> NameError {
    NameError::Invalid {
        what,
        name: cut(name),
        problem,
    }
}

/// Name, shortened for messages.
pub(super) fn cut(name: &str) -> String {
    name.chars().take(NODE_NAME_LENGTH_MAX).collect()
}
