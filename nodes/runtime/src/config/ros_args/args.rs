//! Parsed arguments.

use std::path::PathBuf;

use super::log_level::LogLevelRule;
use super::param_override::ParamOverride;
use crate::config::names::RemapRule;

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
