use log::LevelFilter;

use crate::config::names::shown;

/// `--log-level LEVEL` or `--log-level logger:=LEVEL`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LogLevelRule {
    /// Logger; `None`: all loggers.
    pub logger: Option<String>,
    /// New level of the logger.
    pub level: LevelFilter,
}

impl std::str::FromStr for LogLevelRule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (logger, level) = match text.split_once(":=") {
            Some((logger, level)) => (Some(logger), level),
            None => (None, text),
        };
        let known = |c: char| c.is_ascii_alphanumeric() || "_./:-".contains(c);
        let is_name = |logger: &&str| !logger.is_empty() && logger.chars().all(known);
        if let Some(logger) = logger.filter(|logger| !is_name(logger)) {
            return Err(format!("`{}` is not a valid logger name", shown(logger)));
        }
        Ok(LogLevelRule {
            logger: logger.map(str::to_owned),
            level: level_of(level)?,
        })
    }
}

/// Converts a severity of rcutils, in any case; fatal becomes error.
fn level_of(text: &str) -> Result<LevelFilter, String> {
    match text.to_ascii_lowercase().as_str() {
        "debug" => Ok(LevelFilter::Debug),
        "unset" | "info" => Ok(LevelFilter::Info),
        "warn" => Ok(LevelFilter::Warn),
        "error" | "fatal" => Ok(LevelFilter::Error),
        _ => Err(format!("`{}` is not a log level", shown(text))),
    }
}
