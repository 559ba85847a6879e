//! Parameters of a node: given by files and the command line, declared by reading them, and changed at
//! run time.

mod about;
mod change;
mod describe;
mod error;
mod ranges;
mod sections;
mod state;
mod unknown;

pub use crate::config::param_value::{ParamValue, ValueError};
pub use about::{About, Declared, Range};
pub(crate) use change::Refusal;
pub use error::ParamError;
pub use sections::{Addressed, addressed};
pub use unknown::{Unknown, is_near, nearest};

use std::collections::BTreeMap;
use std::path::Path;

use crate::config::names;
use crate::config::params_file::{self, NodePattern};
use crate::config::ros_args::RosArgs;
use crate::sync::lock;
pub use state::Params;
use state::{Given, Origin, State};

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Origin::Default => f.write_str("the default"),
            Origin::CommandLine => f.write_str("from the command line"),
            Origin::Service => f.write_str("set at run time"),
            Origin::File { path, key } => write!(f, "from {}, `{key}`", path.display()),
        }
    }
}

impl std::fmt::Debug for Params {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Params of {}: {:?}", self.node, self.declared())
    }
}

impl Params {
    /// Loads the parameters of the node `node_fqn` (for example `/robot/mapper`).
    ///
    /// Files apply in the given order, then the command line; the last value is used.
    pub fn load(args: &RosArgs, node_fqn: &str) -> Result<Params, ParamError> {
        Self::load_renamed(args, node_fqn, name_of(node_fqn))
    }

    /// Loads the parameters of the node `code_name`, under the name and namespace that the
    /// arguments give it.
    pub fn of_node(args: &RosArgs, code_name: &str) -> Result<Params, ParamError> {
        let (name, namespace) = (args.node_name(code_name), args.namespace(code_name));
        Self::load_renamed(args, &names::fully_qualified(&name, &namespace), code_name)
    }

    /// Loads the parameters of a renamed node. If a file does not address the new name, the section of
    /// `code_name` applies, unlike in rcl.
    pub(crate) fn load_renamed(
        args: &RosArgs,
        node_fqn: &str,
        code_name: &str,
    ) -> Result<Params, ParamError> {
        let params = Params {
            node: node_fqn.to_owned(),
            ..Params::default()
        };
        for path in &args.params_files {
            params.add_file(path, code_name)?;
        }
        let node_name = name_of(node_fqn);
        for rule in &args.param_overrides {
            if rule.node.as_deref().is_none_or(|node| node == node_name) {
                let (value, named) = (rule.value.clone(), rule.node.is_some());
                params.give(rule.name.clone(), value, Origin::CommandLine, named);
            }
        }
        Ok(params)
    }

    /// Parameters as if from the command line, for a node created by code.
    pub fn from_values<N: Into<String>>(
        node_fqn: &str,
        values: impl IntoIterator<Item = (N, ParamValue)>,
    ) -> Params {
        let params = Params {
            node: node_fqn.to_owned(),
            ..Params::default()
        };
        for (name, value) in values {
            params.give(name.into(), value, Origin::CommandLine, true);
        }
        params
    }

    fn add_file(&self, path: &Path, code_name: &str) -> Result<(), ParamError> {
        let entries = params_file::read(path)?;
        let for_us = |nodes: &NodePattern| nodes.matches(&self.node);
        let name = name_of(&self.node);
        let knows_us = (entries.iter()).any(|e| e.nodes.names(name) && for_us(&e.nodes));
        let namespace = self.node.strip_suffix(name).unwrap_or_default();
        let in_code = format!("{namespace}{code_name}");
        let by_code = |nodes: &NodePattern| nodes.names(code_name) && nodes.matches(&in_code);
        for entry in entries {
            if for_us(&entry.nodes) || !knows_us && by_code(&entry.nodes) {
                let (path, key) = (path.to_owned(), entry.key);
                let named = entry.nodes.name().is_some();
                self.give(entry.name, entry.value, Origin::File { path, key }, named);
            }
        }
        Ok(())
    }

    fn give(&self, name: String, value: ParamValue, origin: Origin, named: bool) {
        let given = Given {
            value,
            origin,
            named,
        };
        lock(&self.state).given.insert(name, given);
    }

    /// Reads a bool; `yes`, `on`, `no` and `off` are accepted.
    pub fn bool(&self, name: &str, default: bool) -> Result<bool, ParamError> {
        let expected = "a bool (true or false)";
        let read = ParamValue::as_bool;
        self.read(name, default, expected, read, ParamValue::Bool)
    }

    /// Reads an integer; `0x1F` and octal `010` are accepted.
    pub fn i64(&self, name: &str, default: i64) -> Result<i64, ParamError> {
        let expected = "an integer (no point, no exponent, no quotes)";
        let read = ParamValue::as_i64;
        self.read(name, default, expected, read, ParamValue::I64)
    }

    /// Reads a float other than NaN; an integer is converted and logged.
    pub fn f64(&self, name: &str, default: f64) -> Result<f64, ParamError> {
        let expected = "a float (with a point, no quotes)";
        let read = |value: &ParamValue| self.float(name, value);
        self.read(name, default, expected, read, ParamValue::F64)
    }

