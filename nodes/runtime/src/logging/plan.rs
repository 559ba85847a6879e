use crate::ros_args::{LogLevel, RosArgs};
use env_logger::WriteStyle;
use log::LevelFilter;

/// Our own crates; their targets begin with it.
const OURS: &str = "lattice_";
/// Libraries whose chatter would hide ours: silent unless named by `--log-level` or `RUST_LOG`, and
/// warnings only with `--log-level debug`. RustDDS warns of every datagram on loopback; what
/// matters of it is in our own log and diagnostics.
const CHATTY: [&str; 7] = [
    "rustdds",
    "ros2_client",
    "mio",
    "polling",
    "async_io",
    "async_std",
    "cdr_encoding",
];

/// Settings of the console log, from the arguments and the environment.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Target and level; the longest target that fits counts, and of equal ones the last.
    pub filters: Vec<(Option<String>, LevelFilter)>,
    /// `RUST_LOG`, where no `--log-level` is given.
    pub rust_log: Option<String>,
    /// `RCUTILS_COLORIZED_OUTPUT`: 1 always, 0 never, else on a terminal.
    pub style: WriteStyle,
}

impl Plan {
    pub(super) fn new(
        args: &RosArgs,
        node_name: &str,
        lookup: impl Fn(&str) -> Option<String>,
    ) -> Plan {
        let mut filters = vec![(None, LevelFilter::Info)];
        filters.extend(CHATTY.map(|name| (Some(name.to_owned()), LevelFilter::Off)));
        for rule in &args.log_levels {
            let level = filter(rule.level);
            match rule.logger.as_deref() {
                None => {
                    filters.push((None, level));
                    let chatty = match level {
                        LevelFilter::Debug | LevelFilter::Trace => LevelFilter::Warn,
                        _ => LevelFilter::Off,
                    };
                    filters.extend(CHATTY.map(|name| (Some(name.to_owned()), chatty)));
                }
                Some(logger) => {
                    let node = logger.rsplit(['.', '/']).next().unwrap_or(logger);
                    if node == node_name {
                        filters.push((Some(OURS.to_owned()), level));
                    }
                    filters.push((Some(node.to_owned()), level));
                }
            }
        }
        let rust_log = lookup("RUST_LOG").filter(|_| args.log_levels.is_empty());
        let style = match lookup("RCUTILS_COLORIZED_OUTPUT").as_deref() {
            Some("1") => WriteStyle::Always,
            Some("0") => WriteStyle::Never,
            _ => WriteStyle::Auto,
        };
        Plan {
            filters,
            rust_log,
            style,
        }
    }
}

fn filter(level: LogLevel) -> LevelFilter {
    match level {
        LogLevel::Debug => LevelFilter::Debug,
        LogLevel::Unset | LogLevel::Info => LevelFilter::Info,
        LogLevel::Warn => LevelFilter::Warn,
        LogLevel::Error | LogLevel::Fatal => LevelFilter::Error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use log::{Level, Log, Metadata};

    /// True if a plan lets a record through, by env_logger's own rules.
    fn shows(rules: &[&str], rust_log: Option<&str>, level: Level, target: &str) -> bool {
        let log_levels = rules.iter().map(|rule| rule.parse().unwrap()).collect();
        let args = RosArgs {
            log_levels,
            ..RosArgs::default()
        };
        let lookup = |name: &str| {
            (name == "RUST_LOG")
                .then(|| rust_log.map(str::to_owned))
                .flatten()
        };
        let plan = Plan::new(&args, "mapper", lookup);
        let mut builder = env_logger::Builder::new();
        for (target, level) in &plan.filters {
            builder.filter(target.as_deref(), *level);
        }
        if let Some(text) = &plan.rust_log {
            builder.parse_filters(text);
        }
        builder
            .build()
            .enabled(&Metadata::builder().level(level).target(target).build())
    }

    #[test]
    fn info_is_the_default_and_libraries_are_silent() {
        assert!(shows(&[], None, Level::Info, "lattice_nodes::runtime"));
        assert!(!shows(&[], None, Level::Debug, "lattice_nodes::runtime"));
        assert!(!shows(&[], None, Level::Info, "rustdds::network"));
        assert!(!shows(&[], None, Level::Error, "rustdds::network"));
        assert!(shows(&["debug"], None, Level::Warn, "rustdds::network"));
    }

    #[test]
    fn the_last_level_wins() {
        assert!(shows(
            &["warn", "debug"],
            None,
            Level::Debug,
            "lattice_nodes"
        ));
        assert!(!shows(
            &["debug", "warn"],
            None,
            Level::Info,
            "lattice_nodes"
        ));
        assert!(!shows(&["fatal"], None, Level::Warn, "rustdds"));
        assert!(!shows(&["debug"], None, Level::Info, "rustdds"));
        assert!(shows(
            &["warn", "unset"],
            None,
            Level::Info,
            "lattice_nodes"
        ));
    }

    #[test]
    fn a_logger_can_be_named() {
        assert!(shows(
            &["mapper:=debug"],
            None,
            Level::Debug,
            "lattice_nodes::mapper"
        ));
        assert!(shows(
            &["robot.mapper:=debug"],
            None,
            Level::Debug,
            "mapper"
        ));
        assert!(!shows(
            &["other:=debug"],
            None,
            Level::Debug,
            "lattice_nodes::mapper"
        ));
        assert!(shows(
            &["rustdds:=debug"],
            None,
            Level::Debug,
            "rustdds::network"
        ));
    }

    #[test]
    fn rust_log_counts_without_log_level() {
        assert!(shows(
            &[],
            Some("lattice_nodes=debug"),
            Level::Debug,
            "lattice_nodes"
        ));
        assert!(!shows(
            &["info"],
            Some("debug"),
            Level::Debug,
            "lattice_nodes"
        ));
    }

    #[test]
    fn colours_follow_rcutils() {
        for (value, style) in [
            (Some("1"), WriteStyle::Always),
            (Some("0"), WriteStyle::Never),
            (None, WriteStyle::Auto),
        ] {
            let lookup = |name: &str| {
                (name == "RCUTILS_COLORIZED_OUTPUT")
                    .then(|| value.map(str::to_owned))
                    .flatten()
            };
            assert_eq!(
                Plan::new(&RosArgs::default(), "mapper", lookup).style,
                style
            );
        }
    }
}
