//! Shape of a message as serde sees it, and values that fill every field.

use std::fmt;

use serde::de::value::Error;
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, Error as _, SeqAccess, Visitor};
use serde::forward_to_deserialize_any;

/// Type of a field, as ROS writes it: `uint8`, `string`, `Point[]`, `float64[36]`.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A number, a truth value or a text.
    Primitive(&'static str),
    /// A block of bytes.
    Bytes,
    /// Any number of elements.
    Sequence(Box<Shape>),
    /// A fixed number of elements.
    Array(usize, Box<Shape>),
    /// A message: its name and fields in order.
    Message(&'static str, Vec<(&'static str, Shape)>),
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Primitive(name) | Self::Message(name, _) => f.write_str(name),
            Self::Bytes => f.write_str("uint8[]"),
            Self::Sequence(element) => write!(f, "{element}[]"),
            Self::Array(length, element) => write!(f, "{element}[{length}]"),
        }
    }
}

/// A value with every field set and `length` elements in every sequence, and its shape.
/// With no elements the shape of sequences is unknown and shows as `?[]`.
pub fn filled<T: DeserializeOwned>(length: usize) -> (T, Shape) {
    let mut filler = Filler {
        length,
        count: 0,
        shape: Shape::Primitive("?"),
    };
    let value = T::deserialize(&mut filler)
        .unwrap_or_else(|error| panic!("{error}: messages hold only what the filler knows"));
    (value, filler.shape)
}

/// Gives each field the next value of a count, and notes what was asked for.
struct Filler {
    length: usize,
    count: u8,
    /// Shape of the value read last.
    shape: Shape,
}

impl Filler {
    fn next(&mut self) -> u8 {
        self.count = self.count % 100 + 1;
        self.count
    }
}

macro_rules! numbers {
    ($($method:ident $visit:ident $name:literal $value:expr;)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
            let count = self.next();
            self.shape = Shape::Primitive($name);
            visitor.$visit($value(count))
        })*
    };
}

impl<'de> Deserializer<'de> for &mut Filler {
    type Error = Error;

    numbers! {
        deserialize_bool visit_bool "bool" |n| n % 2 == 1;
        deserialize_i8 visit_i8 "int8" |n| -(n as i8);
        deserialize_i16 visit_i16 "int16" |n| -300 * i16::from(n);
        deserialize_i32 visit_i32 "int32" |n| -70_000 * i32::from(n);
        deserialize_i64 visit_i64 "int64" |n| -5_000_000_000 * i64::from(n);
        deserialize_u8 visit_u8 "uint8" |n| n + 100;
        deserialize_u16 visit_u16 "uint16" |n| 500 * u16::from(n);
        deserialize_u32 visit_u32 "uint32" |n| 40_000_000 * u32::from(n);
        deserialize_u64 visit_u64 "uint64" |n| 1 << 63 | u64::from(n);
        deserialize_f32 visit_f32 "float32" |n| f32::from(n) + 0.25;
        deserialize_f64 visit_f64 "float64" |n| f64::from(n) - 0.125;
        deserialize_string visit_string "string" |n| format!("\u{fc} {n}");
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let first = self.next();
        self.shape = Shape::Bytes;
        visitor.visit_byte_buf((first..).take(self.length).collect())
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.shape = Shape::Primitive("?");
        let value = visitor.visit_seq(Elements {
            left: self.length,
            filler: self,
        })?;
        self.shape = Shape::Sequence(Box::new(self.shape.clone()));
        Ok(value)
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        let value = visitor.visit_seq(Elements {
            left: length,
            filler: self,
        })?;
        self.shape = Shape::Array(length, Box::new(self.shape.clone()));
        Ok(value)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let mut fields = Vec::new();
        let value = visitor.visit_seq(Fields {
            names,
            fields: &mut fields,
            filler: self,
        })?;
        self.shape = Shape::Message(name, fields);
        Ok(value)
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(Error::custom("not a type of ROS"))
    }

    forward_to_deserialize_any! {
        i128 u128 char str bytes option unit unit_struct newtype_struct tuple_struct map enum
        identifier ignored_any
    }
}

struct Elements<'a> {
    left: usize,
    filler: &'a mut Filler,
}

impl<'de> SeqAccess<'de> for Elements<'_> {
    type Error = Error;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Error> {
        let Some(left) = self.left.checked_sub(1) else {
            return Ok(None);
        };
        self.left = left;
        seed.deserialize(&mut *self.filler).map(Some)
    }
}

struct Fields<'a> {
    names: &'static [&'static str],
    fields: &'a mut Vec<(&'static str, Shape)>,
    filler: &'a mut Filler,
}

impl<'de> SeqAccess<'de> for Fields<'_> {
    type Error = Error;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Error> {
        let Some((name, rest)) = self.names.split_first() else {
            return Ok(None);
        };
        self.names = rest;
        let value = seed.deserialize(&mut *self.filler)?;
        self.fields.push((name, self.filler.shape.clone()));
        Ok(Some(value))
    }
}
