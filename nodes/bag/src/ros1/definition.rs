//! Message definitions of ROS 1, and the same as text of ROS 2.

use std::collections::{HashMap, HashSet};

use super::added::{ADDED, NEEDED};

/// Limits of a definition: text, types, fields of a type, nesting.
const MAX_TEXT_BYTES: usize = 4 << 20;
const MAX_TYPES: usize = 1000;
const MAX_FIELDS: usize = 10_000;
const MAX_NESTING: usize = 64;

const HEADER: &str = "std_msgs/Header";
/// Definition of the header, which some writers omit.
const HEADER_TEXT: &str = "uint32 seq\ntime stamp\nstring frame_id\n";

/// Primitive types with their sizes, bytes, and names in ROS 2.
pub(super) const PRIMITIVES: &[(&str, usize, &str)] = &[
    ("bool", 1, "bool"),
    ("byte", 1, "byte"),
    ("char", 1, "char"),
    ("int8", 1, "int8"),
    ("uint8", 1, "uint8"),
    ("int16", 2, "int16"),
    ("uint16", 2, "uint16"),
    ("int32", 4, "int32"),
    ("uint32", 4, "uint32"),
    ("float32", 4, "float32"),
    ("int64", 8, "int64"),
    ("uint64", 8, "uint64"),
    ("float64", 8, "float64"),
];

/// Type of a field's elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// Number: index into [`PRIMITIVES`].
    Number(usize),
    Text,
    Time,
    Duration,
    /// Message: index into the types of the definition.
    Message(usize),
}

/// Size of a number, bytes.
pub(super) fn number_bytes(primitive: usize) -> usize {
    PRIMITIVES.get(primitive).map_or(1, |(_, bytes, _)| *bytes)
}

/// Number of a field's elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Count {
    One,
    Fixed(u32),
    Any,
}

/// Versions that have a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    Both,
    /// ROS 1 alone.
    Dropped,
    /// ROS 2 alone.
    Added,
}

#[derive(Clone, Debug)]
pub(super) struct Field {
    pub name: String,
    pub kind: Kind,
    pub count: Count,
    pub place: Place,
}

/// A message type with its fields.
#[derive(Clone, Debug, Default)]
pub(super) struct MessageType {
    pub name: String,
    pub fields: Vec<Field>,
    /// Lines of ROS 2.
    pub constants: Vec<String>,
}

/// A message definition with its dependencies; the first type is that of the message.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    pub types: Vec<MessageType>,
}

/// Type name in ROS 2 of a ROS 1 type: `package/msg/Type`.
pub(crate) fn ros2_name(name: &str) -> String {
    match name {
        // The type of /tf before tf2.
        "tf/tfMessage" => "tf2_msgs/msg/TFMessage".to_owned(),
        _ => crate::storage::full_type_name(name),
    }
}

impl Definition {
    /// Parses the definition of a type; the error is a reason.
    pub(super) fn parse(type_name: &str, text: &str) -> Result<Definition, String> {
        if text.len() > MAX_TEXT_BYTES {
            let bytes = text.len();
            return Err(format!(
                "a definition of {bytes} bytes, more than {MAX_TEXT_BYTES}"
            ));
        }
        let sections = sections(type_name, text);
        if sections.len() > MAX_TYPES {
            return Err(format!("{} types, more than {MAX_TYPES}", sections.len()));
        }
        let names = sections.iter().enumerate();
        let places: HashMap<&str, usize> =
            names.map(|(at, (name, _))| (name.as_str(), at)).collect();
        let types = sections
            .iter()
            .map(|(name, lines)| message_type(name, lines, &places))
            .collect::<Result<Vec<_>, String>>()?;
        let definition = Definition { types };
        definition.expect_finite(0, &mut HashSet::new(), 0)?;
        Ok(definition)
    }

    /// Rejects types that contain themselves, and deep nesting.
    fn expect_finite(
        &self,
        at: usize,
        checked: &mut HashSet<usize>,
        depth: usize,
    ) -> Result<(), String> {
        let Some(message) = self.types.get(at).filter(|_| !checked.contains(&at)) else {
            return Ok(());
        };
        if depth > MAX_NESTING {
            let name = &message.name;
            return Err(format!(
                "{name} contains itself, or is nested deeper than {MAX_NESTING}"
            ));
        }
        for field in &message.fields {
            if let Kind::Message(inner) = field.kind {
                self.expect_finite(inner, checked, depth + 1)?;
            }
        }
        checked.insert(at);
        Ok(())
    }
}

/// Types of a definition, each with its lines.
fn sections<'a>(type_name: &str, text: &'a str) -> Vec<(String, Vec<&'a str>)> {
    let mut sections = vec![(short_name(type_name), Vec::new())];
    for line in text.lines() {
        let bare = line.trim();
        if bare.len() >= 3 && bare.bytes().all(|b| b == b'=') {
            continue;
        }
        match (bare.strip_prefix("MSG:"), sections.last_mut()) {
            (Some(name), _) => sections.push((short_name(name.trim()), Vec::new())),
            (None, Some((_, lines))) => lines.push(line),
            (None, None) => {}
        }
    }
    let has = |sections: &[(String, Vec<&str>)], wanted: &str| {
        sections.iter().any(|(name, _)| name == wanted)
    };
    let is_extended = |(name, _): &(String, _)| ADDED.iter().any(|added| added.to == *name);
    if sections.iter().any(is_extended) {
        for (name, text) in NEEDED {
            if !has(&sections, name) {
                sections.push(((*name).to_owned(), text.lines().collect()));
            }
        }
    }
    if !has(&sections, HEADER) {
        sections.push((HEADER.to_owned(), HEADER_TEXT.lines().collect()));
    }
    sections
}

