//! The `--ros-args` command line, by the grammar of rcl's `arguments.h`.

mod error;
mod log_level;
mod param_override;
mod parse;

pub use error::RosArgsError;
pub(crate) use log_level::LogLevelRule;
pub(crate) use param_override::ParamOverride;

use std::path::PathBuf;

use crate::names::{RemapRule, RemapTarget};

/// A parsed command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RosArgs {
    /// Remap rules in the order given; the first match wins.
    pub(crate) remaps: Vec<RemapRule>,
    /// `-p name:=value` in the order given; the last one wins, and all win over files.
    pub(crate) param_overrides: Vec<ParamOverride>,
    /// `--params-file` in the order given; the last one wins.
    pub(crate) params_files: Vec<PathBuf>,
    /// `--enclave`; the last one wins.
    pub(crate) enclave: Option<String>,
    /// `--log-level` in the order given; the last one for a logger wins.
    pub(crate) log_levels: Vec<LogLevelRule>,
    /// True after `--disable-stdout-logs`.
    pub(crate) no_stdout_logs: bool,
    /// True after `--disable-rosout-logs`.
    pub(crate) no_rosout_logs: bool,
    /// First part of the name of the log file; the program's name if none.
    pub log_file_name: Option<String>,
    /// True: no log file is written.
    pub no_log_file: bool,
    /// Everything outside the ROS scopes in order, the program's name first where it was given.
    pub user_args: Vec<String>,
    /// Lines for the log once it is up.
    pub(crate) warnings: Vec<String>,
}

impl RosArgs {
    /// Parameter files, in the order given.
    pub fn params_files(&self) -> &[std::path::PathBuf] {
        &self.params_files
    }

    /// Parses a command line, with or without the program's name in front.
    ///
    /// A malformed rule fails at once; of an unknown argument inside a scope the log is warned.
    pub fn parse(argv: impl IntoIterator<Item = String>) -> Result<RosArgs, RosArgsError> {
        parse::parse(argv)
    }

    /// The name of a node called `default` in the code, after `__node:=` rules.
    pub fn node_name(&self, default: &str) -> String {
        let mut rules = self.rules_of(default);
        let name = rules.find_map(|target| match target {
            RemapTarget::NodeName(name) => Some(name.as_str()),
            _ => None,
        });
        name.unwrap_or(default).to_owned()
    }

    /// The namespace of a node called `default` in the code, after `__ns:=` rules; `/` without one.
    ///
    /// As in rcl, a rule `node:__ns:=` names the node by the name it has after `__node:=`.
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