    /// Reads a text.
    pub fn string(&self, name: &str, default: &str) -> Result<String, ParamError> {
        let expected = "a text (in quotes)";
        let read = |value: &ParamValue| value.as_str().map(str::to_owned);
        self.read(name, default.to_owned(), expected, read, ParamValue::String)
    }

    /// Reads a list of integers.
    pub fn i64_array(&self, name: &str, default: &[i64]) -> Result<Vec<i64>, ParamError> {
        let expected = "a list of integers ([1, 2])";
        let list = |value: &ParamValue| list(value, ParamValue::as_i64);
        self.read(name, default.to_vec(), expected, list, ParamValue::I64Array)
    }

    /// Reads a list of floats other than NaN; integers are converted and logged.
    pub fn f64_array(&self, name: &str, default: &[f64]) -> Result<Vec<f64>, ParamError> {
        let expected = "a list of floats ([1.0, 2.0])";
        let list = |value: &ParamValue| list(value, |item| self.float(name, item));
        self.read(name, default.to_vec(), expected, list, ParamValue::F64Array)
    }

    /// Reads a list of texts.
    pub fn string_array(&self, name: &str, default: &[&str]) -> Result<Vec<String>, ParamError> {
        let expected = "a list of texts ([\"a\", \"b\"])";
        let list = |value: &ParamValue| list(value, |item| item.as_str().map(str::to_owned));
        let default = default.iter().map(|text| (*text).to_owned()).collect();
        self.read(name, default, expected, list, ParamValue::StringArray)
    }

    fn float(&self, name: &str, value: &ParamValue) -> Option<f64> {
        if matches!(value, ParamValue::I64(_)) {
            let node = &self.node;
            log::info!("parameter `{name}` of {node}: integer {value} converted to a float");
        }
        value.as_f64().filter(|value| !value.is_nan())
    }

    fn read<T: Clone>(
        &self,
        name: &str,
        default: T,
        expected: &'static str,
        convert: impl Fn(&ParamValue) -> Option<T>,
        wrap: impl Fn(T) -> ParamValue,
    ) -> Result<T, ParamError> {
        let given = lock(&self.state).given.get(name).cloned();
        let value = match given {
            None => default.clone(),
            Some(Given { value, origin, .. }) => {
                convert(&value).ok_or_else(|| ParamError::Type {
                    node: self.node.clone(),
                    name: name.to_owned(),
                    expected,
                    found: format!("{} {}", value.type_name(), brief(&value)),
                    origin: origin.to_string(),
                })?
            }
        };
        let mut state = lock(&self.state);
        let about = state.about_of(name);
        let declared = || Declared::new(wrap(value.clone()), wrap(default), about);
        let all = &mut state.declared;
        all.entry(name.to_owned()).or_insert_with(declared);
        Ok(value)
    }

    /// Full name of the node.
    pub fn node(&self) -> &str {
        &self.node
    }

    /// True if the parameter is declared.
    pub fn has(&self, name: &str) -> bool {
        lock(&self.state).declared.contains_key(name)
    }

    /// True if a file or the command line gives the parameter.
    pub fn is_given(&self, name: &str) -> bool {
        lock(&self.state).given.contains_key(name)
    }

    /// Error for an invalid value of the declared type.
    pub fn invalid(&self, name: &str, problem: impl Into<String>) -> ParamError {
        let state = lock(&self.state);
        let given = state.given.get(name);
        let declared = state.declared.get(name).map(|declared| &declared.value);
        let value = declared.or(given.map(|given| &given.value));
        let origin = given.map_or(&Origin::Default, |given| &given.origin);
        ParamError::Invalid {
            node: self.node.clone(),
            name: name.to_owned(),
            value: value.map(brief).unwrap_or_default(),
            origin: origin.to_string(),
            problem: problem.into(),
        }
    }

    /// Parameters that are given but not declared, sorted.
    pub fn unused(&self) -> Vec<String> {
        let State {
            given, declared, ..
        } = &*lock(&self.state);
        let names = given.keys();
        let unused = names.filter(|name| !declared.contains_key(*name));
        unused.cloned().collect()
    }

    /// Declared parameters with their current values.
    pub fn declared(&self) -> BTreeMap<String, ParamValue> {
        let state = lock(&self.state);
        let all = state.declared.iter();
        all.map(|(name, declared)| (name.clone(), declared.value.clone()))
            .collect()
    }

    /// Declared parameters with their descriptions.
    pub fn described(&self) -> BTreeMap<String, Declared> {
        lock(&self.state).declared.clone()
    }
}

/// Node name without its namespace.
fn name_of(node_fqn: &str) -> &str {
    node_fqn.rsplit('/').next().unwrap_or(node_fqn)
}

/// Value shortened for a message.
fn brief(value: &ParamValue) -> String {
    value.to_string().chars().take(160).collect()
}

fn list<T>(value: &ParamValue, item: impl Fn(&ParamValue) -> Option<T>) -> Option<Vec<T>> {
    value.items()?.iter().map(item).collect()
}

#[cfg(test)]
mod tests;
