use crate::config::names::{is_identifier, shown, split_node};
use crate::config::param_value::ParamValue;

/// `-p [node:]name:=value`, the value read as YAML.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ParamOverride {
    /// Node (by name, in any namespace) that the rule is restricted to; `None`: all nodes.
    pub node: Option<String>,
    /// Parameter name, levels separated by dots.
    pub name: String,
    pub value: ParamValue,
}

impl std::str::FromStr for ParamOverride {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (node, rule) = split_node(text);
        let (name, value) = rule.split_once(":=").ok_or("`:=` is missing")?;
        if !name.split('.').all(is_level) {
            return Err(format!("`{}` is not a valid parameter name", shown(name)));
        }
        let value = ParamValue::from_yaml_text(value)
            .map_err(|error| format!("invalid value `{}`: {error}", shown(value)))?;
        Ok(ParamOverride {
            node: node.map(str::to_owned),
            name: name.to_owned(),
            value,
        })
    }
}

/// True for parts separated by slashes; the first may begin with `~/` or `/`.
fn is_level(level: &str) -> bool {
    let rooted = level.strip_prefix("~/").or(level.strip_prefix('/'));
    rooted.unwrap_or(level).split('/').all(is_identifier)
}
