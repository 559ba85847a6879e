//! The `--ros-args` command line, with the grammar of rcl's `arguments.h`.

mod args;
mod error;
mod log_level;
mod param_override;
mod parse;

pub use error::RosArgsError;

use crate::config::names::RemapTarget;
pub use args::RosArgs;

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
