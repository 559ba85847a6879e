//! Packages of a generator: paths and sizes of their messages.

use std::collections::BTreeMap;

use crate::definition::{Array, Definition, Element, Message};
use crate::package::Package;

/// Messages by package and name.
pub struct Names<'a> {
    packages: BTreeMap<&'a str, BTreeMap<&'a str, &'a Message>>,
    /// Rust path of the crate with the message structs: `::lattice_msgs`, or `crate` inside of it.
    pub root: &'static str,
}

/// Bytes of a message of fixed size, and true if it has no floating-point numbers.
#[derive(Clone, Copy)]
pub struct Size {
    pub bytes: usize,
    pub is_exact: bool,
}

impl<'a> Names<'a> {
    pub fn new(packages: &'a [Package], root: &'static str) -> Self {
        let messages = |package: &'a Package| {
            let files = package.files.iter();
            let messages = files.filter_map(|file| match &file.definition {
                Definition::Message(message) => Some((file.name.as_str(), message)),
                _ => None,
            });
            (package.name.as_str(), messages.collect())
        };
        Self {
            packages: packages.iter().map(messages).collect(),
            root,
        }
    }

    /// Path of a message that a definition of the package `here` names; the reason if the generator has the package,
    /// but not the message.
    pub fn path(&self, here: &str, package: Option<&str>, name: &str) -> Result<String, String> {
        let package = match package {
            // As many packages write it.
            None if name == "Header" && !self.has(here, name) => "std_msgs",
            None => here,
            Some(package) => package,
        };
        // Only parts of actions have a `_` in their names; they are structs, not messages of a package.
        let is_known = self.has(package, name) || name.contains('_');
        let name = name.replace('_', "");
        match self.packages.contains_key(package) {
            true if !is_known => Err(format!("`{name}` is no message of package {package}")),
            true if package == here => Ok(format!("self::{name}")),
            true => Ok(format!("super::{}::{name}", module(package))),
            false => Ok(format!("{}::{}::{name}", self.root, module(package))),
        }
    }

    fn has(&self, package: &str, name: &str) -> bool {
        let messages = self.packages.get(package);
        messages.is_some_and(|messages| messages.contains_key(name))
    }

    /// Size of a message; `None` if it varies, is unknown, or contains itself.
    pub fn size(&self, here: &str, message: &Message, depth: usize) -> Option<Size> {
        let mut whole = Size {
            bytes: 0,
            is_exact: true,
        };
        for field in &message.fields {
            let one = match &field.kind.element {
                Element::String => return None,
                Element::Primitive(name) => Size {
                    bytes: match *name {
                        "bool" | "u8" | "i8" => 1,
                        "u16" | "i16" => 2,
                        "u32" | "i32" | "f32" => 4,
                        _ => 8,
                    },
                    is_exact: !name.starts_with('f'),
                },
                Element::Message { package, name } if depth > 0 => {
                    let package = package.as_deref().unwrap_or(here);
                    let inner = self.packages.get(package)?.get(name.as_str())?;
                    self.size(package, inner, depth - 1)?
                }
                Element::Message { .. } => return None,
            };
            let count = match field.kind.array {
                Array::One => 1,
                Array::Fixed(count) => count,
                Array::Sequence => return None,
            };
            whole.bytes = whole.bytes.saturating_add(one.bytes.saturating_mul(count));
            whole.is_exact &= one.is_exact;
        }
        Some(whole)
    }
}

/// Module of a package, as `lattice_msgs` names its own.
pub fn module(package: &str) -> &str {
    match package {
        "lattice_msgs" => "lattice",
        _ => package,
    }
}
