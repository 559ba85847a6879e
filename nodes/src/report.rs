//! Final reports of nodes as JSON files, and their numbers as diagnostics.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::files::atomic_write::{self, AtomicFile};
use crate::start::NodeError;
use lattice_runtime::Diagnostics;
use lattice_runtime::params::{ParamError, Params};

/// Values of a report as diagnostic keys and values, flattened.
pub fn key_values(report: &impl Serialize) -> Vec<(String, String)> {
    fn walk(name: &str, value: &serde_json::Value, out: &mut Vec<(String, String)>) {
        match value {
            serde_json::Value::Object(fields) => {
                for (key, value) in fields {
                    walk(key, value, out);
                }
            }
            value => out.push((name.to_owned(), value.to_string())),
        }
    }
    let mut out = Vec::new();
    if let Ok(value) = serde_json::to_value(report) {
        walk("", &value, &mut out);
    }
    out
}

/// `report_file`: path of a report; an error if it cannot be written.
pub fn file(params: &Params) -> Result<String, ParamError> {
    let name = "report_file";
    let path = params.string(name, "")?;
    if path.is_empty() {
        return Ok(path);
    }
    match AtomicFile::create(Path::new(&path)) {
        Ok(_) => Ok(path),
        Err(error) => Err(params.invalid(name, format!("{path:?}: {error}"))),
    }
}

/// Report with the transport losses.
#[derive(Serialize)]
struct WithLosses<'a, R> {
    #[serde(flatten)]
    report: &'a R,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    transport: BTreeMap<String, u64>,
}

/// Writes a report as JSON if a path is given, with transport losses, if any, under `transport`.
pub fn write(
    path: &str,
    report: &impl Serialize,
    diagnostics: &Diagnostics,
) -> Result<(), NodeError> {
    if path.is_empty() {
        return Ok(());
    }
    let transport = diagnostics.losses().into_iter().collect();
    let text = serde_json::to_string_pretty(&WithLosses { report, transport })?;
    atomic_write::write_text(Path::new(path), &(text + "\n"))
}

/// Reads a report written by [`write()`].
pub fn read<T: for<'de> Deserialize<'de>>(path: &Path) -> io::Result<T> {
    let text = fs::read_to_string(path)?;
    serde_json::from_str(&text).map_err(io::Error::other)
}
