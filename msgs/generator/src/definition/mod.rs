//! Definitions of messages, services and actions as text.
//!
//! Format: <https://docs.ros.org/en/jazzy/Concepts/Basic/About-Interfaces.html>.

/// Messages of a definition: one, the two of a service, or the three of an action.
#[derive(Debug)]
pub enum Definition {
    Message(Message),
    Service([Message; 2]),
    Action([Message; 3]),
}

/// Fields and constants of a message.
#[derive(Debug, Default)]
pub struct Message {
    /// Comment at the start.
    pub comment: Comment,
    pub fields: Vec<Field>,
    pub constants: Vec<Constant>,
    /// Text of the definition.
    pub text: String,
}

/// Lines of a comment without `#`.
pub type Comment = Vec<String>;

/// A field.
#[derive(Debug)]
pub struct Field {
    pub name: String,
    pub kind: Kind,
    /// Default value as it is written.
    pub default: Option<String>,
    pub comment: Comment,
    /// Line in its file, from 1.
    pub line: usize,
}

/// A constant.
#[derive(Debug)]
pub struct Constant {
    pub name: String,
    pub element: Element,
    /// Value as it is written.
    pub value: String,
    pub comment: Comment,
    /// Line in its file, from 1.
    pub line: usize,
}

/// Type of a field.
#[derive(Clone, Debug, PartialEq)]
pub struct Kind {
    pub element: Element,
    pub array: Array,
}

/// Type of a value, or of the elements of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Element {
    /// Number or truth value, by its name in Rust.
    Primitive(&'static str),
    String,
    /// A message, with its package if the text names it.
    Message {
        package: Option<String>,
        name: String,
    },
}

/// Number of values of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Array {
    One,
    Fixed(usize),
    /// Any number, or any up to a bound.
    Sequence,
}

/// Kind of a declaration.
#[derive(Clone, Copy)]
enum Declared {
    Constant,
    Field,
}

/// Fault of a definition: line from 1, and reason.
pub type Fault = (usize, String);

/// Reads the text of a file with the ending `msg`, `srv` or `action`.
pub fn parse(text: &str, ending: &str) -> Result<Definition, Fault> {
    let lines: Vec<&str> = text.lines().collect();
    let (mut parts, mut first, mut next) = (Vec::new(), 1, 1);
    for lines in lines.split(|line| line.trim_end() == "---") {
        first = next;
        parts.push(Message::read(lines, first)?);
        next = first + lines.len() + 1;
    }
    let number = parts.len();
    let wrong = |expected| {
        let reason = format!("{number} parts divided by ---, expected {expected}");
        (first, reason)
    };
    match ending {
        "srv" => Ok(Definition::Service(parts.try_into().map_err(|_| wrong(2))?)),
        "action" => Ok(Definition::Action(parts.try_into().map_err(|_| wrong(3))?)),
        _ => {
            let [message] = <[Message; 1]>::try_from(parts).map_err(|_| wrong(1))?;
            Ok(Definition::Message(message))
        }
    }
}

impl Message {
    /// Reads the definition of a message alone.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        Self::read(&text.lines().collect::<Vec<_>>(), 1)
    }

    /// Reads lines, of which the first has the number `first` in its file.
    fn read(lines: &[&str], first: usize) -> Result<Self, Fault> {
        let mut message = Self {
            text: lines.iter().map(|line| format!("{line}\n")).collect(),
            ..Self::default()
        };
        let mut above = Comment::new();
        let (mut is_head, mut last) = (true, None);
        for (number, line) in (first..).zip(lines) {
            let (code, comment) = split_comment(line);
            let code = code.trim();
            match comment {
                _ if !code.is_empty() => {
                    if is_head {
                        message.comment = std::mem::take(&mut above);
                        is_head = false;
                    }
                    let mut text = std::mem::take(&mut above);
                    text.extend(comment.map(str::to_owned));
                    last = Some(message.declare(code, text, number)?);
                }
                // An indented comment continues that of the line above it.
                Some(comment) => {
                    let is_indented = line.starts_with(char::is_whitespace);
                    let of_last = last.filter(|_| is_indented);
                    let lines = of_last.and_then(|kind| message.last_comment(kind));
                    lines.unwrap_or(&mut above).push(comment.to_owned());
                }
                None => {
                    // An empty line ends the comment of the message, and parts other comments from a field.
                    if is_head && !above.is_empty() {
                        message.comment = std::mem::take(&mut above);
                        is_head = false;
                    }
                    above.clear();
                    last = None;
                }
            }
        }
        if is_head {
            message.comment = above;
        }
        Ok(message)
    }

    /// Comment of the last declaration of a kind.
    fn last_comment(&mut self, kind: Declared) -> Option<&mut Comment> {
        match kind {
            Declared::Constant => self.constants.last_mut().map(|last| &mut last.comment),
            Declared::Field => self.fields.last_mut().map(|last| &mut last.comment),
        }
    }

    /// Adds a field or a constant.
    fn declare(&mut self, code: &str, comment: Comment, line: usize) -> Result<Declared, Fault> {
        let fault = |reason: String| (line, reason);
        let (kind, rest) = code
            .split_once(char::is_whitespace)
            .ok_or_else(|| fault(format!("`{code}`: expected a type and a name")))?;
        let rest = rest.trim_start();
        let end = rest.find(|c: char| c == '=' || c.is_whitespace());
        let (name, value) = rest.split_at(end.unwrap_or(rest.len()));
        let value = value.trim();
        if !is_identifier(name) {
            return Err(fault(format!("`{name}` is no name of a field or constant")));
        }
        let names = self.fields.iter().map(|field| &field.name);
        if names
            .chain(self.constants.iter().map(|c| &c.name))
            .any(|n| n == name)
        {
            return Err(fault(format!("`{name}` stands twice")));
        }
        let (name, kind) = (name.to_owned(), Kind::parse(kind).map_err(fault)?);
        if let Some(value) = value.strip_prefix('=') {
            let value = value.trim().to_owned();
            let is_plain =
                kind.array == Array::One && !matches!(kind.element, Element::Message { .. });
            if !is_plain || value.is_empty() {
                return Err((
                    line,
                    format!("`{code}`: a constant is a number, truth value or string"),
                ));
            }
            let element = kind.element;
            self.constants.push(Constant {
                name,
                element,
                value,
                comment,
                line,
            });
            return Ok(Declared::Constant);
        }
        let default = (!value.is_empty()).then(|| value.to_owned());
        self.fields.push(Field {
            name,
            kind,
            default,
            comment,
            line,
        });
        Ok(Declared::Field)
    }
}

