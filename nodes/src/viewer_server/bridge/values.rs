//! Conversion of parameter values between JSON and `rcl_interfaces`.

use lattice_msgs::rcl_interfaces::{ParameterType as Type, ParameterValue};
use serde_json::{Value as Json, json};

/// JSON value, with its type where JSON is ambiguous; `None`: not set, or bytes.
pub(super) fn to_json(value: ParameterValue) -> Option<(Json, Option<String>)> {
    let (json, kind) = match value.type_ {
        Type::PARAMETER_BOOL => (json!(value.bool_value), None),
        Type::PARAMETER_INTEGER => (json!(value.integer_value), None),
        Type::PARAMETER_DOUBLE => (json!(value.double_value), Some("float64")),
        Type::PARAMETER_STRING => (json!(value.string_value), None),
        Type::PARAMETER_BOOL_ARRAY => (json!(value.bool_array_value), None),
        Type::PARAMETER_INTEGER_ARRAY => (json!(value.integer_array_value), None),
        Type::PARAMETER_DOUBLE_ARRAY => (json!(value.double_array_value), Some("float64_array")),
        Type::PARAMETER_STRING_ARRAY => (json!(value.string_array_value), None),
        _ => return None,
    };
    Some((json, kind.map(str::to_owned)))
}

/// Value of the parameter's type; `None` if the JSON does not match.
pub(super) fn from_json(json: Json, type_: u8) -> Option<ParameterValue> {
    let mut value = ParameterValue {
        type_,
        ..ParameterValue::default()
    };
    match type_ {
        Type::PARAMETER_BOOL => value.bool_value = json.as_bool()?,
        Type::PARAMETER_INTEGER => value.integer_value = json.as_i64()?,
        Type::PARAMETER_DOUBLE => value.double_value = json.as_f64()?,
        Type::PARAMETER_STRING => value.string_value = json.as_str()?.to_owned(),
        Type::PARAMETER_BOOL_ARRAY => value.bool_array_value = list(json)?,
        Type::PARAMETER_INTEGER_ARRAY => value.integer_array_value = list(json)?,
        Type::PARAMETER_DOUBLE_ARRAY => value.double_array_value = list(json)?,
        Type::PARAMETER_STRING_ARRAY => value.string_array_value = list(json)?,
        _ => return None,
    }
    Some(value)
}

fn list<T: serde::de::DeserializeOwned>(json: Json) -> Option<Vec<T>> {
    serde_json::from_value(json).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_pass_both_ways_and_only_as_their_type() {
        for (type_, json) in [
            (1, json!(true)),
            (2, json!(-3)),
            (3, json!(0.5)),
            (4, json!("a")),
            (6, json!([true])),
            (7, json!([1, 2])),
            (8, json!([0.5])),
            (9, json!(["b"])),
        ] {
            let value = from_json(json.clone(), type_).unwrap();
            assert_eq!(to_json(value).unwrap().0, json);
            assert!(from_json(json!({"a": 1}), type_).is_none());
        }
        assert_eq!(from_json(json!(3), 3).unwrap().double_value, 3.0);
        assert!(from_json(json!(1.5), 2).is_none());
        assert!(from_json(json!(1), 5).is_none() && from_json(json!(1), 200).is_none());
    }
}
