//! Values of constants and defaults as Rust writes them.

use crate::definition::{Array, Element, Kind};

/// Value of a constant.
pub fn constant(element: &Element, value: &str) -> Result<String, String> {
    match element {
        Element::Primitive(kind) => number(kind, value),
        Element::String => Ok(format!("{:?}", unquoted(value))),
        Element::Message { .. } => Err("a constant is a number, truth value or string".to_owned()),
    }
}

/// Default of a field as an expression; `None` if it is that of Rust, zero or empty.
pub fn default(kind: &Kind, value: &str) -> Result<Option<String>, String> {
    let element = |value: &str| match &kind.element {
        Element::Primitive(kind) => number(kind, value),
        Element::String => Ok(format!(
            "::std::string::String::from({:?})",
            unquoted(value)
        )),
        Element::Message { .. } => Err(format!("`{value}`: messages have no default here")),
    };
    let Some(list) = value.strip_prefix('[') else {
        let is_zero = match &kind.element {
            _ if kind.array != Array::One => return Err(format!("`{value}`: expected a list")),
            Element::String => unquoted(value).is_empty(),
            _ => matches!(element(value)?.as_str(), "0" | "0.0" | "-0.0" | "false"),
        };
        return if is_zero {
            Ok(None)
        } else {
            element(value).map(Some)
        };
    };
    let list = list
        .strip_suffix(']')
        .ok_or_else(|| format!("`{value}`: no `]` at the end"))?;
    let values = list
        .split(',')
        .map(str::trim)
        .filter(|value| !value.is_empty());
    let values = values.map(element).collect::<Result<Vec<_>, _>>()?;
    let list = values.join(", ");
    match kind.array {
        Array::One => Err(format!("`{value}`: expected one value, no list")),
        Array::Fixed(length) if length == values.len() => Ok(Some(format!("[{list}]"))),
        Array::Fixed(length) => Err(format!("{} values, expected {length}", values.len())),
        Array::Sequence if values.is_empty() => Ok(None),
        Array::Sequence => Ok(Some(format!("::std::vec![{list}].into()"))),
    }
}

/// A number or truth value of a type of Rust.
fn number(kind: &str, value: &str) -> Result<String, String> {
    let wrong = || format!("`{value}` is no value of type {kind}");
    match kind {
        "bool" => match value {
            "true" | "True" | "1" => Ok("true".to_owned()),
            "false" | "False" | "0" => Ok("false".to_owned()),
            _ => Err(wrong()),
        },
        "f32" | "f64" => {
            let number: f64 = value.parse().map_err(|_| wrong())?;
            let is_in_range = number.is_finite() && (kind == "f64" || (number as f32).is_finite());
            is_in_range.then(|| format!("{number:?}")).ok_or_else(wrong)
        }
        _ => {
            let digits = value.trim_start_matches(['-', '+']);
            let number = match digits.strip_prefix("0x").or(digits.strip_prefix("0X")) {
                Some(digits) => i128::from_str_radix(digits, 16),
                None => digits.parse(),
            };
            let number = number.map_err(|_| wrong())?;
            let number = if value.starts_with('-') {
                -number
            } else {
                number
            };
            range(kind)
                .contains(&number)
                .then(|| number.to_string())
                .ok_or_else(wrong)
        }
    }
}

/// Values of an integer type.
fn range(kind: &str) -> std::ops::RangeInclusive<i128> {
    let (sign, bits) = kind.split_at(kind.len().min(1));
    let bits: u32 = bits.parse().unwrap_or(0);
    match sign {
        "i" => -(1 << (bits - 1))..=(1 << (bits - 1)) - 1,
        _ => 0..=(1 << bits) - 1,
    }
}

/// A string without its quotes, if it has any.
fn unquoted(value: &str) -> &str {
    let inner = |quote| value.strip_prefix(quote)?.strip_suffix(quote);
    inner('"').or(inner('\'')).unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(element: Element, array: Array) -> Kind {
        Kind { element, array }
    }

    #[test]
    fn numbers_are_within_their_types() {
        for (name, value, expected) in [
            ("u8", "255", Some("255")),
            ("u8", "256", None),
            ("u8", "-1", None),
            ("i8", "-128", Some("-128")),
            ("i8", "128", None),
            ("u64", "0xFFFFFFFFFFFFFFFF", Some("18446744073709551615")),
            ("i64", "-0x10", Some("-16")),
            ("f32", "1", Some("1.0")),
            ("f32", "1e39", None),
            ("f64", "nan", None),
            ("bool", "True", Some("true")),
            ("bool", "2", None),
            ("i32", "one", None),
        ] {
            let element = Element::Primitive(name);
            let found = constant(&element, value).ok();
            assert_eq!(found.as_deref(), expected, "{name} {value}");
        }
    }

    #[test]
    fn defaults_are_expressions() {
        let number = |array| kind(Element::Primitive("i32"), array);
        let default = |kind: &Kind, value: &str| super::default(kind, value);
        assert_eq!(default(&number(Array::One), "0").unwrap(), None);
        assert_eq!(
            default(&number(Array::One), "-2").unwrap().as_deref(),
            Some("-2")
        );
        let array = number(Array::Fixed(2));
        assert_eq!(
            default(&array, "[1, 2]").unwrap().as_deref(),
            Some("[1, 2]")
        );
        assert!(default(&array, "[1]").is_err());
        assert!(default(&number(Array::Sequence), "1").is_err());
        let list = default(&number(Array::Sequence), "[7]").unwrap();
        assert_eq!(list.as_deref(), Some("::std::vec![7].into()"));
        let text = kind(Element::String, Array::One);
        let found = default(&text, "'a\"b'").unwrap();
        assert_eq!(
            found.as_deref(),
            Some(r#"::std::string::String::from("a\"b")"#)
        );
    }
}