impl Kind {
    fn parse(text: &str) -> Result<Self, String> {
        let (element, array) = match text.split_once('[') {
            None => (text, Array::One),
            Some((element, array)) => {
                let length = array
                    .strip_suffix(']')
                    .ok_or_else(|| format!("`{text}`: no `]` at the end"))?;
                let number = length.strip_prefix("<=").unwrap_or(length);
                let array = match number.parse() {
                    _ if length.is_empty() => Array::Sequence,
                    Ok(n) if n > 0 && number == length => Array::Fixed(n),
                    Ok(n) if n > 0 => Array::Sequence,
                    _ => {
                        return Err(format!(
                            "`{text}`: length `{number}` is not an integer above 0"
                        ));
                    }
                };
                (element, array)
            }
        };
        let element = Element::parse(element)?;
        Ok(Self { element, array })
    }
}

impl Element {
    fn parse(text: &str) -> Result<Self, String> {
        let (name, bound) = match text.split_once("<=") {
            Some((name, bound)) => (name, Some(bound)),
            None => (text, None),
        };
        if let Some(bound) = bound {
            return match name {
                "string" if bound.parse::<usize>().is_ok() => Ok(Self::String),
                "string" => Err(format!(
                    "`{text}`: length `{bound}` is not an unsigned integer"
                )),
                _ => Err(format!("`{text}`: only strings have such a bound")),
            };
        }
        let primitive = match name {
            "bool" => "bool",
            "byte" | "char" | "uint8" => "u8",
            "int8" => "i8",
            "int16" => "i16",
            "uint16" => "u16",
            "int32" => "i32",
            "uint32" => "u32",
            "int64" => "i64",
            "uint64" => "u64",
            "float32" => "f32",
            "float64" => "f64",
            "string" => return Ok(Self::String),
            "wstring" => return Err("`wstring` is not supported: use `string`".to_owned()),
            _ => {
                let (package, name) = match name.split_once('/') {
                    Some((package, name)) => {
                        (Some(package), name.strip_prefix("msg/").unwrap_or(name))
                    }
                    None => (None, name),
                };
                let is_message =
                    name.starts_with(|c: char| c.is_ascii_uppercase()) && is_identifier(name);
                if !is_message || !package.is_none_or(is_identifier) {
                    return Err(format!("`{text}` is no type"));
                }
                let (package, name) = (package.map(str::to_owned), name.to_owned());
                return Ok(Self::Message { package, name });
            }
        };
        Ok(Self::Primitive(primitive))
    }
}

/// Code and comment of a line; a `#` between quotes begins none.
fn split_comment(line: &str) -> (&str, Option<&str>) {
    let mut quote = None;
    for (at, c) in line.char_indices() {
        match (quote, c) {
            (None, '#') => {
                let comment = &line[at + 1..];
                return (
                    &line[..at],
                    Some(comment.strip_prefix(' ').unwrap_or(comment).trim_end()),
                );
            }
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), _) if open == c => quote = None,
            _ => {}
        }
    }
    (line, None)
}

/// True for letters, digits and underscores that do not begin with a digit.
pub fn is_identifier(name: &str) -> bool {
    let is_inner = |c: char| c.is_ascii_alphanumeric() || c == '_';
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_inner)
}

#[cfg(test)]
mod tests;
