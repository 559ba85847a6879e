//! Parameter files: `node: ros__parameters: name: value`, by the rules of rcl_yaml_param_parser.
//!
//! Stricter than rcl in one point: a duplicate key is an error.

mod error;
mod pattern;

pub(crate) use error::ParamFileError;
pub use pattern::NodePattern;

use crate::config::param_value::{ParamValue, scan};
use serde_yaml::{Mapping, Value};
use std::{collections::HashSet, fs::File, io::Read, path::Path};

/// Largest parameter file, bytes.
const FILE_BYTES_MAX: u64 = 1 << 20;
/// Limit of map levels above or below `ros__parameters`.
const DEPTH_MAX: usize = 16;

const PARAMETERS: &str = "ros__parameters";

/// One parameter of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileParam {
    /// Nodes it addresses.
    pub nodes: NodePattern,
    /// Name, levels separated by dots.
    pub name: String,
    /// Value of the parameter.
    pub value: ParamValue,
    /// Path of keys in the file.
    pub key: String,
}

/// Reads a parameter file; entries in the order of the file.
pub fn read(path: &Path) -> Result<Vec<FileParam>, ParamFileError> {
    let failed = |source| ParamFileError::Read {
        path: path.to_owned(),
        source,
    };
    // Opening a fifo would wait for a writer.
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(ParamFileError::NotAFile {
            path: path.to_owned(),
        });
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(failed)?;
    let limit = FILE_BYTES_MAX.saturating_add(1);
    let length = file.take(limit).read_to_end(&mut bytes).map_err(failed)?;
    if u64::try_from(length).is_ok_and(|length| length >= limit) {
        return Err(ParamFileError::TooLarge {
            path: path.to_owned(),
            bytes_max: FILE_BYTES_MAX,
        });
    }
    let text = String::from_utf8(bytes).map_err(|error| ParamFileError::Yaml {
        path: path.to_owned(),
        message: error.utf8_error().to_string(),
    })?;
    // Some editors write a byte order mark first.
    parse(text.strip_prefix('\u{feff}').unwrap_or(&text), path)
}

/// Parses the text of a parameter file; `path` is for messages.
fn parse(text: &str, path: &Path) -> Result<Vec<FileParam>, ParamFileError> {
    scan(text).map_err(|source| ParamFileError::Scan {
        path: path.to_owned(),
        source,
    })?;
    let value: Value = serde_yaml::from_str(text).map_err(|error| ParamFileError::Yaml {
        path: path.to_owned(),
        message: error.to_string(),
    })?;
    let mut reader = Reader {
        path,
        keys: Vec::new(),
        params: Vec::new(),
    };
    reader.nodes(value, "")?;
    Ok(reader.params)
}

/// Traversal of the file, with the keys of the current position.
struct Reader<'a> {
    path: &'a Path,
    keys: Vec<String>,
    params: Vec<FileParam>,
}

impl Reader<'_> {
    /// Reads a map of nodes and namespaces below `prefix`.
    fn nodes(&mut self, value: Value, prefix: &str) -> Result<(), ParamFileError> {
        const EXPECTED: &str = "a map of nodes, each with `ros__parameters` below it";
        let map = match value {
            Value::Null if prefix.is_empty() => return Ok(()),
            value => self.map(value, EXPECTED)?,
        };
        for (key, value) in map {
            let key = self.enter(key)?;
            if key == PARAMETERS {
                let nodes = NodePattern::parse(prefix)
                    .map_err(|problem| self.shape("a node name or pattern", problem.to_owned()))?;
                let mut names = HashSet::new();
                match value {
                    Value::Null => {}
                    value => self.parameters(value, &nodes, "", &mut names)?,
                }
            } else {
                let has_slash = prefix.ends_with('/') || key.starts_with('/');
                let slash = if has_slash { "" } else { "/" };
                let prefix = format!("{prefix}{slash}{key}");
                self.nodes(value, &prefix)?;
            }
            self.keys.pop();
        }
        Ok(())
    }

    /// Reads a map of parameters and of nested maps.
    fn parameters(
        &mut self,
        value: Value,
        nodes: &NodePattern,
        prefix: &str,
        names: &mut HashSet<String>,
    ) -> Result<(), ParamFileError> {
        for (key, value) in self.map(value, "a map of parameters")? {
            let key = self.enter(key)?;
            let name = match prefix {
                "" => key,
                prefix => format!("{prefix}.{key}"),
            };
            if value.is_mapping() {
                self.parameters(value, nodes, &name, names)?;
            } else {
                if !names.insert(name.clone()) {
                    return Err(self.shape("each parameter once", format!("`{name}` again")));
                }
                let key = self.keys.join(".");
                let value = match ParamValue::from_yaml(value) {
                    Ok(value) => value,
                    Err(source) => {
                        let path = self.path.to_owned();
                        return Err(ParamFileError::Value { path, key, source });
                    }
                };
                self.params.push(FileParam {
                    nodes: nodes.clone(),
                    name,
                    value,
                    key,
                });
            }
            self.keys.pop();
        }
        Ok(())
    }

    fn map(&self, value: Value, expected: &'static str) -> Result<Mapping, ParamFileError> {
        match value {
            Value::Mapping(map) => Ok(map),
            other => Err(self.shape(expected, found(&other))),
        }
    }

    /// Enters a key, which is a text or converts to one.
    fn enter(&mut self, key: Value) -> Result<String, ParamFileError> {
        let key = match key {
            Value::String(key) if !key.is_empty() => key,
            Value::Number(key) => key.to_string(),
            Value::Bool(key) => key.to_string(),
            other => return Err(self.shape("a name as the key", found(&other))),
        };
        self.keys.push(key.clone());
        if self.keys.len() > DEPTH_MAX {
            return Err(self.shape("at most 16 levels", "17 levels".to_owned()));
        }
        Ok(key)
    }

    fn shape(&self, expected: &'static str, found: String) -> ParamFileError {
        let key = self.keys.join(".");
        ParamFileError::Shape {
            path: self.path.to_owned(),
            key,
            expected,
            found,
        }
    }
}

fn found(value: &Value) -> String {
    let found = match value {
        Value::Null => "nothing",
        Value::String(text) if text.is_empty() => "an empty text",
        Value::Sequence(_) => "a list",
        Value::Mapping(_) => "a map",
        Value::Tagged(_) => "a tagged value",
        Value::Bool(_) => "a bool",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
    };
    found.to_owned()
}

#[cfg(test)]
mod tests;
