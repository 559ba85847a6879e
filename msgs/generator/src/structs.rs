//! Structs of messages.

use std::fmt::Write as _;

use crate::GenerateError;
use crate::definition::{Array, Constant, Element, Field, Message};
use crate::documentation::{add_doc, doc};
use crate::literal;
use crate::names::Names;
use crate::package::File;

/// Largest message that is `Copy`, bytes.
const LARGEST_COPY: usize = 128;

/// Most elements of an array that serde and `Default` take by themselves.
const SMALL_ARRAY: usize = 32;

/// Words that are no names of fields in Rust.
const KEYWORDS: &str = "abstract as async await become box break const continue crate do dyn else enum extern false final \
    fn for gen if impl in let loop macro match mod move mut override priv pub ref return self static struct super trait \
    true try type typeof union unsafe unsized use virtual where while yield";

/// A struct to write.
pub struct Struct<'a> {
    /// Name in Rust.
    pub name: String,
    /// Type name in ROS.
    pub type_name: String,
    /// Documentation.
    pub comment: Vec<String>,
    pub message: &'a Message,
}

/// Writer of structs.
#[derive(Clone, Copy)]
pub struct Structs<'a> {
    pub names: &'a Names<'a>,
}

impl Structs<'_> {
    /// Adds the struct of a message.
    pub fn add(
        &self,
        code: &mut String,
        part: &Struct,
        here: &str,
        file: &File,
    ) -> Result<(), GenerateError> {
        let fault = |line, reason| file.fault(line, reason);
        let (name, message) = (&part.name, part.message);
        let mut fields = String::new();
        let mut defaults = String::new();
        let mut has_default = false;
        let mut dependencies: Vec<String> = Vec::new();
        for field in &message.fields {
            let element = self.element(here, &field.kind.element);
            let element = element.map_err(|text| fault(field.line, text))?;
            let is_message = matches!(field.kind.element, Element::Message { .. });
            if is_message && !dependencies.contains(&element) {
                dependencies.push(element.clone());
            }
            let default = field.default.as_deref();
            let default = default.map(|value| literal::default(&field.kind, value));
            let default = default
                .transpose()
                .map_err(|text| fault(field.line, text))?
                .flatten();
            let is_large = matches!(field.kind.array, Array::Fixed(n) if n > SMALL_ARRAY);
            has_default |= default.is_some() || is_large;
            let default = default.unwrap_or_else(|| match is_large {
                true => "::std::array::from_fn(|_| ::std::default::Default::default())".to_owned(),
                false => "::std::default::Default::default()".to_owned(),
            });
            let _ = writeln!(
                defaults,
                "            {}: {default},",
                rust_name(&field.name)
            );
            self.add_field(&mut fields, field, element, is_large);
        }
        if message.fields.is_empty() {
            fields += "    /// Padding: a structure on the wire has at least one byte.\n    \
                       pub structure_needs_at_least_one_member: u8,\n";
        }
        add_doc(code, "", &part.comment);
        self.derives(code, here, message, has_default);
        let _ = writeln!(code, "pub struct {name} {{\n{fields}}}\n");
        if has_default {
            let _ = writeln!(
                code,
                "impl ::std::default::Default for {name} {{\n    fn default() -> Self {{\n        Self {{\n{defaults}        }}\n    }}\n}}\n"
            );
        }
        if !message.constants.is_empty() {
            let _ = writeln!(code, "impl {name} {{");
            for constant in &message.constants {
                add_constant(code, constant).map_err(|text| fault(constant.line, text))?;
            }
            code.push_str("}\n\n");
        }
        self.add_schema(code, part, &dependencies);
        Ok(())
    }

    fn derives(&self, code: &mut String, here: &str, message: &Message, has_default: bool) {
        // No message of ROS nests deeper.
        let size = self
            .names
            .size(here, message, 8)
            .filter(|size| size.bytes <= LARGEST_COPY);
        let copy = if size.is_some() { ", Copy" } else { "" };
        let exact = match size {
            Some(size) if size.is_exact => ", Eq, Hash, PartialOrd, Ord",
            _ => "",
        };
        let default = if has_default { "" } else { ", Default" };
        let serde = format!("{}::generated::serde", self.names.root);
        let _ = write!(
            code,
            "#[derive(Clone{copy}, Debug{default}, PartialEq{exact}, {serde}::Serialize, {serde}::Deserialize)]\n\
             #[serde(crate = \"{serde}\")]\n"
        );
    }

    /// Type of a value or of the elements of an array.
    fn element(&self, here: &str, element: &Element) -> Result<String, String> {
        match element {
            Element::Primitive(name) => Ok((*name).to_owned()),
            Element::String => Ok("::std::string::String".to_owned()),
            Element::Message { package, name } => self.names.path(here, package.as_deref(), name),
        }
    }

    fn add_field(&self, code: &mut String, field: &Field, one: String, is_large: bool) {
        let kind = match field.kind.array {
            Array::One => one,
            Array::Fixed(length) => format!("[{one}; {length}]"),
            Array::Sequence if one == "u8" => format!("{}::generated::ByteBuf", self.names.root),
            Array::Sequence => format!("::std::vec::Vec<{one}>"),
        };
        let comment =
            doc(&field.comment).unwrap_or_else(|| vec![format!("Field `{}`.", field.name)]);
        add_doc(code, "    ", &comment);
        let name = rust_name(&field.name);
        if name != field.name {
            let _ = writeln!(code, "    #[serde(rename = \"{}\")]", field.name);
        }
        if is_large {
            let _ = writeln!(
                code,
                "    #[serde(with = \"{}::generated::BigArray\")]",
                self.names.root
            );
        }
        let _ = writeln!(code, "    pub {name}: {kind},");
    }

    fn add_schema(&self, code: &mut String, part: &Struct, dependencies: &[String]) {
        let (root, name) = (self.names.root, &part.name);
        let (type_name, text) = (&part.type_name, &part.message.text);
        let dependencies = dependencies.iter();
        let schemas = dependencies.map(|path| format!("<{path} as {root}::RosMessage>::SCHEMA"));
        let schemas = schemas.collect::<Vec<_>>().join(", ");
        let _ = writeln!(
            code,
            "impl {root}::RosMessage for {name} {{\n    const SCHEMA: &'static {root}::Schema = &{root}::Schema {{\n        \
             type_name: \"{type_name}\",\n        text: {text:?},\n        dependencies: &[{schemas}],\n    }};\n}}\n"
        );
    }
}

fn add_constant(code: &mut String, constant: &Constant) -> Result<(), String> {
    let value = literal::constant(&constant.element, &constant.value)?;
    let kind = match constant.element {
        Element::Primitive(kind) => kind,
        _ => "&'static str",
    };
    let comment = doc(&constant.comment).unwrap_or_else(|| vec![format!("`{value}`.")]);
    add_doc(code, "    ", &comment);
    let _ = writeln!(code, "    pub const {}: {kind} = {value};", constant.name);
    Ok(())
}

/// Name of a field.
fn rust_name(name: &str) -> String {
    match KEYWORDS.split_whitespace().any(|word| word == name) {
        true => format!("{name}_"),
        false => name.to_owned(),
    }
}
