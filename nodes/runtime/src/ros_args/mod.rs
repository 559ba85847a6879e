//! The `--ros-args` command line, by the grammar of rcl's `arguments.h`.

mod error;
mod log_level;
mod param_override;
mod parse;

pub use crate::names::{NameKind, RemapRule, RemapTarget};
pub use error::RosArgsError;
pub use log_level::{LogLevel, LogLevelRule};
pub use param_override::ParamOverride;

use std::path::PathBuf;

/// A parsed command line.
#[derive(Clone, Debug, PartialEq)]
pub struct RosArgs {
    /// Remap rules in the order given; the first match wins.
    pub remaps: Vec<RemapRule>,
    /// `-p name:=value` in the order given; the last one wins, and all win over files.
    pub param_overrides: Vec<ParamOverride>,
    /// `--params-file` in the order given; the last one wins.
    pub params_files: Vec<PathBuf>,
    /// `--log-level` in the order given; the last one for a logger wins.
    pub log_levels: Vec<LogLevelRule>,
    /// `--enclave`, an absolute name.
    pub enclave: Option<String>,
    /// `--log-config-file`, kept and not used: the console logger has no configuration file.
    pub log_config_file: Option<String>,
    /// `--log-file-name`, kept and not used: there is no log file.
    pub log_file_name: Option<String>,
    /// False after `--disable-stdout-logs`.
    pub stdout_logs: bool,
    /// False after `--disable-rosout-logs`.
    pub rosout_logs: bool,
    /// False after `--disable-external-lib-logs`.
    pub external_lib_logs: bool,
    /// Everything outside the ROS scopes in order, the program's name first where it was given.
    pub user_args: Vec<String>,
    /// Arguments inside a ROS scope that no rule knows.
    pub unparsed: Vec<String>,
    /// Lines for the log once it is up.
    pub warnings: Vec<String>,
}

impl Default for RosArgs {
    fn default() -> Self {
        RosArgs {
            remaps: Vec::new(),
            param_overrides: Vec::new(),
            params_files: Vec::new(),
            log_levels: Vec::new(),
            enclave: None,
            log_config_file: None,
            log_file_name: None,
            stdout_logs: true,
            rosout_logs: true,
            external_lib_logs: true,
            user_args: Vec::new(),
            unparsed: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

impl RosArgs {
    /// Parses a command line, with or without the program's name in front.
    ///
    /// A malformed rule fails at once; an unknown argument inside a scope is kept in `unparsed`.
    pub fn parse(argv: impl IntoIterator<Item = String>) -> Result<RosArgs, RosArgsError> {
        parse::parse(argv)
    }

    /// The name of a node called `default` in the code, after `__node:=` rules.
    pub fn node_name(&self, default: &str) -> String {
        self.rules_of(default)
            .find_map(|rule| match &rule.target {
                RemapTarget::NodeName(name) => Some(name.clone()),
                _ => None,
            })
            .unwrap_or_else(|| default.to_owned())
    }

    /// The namespace of a node called `default` in the code, after `__ns:=` rules; `/` without one.
    ///
    /// As in rcl, a rule `node:__ns:=` names the node by the name it has after `__node:=`.
    pub fn namespace(&self, default: &str) -> String {
        self.rules_of(&self.node_name(default))
            .find_map(|rule| match &rule.target {
                RemapTarget::Namespace(namespace) => Some(namespace.clone()),
                _ => None,
            })
            .unwrap_or_else(|| "/".to_owned())
    }

    fn rules_of<'a>(&'a self, node: &'a str) -> impl Iterator<Item = &'a RemapRule> {
        self.remaps.iter().filter(move |rule| rule.applies_to(node))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(rules: &[&str]) -> RosArgs {
        let rules = rules.iter().flat_map(|rule| ["-r", rule]);
        RosArgs::parse(["--ros-args"].into_iter().chain(rules).map(str::to_owned)).unwrap()
    }

    #[test]
    fn first_rule_for_the_node_wins() {
        let args = args(&[
            "other:__node:=wrong",
            "mapper:__node:=front",
            "__node:=late",
        ]);
        assert_eq!(args.node_name("mapper"), "front");
        assert_eq!(args.node_name("markers"), "late");
        assert_eq!(RosArgs::default().node_name("mapper"), "mapper");
    }

    #[test]
    fn namespace_rules_see_the_new_node_name() {
        let args = args(&[
            "mapper:__ns:=/old",
            "mapper:__node:=front",
            "front:__ns:=/robot",
        ]);
        assert_eq!(args.namespace("mapper"), "/robot");
        assert_eq!(args.namespace("markers"), "/");
    }
}
