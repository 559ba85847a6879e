//! Fields of a message as serde sees them, and values that fill every field.

use serde::de::value::Error;
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, Error as _, SeqAccess, Visitor};
use serde::forward_to_deserialize_any;

/// Names and types of fields in order, as ROS writes them: `uint8`, `string`, `Point[]`, `float64[36]`.
pub type Fields = Vec<(&'static str, String)>;

/// A value with every field set and `length` elements in every sequence, and the name and fields of
/// its struct. With no elements the type of sequences is unknown and shows as `?[]`.
pub fn filled<T: DeserializeOwned>(length: usize) -> (T, &'static str, Fields) {
    let mut filler = Filler {
        length,
        count: 0,
        last: String::new(),
        message: ("", Vec::new()),
    };
    let value = T::deserialize(&mut filler)
        .unwrap_or_else(|error| panic!("{error}: messages hold only what the filler knows"));
    let (name, fields) = filler.message;
    (value, name, fields)
}

/// Gives each field the next value of a count, and notes what was asked for.
struct Filler {
    length: usize,
    count: u8,
    /// Type of the value read last.
    last: String,
    /// Name and fields of the struct read last.
    message: (&'static str, Fields),
}

impl Filler {
    fn next(&mut self) -> u8 {
        self.count = self.count % 100 + 1;
        self.count
    }

    /// Visits so many values; also their types.
    fn visit<'de, V: Visitor<'de>>(
        &mut self,
        count: usize,
        visitor: V,
    ) -> Result<(V::Value, Vec<String>), Error> {
        let mut values = Values {
            left: count,
            types: Vec::new(),
            filler: self,
        };
        let value = visitor.visit_seq(&mut values)?;
        Ok((value, values.types))
    }
}

macro_rules! numbers {
    ($($method:ident $visit:ident $name:literal $value:expr;)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
            let count = self.next();
            self.last = $name.to_owned();
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
        self.last = "uint8[]".to_owned();
        visitor.visit_byte_buf((first..).take(self.length).collect())
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let (value, types) = self.visit(self.length, visitor)?;
        self.last = format!("{}[]", types.last().map_or("?", String::as_str));
        Ok(value)
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        let (value, _) = self.visit(length, visitor)?;
        self.last += &format!("[{length}]");
        Ok(value)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let (value, types) = self.visit(names.len(), visitor)?;
        self.last = name.to_owned();
        self.message = (name, names.iter().copied().zip(types).collect());
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

struct Values<'a> {
    left: usize,
    types: Vec<String>,
    filler: &'a mut Filler,
}

impl<'de> SeqAccess<'de> for Values<'_> {
    type Error = Error;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Error> {
        let Some(left) = self.left.checked_sub(1) else {
            return Ok(None);
        };
        self.left = left;
        let value = seed.deserialize(&mut *self.filler)?;
        self.types.push(self.filler.last.clone());
        Ok(Some(value))
    }
}
