use crate::names::{is_identifier, shown, split_node};
use crate::param_value::ParamValue;
use std::str::FromStr;

/// `-p [node:]name:=value`, the value read as YAML.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamOverride {
    /// The only node the rule is for (by name, in any namespace), or all of them.
    pub node: Option<String>,
    /// The parameter, levels separated by dots.
    pub name: String,
    /// Its value.
    pub value: ParamValue,
}

impl FromStr for ParamOverride {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (node, rule) = split_node(text);
        let (name, value) = rule.split_once(":=").ok_or("there is no `:=`")?;
        if !is_param_name(name) {
            return Err(format!("`{}` is no parameter name", shown(name)));
        }
        let value = ParamValue::from_yaml_text(value)
            .map_err(|error| format!("the value `{}` is refused: {error}", shown(value)))?;
        Ok(ParamOverride {
            node: node.map(str::to_owned),
            name: name.to_owned(),
            value,
        })
    }
}

/// Levels separated by dots, each of parts separated by slashes; `~/` or `/` may lead a level.
fn is_param_name(name: &str) -> bool {
    let level = |level: &str| {
        let parts = level
            .strip_prefix("~/")
            .or_else(|| level.strip_prefix('/'))
            .unwrap_or(level);
        parts.split('/').all(is_identifier)
    };
    name.split('.').all(level)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_carry_topics() {
        for good in [
            "a",
            "a.b",
            "qos./robot/points.depth",
            "qos.~/x.depth",
            "~/a",
            "/a/b",
            "a__b",
        ] {
            assert!(is_param_name(good), "{good}");
        }
        for bad in ["", ".", "a.", ".a", "a b", "1a", "a//b", "}a", "a/", "/"] {
            assert!(!is_param_name(bad), "{bad}");
        }
    }

    #[test]
    fn the_node_prefix_is_split_off() {
        let rule: ParamOverride = "mapper:qos.map.depth:=7".parse().unwrap();
        assert_eq!(rule.node.as_deref(), Some("mapper"));
        assert_eq!(
            (rule.name.as_str(), rule.value),
            ("qos.map.depth", ParamValue::I64(7))
        );
    }
}
