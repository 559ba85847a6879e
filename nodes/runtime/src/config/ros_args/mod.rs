//! The `--ros-args` command line, with the grammar of rcl's `arguments.h`.

mod error;
mod log_level;
mod param_override;
mod parse;

pub use error::RosArgsError;
pub(crate) use log_level::LogLevelRule;
pub(crate) use param_override::ParamOverride;

use std::path::PathBuf;

use crate::config::names::{RemapRule, RemapTarget};

/// A parsed command line.
///
/// ```
/// use lattice_runtime::ros_args::RosArgs;
///
/// let words = "mapper --fast --ros-args -r __node:=left -r __ns:=/robot".split(' ');
/// let args = RosArgs::parse(words.map(str::to_owned))?;
/// assert_eq!(args.user_args, ["mapper", "--fast"]);
/// assert_eq!(args.node_name("mapper"), "left");
/// assert_eq!(args.namespace("mapper"), "/robot");
/// # Ok::<(), lattice_runtime::ros_args::RosArgsError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RosArgs {
    /// Remap rules in order; the first match applies.
    pub(crate) remaps: Vec<RemapRule>,
    /// `-p name:=value` in order; the last one applies, and all override files.
    pub(crate) param_overrides: Vec<ParamOverride>,
    /// `--params-file` in order; the last one applies.
    pub(crate) params_files: Vec<PathBuf>,
    /// `--enclave`; the last one applies.
    pub(crate) enclave: Option<String>,
    /// `--log-level` in order; the last one per logger applies.
    pub(crate) log_levels: Vec<LogLevelRule>,
    /// True after `--disable-stdout-logs`.
    pub(crate) no_stdout_logs: bool,
    /// True after `--disable-rosout-logs`.
    pub(crate) no_rosout_logs: bool,
    /// First part of the log file's name; `None`: the program's name.
    pub log_file_name: Option<String>,
    /// True: no log file is written.
    pub no_log_file: bool,
    /// Arguments outside the ROS scopes in order, with the program's name first if given.
    pub user_args: Vec<String>,
    /// Warnings for the log, before logging is initialized.
    pub(crate) warnings: Vec<String>,
}

impl RosArgs {
    /// Parameter files, in the order given.
    pub fn params_files(&self) -> &[std::path::PathBuf] {
        &self.params_files
    }

    /// Parses a command line, with or without the program's name in front.
    ///
    /// A malformed rule is an error; an unknown argument inside a scope is a warning.
    pub fn parse(argv: impl IntoIterator<Item = String>) -> Result<RosArgs, RosArgsError> {
        parse::parse(argv)
    }

    /// Name of a node with the default name `default`, after `__node:=` rules.
    pub fn node_name(&self, default: &str) -> String {
        let mut rules = self.rules_of(default);
        let name = rules.find_map(|target| match target {
            RemapTarget::NodeName(name) => Some(name.as_str()),
            _ => None,
        });
        name.unwrap_or(default).to_owned()
    }

    /// Namespace of a node with the default name `default`, after `__ns:=` rules; `/` without one.
    ///
    /// As in rcl, a rule `node:__ns:=` refers to the node's name after `__node:=`.
    pub fn namespace(&self, default: &str) -> String {
        let name = self.node_name(default);
        let mut rules = self.rules_of(&name);
        let namespace = rules.find_map(|target| match target {
            RemapTarget::Namespace(namespace) => Some(namespace.as_str()),
            _ => None,
        });
        namespace.unwrap_or("/").to_owned()
    }

    fn rules_of<'a>(&'a self, node: &str) -> impl Iterator<Item = &'a RemapTarget> {
        let rules = self.remaps.iter().filter(move |rule| rule.applies_to(node));
        rules.map(|rule| &rule.target)
    }
}

#[cfg(test)]
mod tests;
