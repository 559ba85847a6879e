//! Parameter values and their YAML syntax.

mod scan;

pub use scan::ScanError;
pub(crate) use scan::scan;

use serde_yaml::Value;
use std::fmt;
use thiserror::Error;

/// Value of a parameter, of one of the ROS types.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamValue {
    /// `true`
    Bool(bool),
    /// `1`
    I64(i64),
    /// `1.0`
    F64(f64),
    /// `text`
    String(String),
    /// `[true, false]`
    BoolArray(Vec<bool>),
    /// `[1, 2]`
    I64Array(Vec<i64>),
    /// `[1.0, 2.0]`
    F64Array(Vec<f64>),
    /// `[a, b]`, and `[]`, which is an empty array of any type.
    StringArray(Vec<String>),
}

/// Reason why a YAML value is not a parameter value.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ValueError {
    /// Empty value, or `null`.
    #[error("the value is missing; write '' for an empty text")]
    Missing,
    /// A map, a list of lists, or a tag.
    #[error("found {0}, expected a bool, an integer, a float, a text or a list of one of them")]
    Shape(&'static str),
    /// A list of several types.
    #[error("found a list with {0} and {1}, expected one type (write 1.0 for 1 among floats)")]
    Mixed(&'static str, &'static str),
    /// Anchors, aliases, or excessive nesting.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// Invalid YAML.
    #[error("invalid YAML: {0}")]
    Yaml(String),
}

impl ParamValue {
    /// Parses the value of `-p name:=value`.
    pub fn from_yaml_text(text: &str) -> Result<ParamValue, ValueError> {
        scan(text)?;
        let value = serde_yaml::from_str(text).map_err(|e| ValueError::Yaml(e.to_string()))?;
        match (value, text.trim()) {
            // rcl reads these as texts, and an empty value as missing.
            (Value::Null, text @ ("~" | "null" | "Null" | "NULL")) => {
                Ok(ParamValue::String(text.to_owned()))
            }
            (value, _) => Self::from_yaml(value),
        }
    }

    /// Converts a YAML value.
    pub(crate) fn from_yaml(value: Value) -> Result<ParamValue, ValueError> {
        match value {
            Value::Null => Err(ValueError::Missing),
            Value::Bool(value) => Ok(ParamValue::Bool(value)),
            Value::Number(number) => match (number.as_i64(), number.as_f64()) {
                (Some(value), _) => Ok(ParamValue::I64(value)),
                // rcl, too, reads integers beyond i64 as doubles.
                (None, Some(value)) => Ok(ParamValue::F64(value)),
                (None, None) => Err(ValueError::Shape("a number out of range")),
            },
            Value::String(text) => Ok(ParamValue::String(text)),
            Value::Sequence(items) => Self::array(items),
            Value::Mapping(_) => Err(ValueError::Shape("a map")),
            Value::Tagged(_) => Err(ValueError::Shape("a tagged value")),
        }
    }

    fn array(items: Vec<Value>) -> Result<ParamValue, ValueError> {
        let mut values = Vec::with_capacity(items.len());
        for item in items {
            let value = Self::from_yaml(item)?;
            if value.is_array() {
                return Err(ValueError::Shape("a list in a list"));
            }
            values.push(value);
        }
        // A list of `true` and `yes`, or of `8` and `010`, has one type in rcl and two in YAML 1.2.
        let is_text = |value: &&ParamValue| value.as_str().is_some();
        let typed = values.iter().find(|value| !is_text(value));
        let lead = typed.or(values.first());
        let float = |v: &ParamValue| match v {
            ParamValue::I64(_) => None,
            v => v.as_f64(),
        };
        let text = |v: &ParamValue| v.as_str().map(str::to_owned);
        let all = match lead {
            None | Some(ParamValue::String(_)) => each(&values, text).map(Self::StringArray),
            Some(ParamValue::Bool(_)) => each(&values, Self::as_bool).map(Self::BoolArray),
            Some(ParamValue::I64(_)) => each(&values, Self::as_i64).map(Self::I64Array),
            Some(_) => each(&values, float).map(Self::F64Array),
        };
        all.ok_or_else(|| {
            let first = lead.map_or("nothing", Self::type_name);
            let mut others = values.iter().map(Self::type_name);
            let other = others.find(|name| *name != first);
            ValueError::Mixed(first, other.unwrap_or("something else"))
        })
    }

