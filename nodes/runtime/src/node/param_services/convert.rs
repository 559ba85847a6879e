//! Conversion of parameters from and to messages.

use lattice_msgs::rcl_interfaces::{
    FloatingPointRange, IntegerRange, Parameter, ParameterDescriptor, ParameterValue,
};

use crate::config::params::{Declared, ParamValue, Range};

/// Parameter list of an event.
pub(super) fn messages(values: impl IntoIterator<Item = (String, ParamValue)>) -> Vec<Parameter> {
    let values = values.into_iter();
    let message = |(name, value)| Parameter {
        name,
        value: value_message(&value),
    };
    values.map(message).collect()
}

pub(super) fn value_message(value: &ParamValue) -> ParameterValue {
    let mut message = ParameterValue {
        type_: value.type_code(),
        ..ParameterValue::default()
    };
    match value.clone() {
        ParamValue::Bool(value) => message.bool_value = value,
        ParamValue::I64(value) => message.integer_value = value,
        ParamValue::F64(value) => message.double_value = value,
        ParamValue::String(value) => message.string_value = value,
        ParamValue::BoolArray(value) => message.bool_array_value = value,
        ParamValue::I64Array(value) => message.integer_array_value = value,
        ParamValue::F64Array(value) => message.double_array_value = value,
        ParamValue::StringArray(value) => message.string_array_value = value,
    }
    message
}

/// Value of a message; `None`: the parameter is to be removed. The error is an unknown parameter type.
pub(super) fn value_from(message: ParameterValue) -> Result<Option<ParamValue>, String> {
    Ok(Some(match message.type_ {
        0 => return Ok(None),
        1 => ParamValue::Bool(message.bool_value),
        2 => ParamValue::I64(message.integer_value),
        3 => ParamValue::F64(message.double_value),
        4 => ParamValue::String(message.string_value),
        6 => ParamValue::BoolArray(message.bool_array_value),
        7 => ParamValue::I64Array(message.integer_array_value),
        8 => ParamValue::F64Array(message.double_array_value),
        9 => ParamValue::StringArray(message.string_array_value),
        other => return Err(format!("parameter type {other} is outside 0..=9")),
    }))
}

/// Descriptor of a parameter: everything but its value.
pub(super) fn descriptor(name: &str, declared: &Declared) -> ParameterDescriptor {
    let mut message = ParameterDescriptor {
        name: name.to_owned(),
        type_: declared.value.type_code(),
        description: declared.text().to_owned(),
        additional_constraints: match declared.allowed.as_str() {
            "" => String::new(),
            words => format!("one of: {words}"),
        },
        read_only: declared.fixed().is_some(),
        ..ParameterDescriptor::default()
    };
    match declared.range {
        Some(Range::Integer(from_value, to_value)) => message.integer_range.push(IntegerRange {
            from_value,
            to_value,
            step: 0,
        }),
        Some(Range::Float(from_value, to_value)) => {
            message.floating_point_range.push(FloatingPointRange {
                from_value,
                to_value,
                step: 0.0,
            });
        }
        None => {}
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_every_type_pass_both_ways() {
        let values = [
            ParamValue::Bool(true),
            ParamValue::I64(-3),
            ParamValue::F64(0.5),
            ParamValue::String("a".to_owned()),
            ParamValue::BoolArray(vec![true]),
            ParamValue::I64Array(vec![1]),
            ParamValue::F64Array(vec![0.5]),
            ParamValue::StringArray(vec!["b".to_owned()]),
        ];
        for value in values {
            assert_eq!(value_from(value_message(&value)), Ok(Some(value)));
        }
        assert_eq!(value_from(ParameterValue::default()), Ok(None));
        for type_ in [5, 10, 255] {
            let message = ParameterValue {
                type_,
                ..ParameterValue::default()
            };
            assert!(value_from(message).is_err());
        }
    }
}
