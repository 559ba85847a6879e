//! Parameters of a node: given by files and the command line, declared by the node as it reads them.

mod error;
mod ranges;

pub use crate::param_value::{ParamValue, ValueError};
pub use error::ParamError;

use crate::{params_file, ros_args::RosArgs};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

/// The parameters of one node.
///
/// Reading a parameter declares it. Values do not change while the node runs.
#[derive(Debug, Default)]
pub struct Params {
    node: String,
    given: BTreeMap<String, Given>,
    declared: Mutex<BTreeMap<String, Declared>>,
}

/// A value and where it comes from.
#[derive(Clone, Debug)]
struct Given {
    value: ParamValue,
    origin: Origin,
}

#[derive(Clone, Debug)]
enum Origin {
    Default,
    CommandLine,
    File { path: PathBuf, key: String },
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Origin::Default => f.write_str("the default"),
            Origin::CommandLine => f.write_str("from the command line"),
            Origin::File { path, key } => write!(f, "from {}, `{key}`", path.display()),
        }
    }
}

/// A parameter that the node has read.
#[derive(Clone, Debug, PartialEq)]
pub struct Declared {
    /// The parameter, levels separated by dots.
    pub name: String,
    /// The value in use.
    pub value: ParamValue,
    /// What it means, with its unit; may be empty.
    pub description: String,
}

impl Params {
    /// Reads the parameters of the node `node_fqn` (for example `/robot/mapper`).
    ///
    /// Files count in the order given, then the command line; what comes later wins.
    pub fn load(args: &RosArgs, node_fqn: &str) -> Result<Params, ParamError> {
        let mut params = Params {
            node: node_fqn.to_owned(),
            ..Params::default()
        };
        for path in &args.params_files {
            params.add_file(path)?;
        }
        let node_name = node_fqn.rsplit('/').next().unwrap_or(node_fqn);
        for rule in &args.param_overrides {
            if rule.node.as_deref().is_none_or(|node| node == node_name) {
                let given = Given {
                    value: rule.value.clone(),
                    origin: Origin::CommandLine,
                };
                params.given.insert(rule.name.clone(), given);
            }
        }
        Ok(params)
    }

    /// Parameters as if from the command line, for a node made by other code.
    pub fn from_values<N: Into<String>>(
        node_fqn: &str,
        values: impl IntoIterator<Item = (N, ParamValue)>,
    ) -> Params {
        let given = values
            .into_iter()
            .map(|(name, value)| {
                (
                    name.into(),
                    Given {
                        value,
                        origin: Origin::CommandLine,
                    },
                )
            })
            .collect();
        Params {
            node: node_fqn.to_owned(),
            given,
            ..Params::default()
        }
    }

    fn add_file(&mut self, path: &Path) -> Result<(), ParamError> {
        for entry in params_file::read(path)? {
            if entry.nodes.matches(&self.node) {
                let origin = Origin::File {
                    path: path.to_owned(),
                    key: entry.key,
                };
                self.given.insert(
                    entry.name,
                    Given {
                        value: entry.value,
                        origin,
                    },
                );
            }
        }
        Ok(())
    }

    /// A bool; `yes`, `on`, `no`, `off` count.
    pub fn bool(&self, name: &str, default: bool) -> Result<bool, ParamError> {
        self.about("").bool(name, default)
    }

    /// An integer; `0x1F` and the octal `010` count.
    pub fn i64(&self, name: &str, default: i64) -> Result<i64, ParamError> {
        self.about("").i64(name, default)
    }

    /// A count: an integer from 0 on.
    pub fn usize(&self, name: &str, default: usize) -> Result<usize, ParamError> {
        self.usize_in(name, default, 0..=usize::MAX)
    }

    /// A float, never NaN; an integer counts, with a line in the log.
    pub fn f64(&self, name: &str, default: f64) -> Result<f64, ParamError> {
        self.about("").f64(name, default)
    }

    /// A text.
    pub fn string(&self, name: &str, default: &str) -> Result<String, ParamError> {
        self.about("").string(name, default)
    }

    /// A list of integers.
    pub fn i64_array(&self, name: &str, default: &[i64]) -> Result<Vec<i64>, ParamError> {
        self.about("").i64_array(name, default)
    }

    /// A list of floats, none NaN; integers count, with a line in the log.
    pub fn f64_array(&self, name: &str, default: &[f64]) -> Result<Vec<f64>, ParamError> {
        self.about("").f64_array(name, default)
    }

    /// A list of texts.
    pub fn string_array(&self, name: &str, default: &[&str]) -> Result<Vec<String>, ParamError> {
        self.about("").string_array(name, default)
    }

    /// The same readers with a description for the parameter service: meaning and unit.
    pub fn about<'a>(&'a self, description: &'a str) -> Described<'a> {
        Described {
            params: self,
            description,
        }
    }

    /// True if a file or the command line gives the parameter.
    pub fn is_given(&self, name: &str) -> bool {
        self.given.contains_key(name)
    }

