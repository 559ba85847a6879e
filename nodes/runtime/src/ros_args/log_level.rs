use crate::names::shown;
use std::{fmt, str::FromStr};

/// rcutils severities, case does not matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LogLevel {
    /// Back to the default.
    Unset,
    /// Everything.
    Debug,
    /// The default.
    Info,
    /// Warnings and worse.
    Warn,
    /// Errors and worse.
    Error,
    /// Only what ends the process.
    Fatal,
}

impl LogLevel {
    const NAMES: [(&'static str, LogLevel); 6] = [
        ("unset", LogLevel::Unset),
        ("debug", LogLevel::Debug),
        ("info", LogLevel::Info),
        ("warn", LogLevel::Warn),
        ("error", LogLevel::Error),
        ("fatal", LogLevel::Fatal),
    ];
}

impl FromStr for LogLevel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::NAMES
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(text))
            .map(|(_, level)| *level)
            .ok_or_else(|| format!("`{}` is no log level", shown(text)))
    }
}

impl fmt::Display for LogLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES
            .iter()
            .find(|(_, level)| level == self)
            .map_or("", |(name, _)| name);
        f.write_str(name)
    }
}

/// `--log-level LEVEL` or `--log-level logger:=LEVEL`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLevelRule {
    /// The logger, or all of them.
    pub logger: Option<String>,
    /// Its new level.
    pub level: LogLevel,
}

impl FromStr for LogLevelRule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((logger, level)) = text.split_once(":=") else {
            return Ok(LogLevelRule {
                logger: None,
                level: text.parse()?,
            });
        };
        let known = |c: char| c.is_ascii_alphanumeric() || "_./:-".contains(c);
        if logger.is_empty() || !logger.chars().all(known) {
            return Err(format!("`{}` is no logger name", shown(logger)));
        }
        Ok(LogLevelRule {
            logger: Some(logger.to_owned()),
            level: level.parse()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_round_trip_in_any_case() {
        for (name, level) in LogLevel::NAMES {
            assert_eq!(level.to_string(), name);
            assert_eq!(name.to_uppercase().parse(), Ok(level));
        }
        assert!("trace".parse::<LogLevel>().is_err());
        assert!("".parse::<LogLevel>().is_err());
    }

    #[test]
    fn rules_name_a_logger_or_none() {
        let rule: LogLevelRule = "robot.mapper:=Debug".parse().unwrap();
        assert_eq!(rule.logger.as_deref(), Some("robot.mapper"));
        assert_eq!(rule.level, LogLevel::Debug);
        assert_eq!("warn".parse::<LogLevelRule>().unwrap().logger, None);
        for bad in [
            ":=info",
            "a b:=info",
            "mapper:=",
            "mapper:=loud",
            "a:=info:=warn",
        ] {
            assert!(bad.parse::<LogLevelRule>().is_err(), "{bad}");
        }
    }
}