    /// Name of the type for messages.
    pub fn type_name(&self) -> &'static str {
        match self {
            ParamValue::Bool(_) => "a bool",
            ParamValue::I64(_) => "an integer",
            ParamValue::F64(_) => "a float",
            ParamValue::String(_) => "a text",
            ParamValue::BoolArray(_) => "a list of bools",
            ParamValue::I64Array(_) => "a list of integers",
            ParamValue::F64Array(_) => "a list of floats",
            ParamValue::StringArray(items) if items.is_empty() => "an empty list",
            ParamValue::StringArray(_) => "a list of texts",
        }
    }

    /// Code of the type in `rcl_interfaces/msg/ParameterType`.
    pub fn type_code(&self) -> u8 {
        match self {
            ParamValue::Bool(_) => 1,
            ParamValue::I64(_) => 2,
            ParamValue::F64(_) => 3,
            ParamValue::String(_) => 4,
            ParamValue::BoolArray(_) => 6,
            ParamValue::I64Array(_) => 7,
            ParamValue::F64Array(_) => 8,
            ParamValue::StringArray(_) => 9,
        }
    }

    /// Name of the type in messages of rclcpp.
    pub fn ros_type_name(&self) -> &'static str {
        match self {
            ParamValue::Bool(_) => "bool",
            ParamValue::I64(_) => "integer",
            ParamValue::F64(_) => "double",
            ParamValue::String(_) => "string",
            ParamValue::BoolArray(_) => "bool_array",
            ParamValue::I64Array(_) => "integer_array",
            ParamValue::F64Array(_) => "double_array",
            ParamValue::StringArray(_) => "string_array",
        }
    }

    pub(crate) fn is_array(&self) -> bool {
        self.type_code() > 5
    }

    /// Length: bytes of a text or of all texts of a list, else items of a list.
    pub(crate) fn length(&self) -> usize {
        match self {
            ParamValue::String(text) => text.len(),
            ParamValue::BoolArray(items) => items.len(),
            ParamValue::I64Array(items) => items.len(),
            ParamValue::F64Array(items) => items.len(),
            ParamValue::StringArray(items) => items.iter().map(|text| 1 + text.len()).sum(),
            _ => 1,
        }
    }

    pub(crate) fn is_empty_list(&self) -> bool {
        self.is_array() && self.length() == 0
    }

    /// Empty list of the same type; other values unchanged.
    pub(crate) fn emptied(&self) -> ParamValue {
        match self {
            ParamValue::BoolArray(_) => ParamValue::BoolArray(Vec::new()),
            ParamValue::I64Array(_) => ParamValue::I64Array(Vec::new()),
            ParamValue::F64Array(_) => ParamValue::F64Array(Vec::new()),
            ParamValue::StringArray(_) => ParamValue::StringArray(Vec::new()),
            other => other.clone(),
        }
    }

    /// Value as a bool by the rules of rcl.
    pub(crate) fn as_bool(&self) -> Option<bool> {
        match self {
            ParamValue::Bool(value) => Some(*value),
            ParamValue::String(text) => match text.as_str() {
                "y" | "Y" | "yes" | "Yes" | "YES" | "on" | "On" | "ON" => Some(true),
                "n" | "N" | "no" | "No" | "NO" | "off" | "Off" | "OFF" => Some(false),
                _ => None,
            },
            _ => None,
        }
    }

    /// Value as an integer by the rules of rcl.
    pub(crate) fn as_i64(&self) -> Option<i64> {
        match self {
            ParamValue::I64(value) => Some(*value),
            ParamValue::String(text) if may_be_plain(text) => c_integer(text),
            _ => None,
        }
    }

    /// Value as a float; integers are converted.
    pub(crate) fn as_f64(&self) -> Option<f64> {
        match self {
            ParamValue::F64(value) => Some(*value),
            ParamValue::I64(value) => Some(*value as f64),
            ParamValue::String(text) if may_be_plain(text) => {
                c_integer(text).map_or_else(|| c_float(text), |value| Some(value as f64))
            }
            _ => None,
        }
    }

    /// Value as a text.
    pub(crate) fn as_str(&self) -> Option<&str> {
        match self {
            ParamValue::String(text) => Some(text),
            _ => None,
        }
    }

    /// Items of a list as values.
    pub(crate) fn items(&self) -> Option<Vec<ParamValue>> {
        fn each<T: Clone>(items: &[T], wrap: fn(T) -> ParamValue) -> Option<Vec<ParamValue>> {
            Some(items.iter().cloned().map(wrap).collect())
        }
        match self {
            ParamValue::BoolArray(items) => each(items, Self::Bool),
            ParamValue::I64Array(items) => each(items, Self::I64),
            ParamValue::F64Array(items) => each(items, Self::F64),
            ParamValue::StringArray(items) => each(items, Self::String),
            _ => None,
        }
    }
}

/// Converts all values; `None` if one fails.
fn each<T>(values: &[ParamValue], read: impl Fn(&ParamValue) -> Option<T>) -> Option<Vec<T>> {
    values.iter().map(read).collect()
}

/// True if the text may have been unquoted: YAML would not parse it as another type.
fn may_be_plain(text: &str) -> bool {
    matches!(serde_yaml::from_str(text), Ok(Value::String(plain)) if plain == text)
}

/// Integer by strtol with base 0: decimal, `0x` hexadecimal, `0` octal.
fn c_integer(text: &str) -> Option<i64> {
    let negative = text.starts_with('-');
    let digits = text.strip_prefix(['-', '+']).unwrap_or(text);
    let hexadecimal = digits.strip_prefix("0x").or(digits.strip_prefix("0X"));
    let (digits, radix) = match (hexadecimal, digits.strip_prefix('0')) {
        (Some(digits), _) => (digits, 16),
        (None, Some(octal)) if !octal.is_empty() => (octal, 8),
        _ => (digits, 10),
    };
    if !digits.bytes().next()?.is_ascii_hexdigit() {
        return None;
    }
    let magnitude = i128::from(u64::from_str_radix(digits, radix).ok()?);
    i64::try_from(if negative { -magnitude } else { magnitude }).ok()
}

/// Decimal float that YAML 1.2 parses as a text, for example `08.5`.
fn c_float(text: &str) -> Option<f64> {
    let is_decimal = |byte: u8| byte.is_ascii_digit() || b"+-.eE".contains(&byte);
    let value: f64 = text.parse().ok()?;
    (text.bytes().all(is_decimal) && value.is_finite()).then_some(value)
}

impl fmt::Display for ParamValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ParamValue::Bool(value) => write!(f, "{value}"),
            ParamValue::I64(value) => write!(f, "{value}"),
            ParamValue::F64(value) => write!(f, "{value:?}"),
            ParamValue::String(value) => write!(f, "{value:?}"),
            ParamValue::BoolArray(items) => write!(f, "{items:?}"),
            ParamValue::I64Array(items) => write!(f, "{items:?}"),
            ParamValue::F64Array(items) => write!(f, "{items:?}"),
            ParamValue::StringArray(items) => write!(f, "{items:?}"),
        }
    }
}

#[cfg(test)]
mod tests;