    /// An error for a value of the right type that cannot be used.
    pub fn invalid(&self, name: &str, problem: impl Into<String>) -> ParamError {
        let value = self
            .declared_lock()
            .get(name)
            .map(|declared| brief(&declared.value));
        let given = self.given.get(name);
        ParamError::Invalid {
            node: self.node.clone(),
            name: name.to_owned(),
            value: value
                .or_else(|| given.map(|given| brief(&given.value)))
                .unwrap_or_default(),
            origin: given
                .map_or(&Origin::Default, |given| &given.origin)
                .to_string(),
            problem: problem.into(),
        }
    }

    /// Parameters given and never read by the node, sorted: typing errors, mostly.
    pub fn unused(&self) -> Vec<String> {
        let declared = self.declared_lock();
        self.given
            .keys()
            .filter(|name| !declared.contains_key(*name))
            .cloned()
            .collect()
    }

    /// Parameters the node has read, by name.
    pub fn declared(&self) -> Vec<Declared> {
        self.declared_lock().values().cloned().collect()
    }

    fn declared_lock(&self) -> MutexGuard<'_, BTreeMap<String, Declared>> {
        self.declared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// [`Params`] with a description for what is read next.
#[derive(Clone, Copy, Debug)]
pub struct Described<'a> {
    params: &'a Params,
    description: &'a str,
}

impl Described<'_> {
    /// See [`Params::bool`].
    pub fn bool(&self, name: &str, default: bool) -> Result<bool, ParamError> {
        self.read(
            name,
            default,
            "a bool (true or false)",
            ParamValue::as_bool,
            ParamValue::Bool,
        )
    }

    /// See [`Params::i64`].
    pub fn i64(&self, name: &str, default: i64) -> Result<i64, ParamError> {
        self.read(
            name,
            default,
            "an integer (no point, no exponent, no quotes)",
            ParamValue::as_i64,
            ParamValue::I64,
        )
    }

    /// See [`Params::f64`].
    pub fn f64(&self, name: &str, default: f64) -> Result<f64, ParamError> {
        self.read(
            name,
            default,
            "a float (with a point, no quotes)",
            |value| self.float(name, value),
            ParamValue::F64,
        )
    }

    /// See [`Params::string`].
    pub fn string(&self, name: &str, default: &str) -> Result<String, ParamError> {
        let text = |value: &ParamValue| value.as_str().map(str::to_owned);
        self.read(
            name,
            default.to_owned(),
            "a text (in quotes)",
            text,
            ParamValue::String,
        )
    }

    /// See [`Params::i64_array`].
    pub fn i64_array(&self, name: &str, default: &[i64]) -> Result<Vec<i64>, ParamError> {
        let expected = "a list of integers ([1, 2])";
        let list = |value: &ParamValue| list(value, ParamValue::as_i64);
        self.read(name, default.to_vec(), expected, list, ParamValue::I64Array)
    }

    /// See [`Params::f64_array`].
    pub fn f64_array(&self, name: &str, default: &[f64]) -> Result<Vec<f64>, ParamError> {
        let expected = "a list of floats ([1.0, 2.0])";
        let list = |value: &ParamValue| list(value, |item| self.float(name, item));
        self.read(name, default.to_vec(), expected, list, ParamValue::F64Array)
    }

    /// See [`Params::string_array`].
    pub fn string_array(&self, name: &str, default: &[&str]) -> Result<Vec<String>, ParamError> {
        let expected = "a list of texts ([\"a\", \"b\"])";
        let list = |value: &ParamValue| list(value, |item| item.as_str().map(str::to_owned));
        let default = default.iter().map(|text| (*text).to_owned()).collect();
        self.read(name, default, expected, list, ParamValue::StringArray)
    }

    fn float(&self, name: &str, value: &ParamValue) -> Option<f64> {
        if matches!(value, ParamValue::I64(_)) {
            let node = &self.params.node;
            log::info!("parameter `{name}` of {node}: the integer {value} is taken as a float");
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
        let value = match self.params.given.get(name) {
            None => default,
            Some(Given { value, origin }) => convert(value).ok_or_else(|| ParamError::Type {
                node: self.params.node.clone(),
                name: name.to_owned(),
                expected,
                found: format!("{} {}", value.type_name(), brief(value)),
                origin: origin.to_string(),
            })?,
        };
        let mut declared = self.params.declared_lock();
        let entry = declared.entry(name.to_owned()).or_insert_with(|| Declared {
            name: name.to_owned(),
            value: wrap(value.clone()),
            description: String::new(),
        });
        if !self.description.is_empty() {
            self.description.clone_into(&mut entry.description);
        }
        Ok(value)
    }
}

/// A value for a message, not longer than a line or two.
fn brief(value: &ParamValue) -> String {
    value.to_string().chars().take(160).collect()
}

fn list<T>(value: &ParamValue, item: impl Fn(&ParamValue) -> Option<T>) -> Option<Vec<T>> {
    value.items()?.iter().map(item).collect()
}

#[cfg(test)]
mod tests;