/// `package/Type` of either version's name.
fn short_name(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}

fn message_type(
    name: &str,
    lines: &[&str],
    places: &HashMap<&str, usize>,
) -> Result<MessageType, String> {
    let mut message = MessageType {
        name: name.to_owned(),
        ..MessageType::default()
    };
    for line in lines {
        let wrong = |reason: &str| format!("{name}: {reason}: {:?}", shown(line));
        let bare = line.split('#').next().unwrap_or_default().trim();
        if bare.is_empty() {
            continue;
        }
        let Some((type_name, rest)) = bare.split_once(char::is_whitespace) else {
            return Err(wrong("neither a field nor a constant"));
        };
        if rest.contains('=') {
            message.constants.extend(constant(type_name, line));
            continue;
        }
        let field = field(type_name, rest, name, places).map_err(wrong)?;
        message.fields.push(field);
        if message.fields.len() > MAX_FIELDS {
            return Err(format!("{name} has more than {MAX_FIELDS} fields"));
        }
    }
    for added in ADDED.iter().filter(|added| added.to == name) {
        if let Some((type_name, rest)) = added.line.split_once(' ') {
            let field = field(type_name, rest, name, places);
            message.add(field.map_err(str::to_owned)?, added.after);
        }
    }
    Ok(message)
}

fn field(
    type_name: &str,
    name: &str,
    within: &str,
    places: &HashMap<&str, usize>,
) -> Result<Field, &'static str> {
    let (element, count) = counted(type_name).ok_or("an invalid array")?;
    let name = name.trim();
    Ok(Field {
        name: name.to_owned(),
        kind: kind(element, within, places).ok_or("an unknown type")?,
        count,
        place: match within == HEADER && name == "seq" {
            true => Place::Dropped,
            false => Place::Both,
        },
    })
}

impl MessageType {
    /// Adds a field of ROS 2, unless it is there; one of its name and of another type is dropped.
    fn add(&mut self, field: Field, after: Option<&str>) {
        let named = self
            .fields
            .iter_mut()
            .find(|known| known.name == field.name);
        if let Some(known) = named {
            if (known.kind, known.count) == (field.kind, field.count) {
                return;
            }
            known.place = Place::Dropped;
        }
        let before = |name| self.fields.iter().rposition(|known| known.name == name);
        let at = after
            .and_then(before)
            .map_or(self.fields.len(), |at| at + 1);
        let place = Place::Added;
        self.fields.insert(at, Field { place, ..field });
    }
}

/// Text for an error, shortened.
fn shown(line: &str) -> String {
    line.chars().take(100).collect()
}

/// Element type and count of `type`, `type[]` or `type[3]`.
fn counted(type_name: &str) -> Option<(&str, Count)> {
    let Some(open) = type_name.strip_suffix(']') else {
        return Some((type_name, Count::One));
    };
    let (element, count) = open.split_once('[')?;
    let count = match count {
        "" => Count::Any,
        count => Count::Fixed(count.parse().ok()?),
    };
    Some((element, count))
}

fn kind(element: &str, within: &str, places: &HashMap<&str, usize>) -> Option<Kind> {
    match element {
        "string" => return Some(Kind::Text),
        "time" => return Some(Kind::Time),
        "duration" => return Some(Kind::Duration),
        _ => {}
    }
    let number = PRIMITIVES.iter().position(|(name, ..)| *name == element);
    if let Some(number) = number {
        return Some(Kind::Number(number));
    }
    let package = within.split('/').next().unwrap_or_default();
    let name = match element {
        "Header" => HEADER.to_owned(),
        name if name.contains('/') => short_name(name),
        name => format!("{package}/{name}"),
    };
    places.get(name.as_str()).copied().map(Kind::Message)
}

/// Constant in the form of ROS 2; `None` if that has no such constant.
fn constant(type_name: &str, line: &str) -> Option<String> {
    let (left, value) = line.split_once('=')?;
    let name = left.split_whitespace().last()?.to_uppercase();
    let is_name = name.starts_with(|c: char| c.is_ascii_uppercase())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let value = match type_name {
        // All of the line belongs to a text.
        "string" => format!("{:?}", value.trim()),
        _ => value
            .split('#')
            .next()
            .unwrap_or_default()
            .trim()
            .to_owned(),
    };
    let is_number = PRIMITIVES.iter().any(|(known, ..)| *known == type_name);
    (is_name && (is_number || type_name == "string")).then(|| format!("{type_name} {name}={value}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_definitions_are_named() {
        let reason = |text: &str| Definition::parse("a/B", text).unwrap_err();
        assert!(reason("nonsense").contains("neither a field"));
        assert!(reason("int99 x").contains("unknown type"));
        assert!(reason("int8[<=3] x").contains("invalid array"));
        assert!(reason("B b").contains("contains itself"));
        assert!(reason("C c\nMSG: a/C\nB[] b").contains("contains itself"));
        assert!(reason(&"int8 x\n".repeat(MAX_FIELDS + 1)).contains("fields"));
        assert!(reason(&"MSG: a/C\n".repeat(MAX_TYPES + 1)).contains("types"));
        // Twice as many ways at each of many levels.
        let level = |at: usize| format!("L{0} x\nL{0} y\nMSG: a/L{0}\n", at);
        let deep: String = (0..60).map(level).collect();
        assert!(Definition::parse("a/B", &deep).is_ok());
        let deeper: String = (0..80).map(level).collect();
        assert!(reason(&deeper).contains("deeper"));
    }
}
