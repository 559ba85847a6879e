//! ROS names: expansion, remapping and validation as in rcl and rmw.

mod remap;
mod renamed;
mod shown;
mod validate;

pub(crate) use remap::{NameKind, RemapRule, RemapTarget, split_node};
pub use renamed::renamed_topic;
pub(crate) use shown::shown;

pub use validate::NameError;
use validate::{cut, invalid};
pub(crate) use validate::{
    fully_qualified, is_identifier, is_token, validate_full_name, validate_namespace,
    validate_node_name,
};

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

#[cfg(test)]
mod tests;
