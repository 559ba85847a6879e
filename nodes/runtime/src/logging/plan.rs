use crate::config::ros_args::RosArgs;
use std::collections::BTreeMap;

use env_logger::{Builder, Target, WriteStyle};
use log::LevelFilter;

/// Prefix of the targets of our crates.
const OURS: &str = "lattice_";
/// Verbose libraries: off unless named by `--log-level` or `RUST_LOG`; warnings only with
/// `--log-level debug`.
const CHATTY: [&str; 2] = ["polling", "async_io"];

/// Console log settings, from the arguments and the environment.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Target and level. The longest matching target applies; of equal ones the last.
    pub filters: Vec<(Option<String>, LevelFilter)>,
    /// `RUST_LOG`, if no `--log-level` is given.
    pub rust_log: Option<String>,
    /// Levels set at run time by logger name; they override all others.
    pub set: BTreeMap<String, (u32, LevelFilter)>,
    /// `RCUTILS_COLORIZED_OUTPUT`: 1 always, 0 never, else on a terminal.
    pub style: WriteStyle,
    /// `RCUTILS_LOGGING_USE_STDOUT`: 1 standard output, else standard error.
    pub to_stdout: bool,
}

impl Plan {
    pub(super) fn new(
        args: &RosArgs,
        node_name: &str,
        lookup: impl Fn(&str) -> Option<String>,
    ) -> Plan {
        let mut filters = vec![(None, LevelFilter::Info)];
        filters.extend(libraries(LevelFilter::Info));
        for rule in &args.log_levels {
            let level = rule.level;
            match rule.logger.as_deref() {
                None => {
                    filters.push((None, level));
                    filters.extend(libraries(level));
                }
                Some(logger) => filters.extend(targets(logger, level, node_name)),
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
            set: BTreeMap::new(),
            style,
            to_stdout: lookup("RCUTILS_LOGGING_USE_STDOUT").as_deref() == Some("1"),
        }
    }

    /// Output of the console log.
    pub(super) fn target(&self) -> Target {
        match self.to_stdout {
            true => Target::Stdout,
            false => Target::Stderr,
        }
    }

    /// Adds all levels to a builder.
    pub(super) fn build(&self, builder: &mut Builder, node_name: &str) {
        for (target, level) in &self.filters {
            let _ = builder.filter(target.as_deref(), *level);
        }
        if let Some(text) = &self.rust_log {
            let _ = builder.parse_filters(text);
        }
        for (logger, (_, level)) in &self.set {
            for (target, level) in targets(logger, *level, node_name) {
                let _ = builder.filter(target.as_deref(), level);
            }
        }
    }
}

/// Targets of a logger; the empty name is the root.
fn targets(
    logger: &str,
    level: LevelFilter,
    node_name: &str,
) -> Vec<(Option<String>, LevelFilter)> {
    if logger.is_empty() {
        let all = [(None, level)].into_iter().chain(libraries(level));
        return all.collect();
    }
    let node = logger.rsplit(['.', '/']).next().unwrap_or(logger);
    // Modules of one node in a process of several use the node's name.
    let mut targets = vec![node.to_owned(), format!("{OURS}nodes::{node}")];
    if node == node_name {
        targets.push(OURS.to_owned());
    }
    let targets = targets.into_iter();
    targets.map(|target| (Some(target), level)).collect()
}

/// Library levels for our level `level`.
fn libraries(level: LevelFilter) -> impl Iterator<Item = (Option<String>, LevelFilter)> {
    let chatty_level = match level {
        LevelFilter::Debug | LevelFilter::Trace => LevelFilter::Warn,
        _ => LevelFilter::Off,
    };
    let all = CHATTY.into_iter();
    all.map(move |name| (Some(name.to_owned()), chatty_level))
}

#[cfg(test)]
mod tests {
    use super::*;
    use log::{Level, Log, Metadata};

    /// A plan by the rules of `--log-level` and one variable of the environment.
    fn plan(rules: &str, variable: (&str, &str)) -> Plan {
        let rules = rules.split_whitespace().map(|rule| rule.parse().unwrap());
        let args = RosArgs {
            log_levels: rules.collect(),
            ..RosArgs::default()
        };
        let lookup = |name: &str| (name == variable.0).then(|| variable.1.to_owned());
        Plan::new(&args, "mapper", lookup)
    }

    /// True if a plan lets a record through, by env_logger's own rules.
    fn shows(plan: &Plan, level: Level, target: &str) -> bool {
        let mut builder = env_logger::Builder::new();
        plan.build(&mut builder, "mapper");
        let record = Metadata::builder().level(level).target(target).build();
        builder.build().enabled(&record)
    }

    #[test]
    fn the_last_level_of_a_logger_counts_and_libraries_are_silent() {
        use Level::{Debug, Error, Info, Warn};
        for (rules, level, target, shown) in [
            ("", Info, "lattice_nodes::runtime", true),
            ("", Debug, "lattice_nodes::runtime", false),
            ("", Error, "polling::epoll", false),
            ("debug", Warn, "polling::epoll", true),
            ("debug", Info, "polling::epoll", false),
            ("warn debug", Debug, "lattice_nodes", true),
            ("debug warn", Info, "lattice_nodes", false),
            ("warn unset", Info, "lattice_nodes", true),
            ("mapper:=debug", Debug, "lattice_nodes::mapper", true),
            ("robot.mapper:=debug", Debug, "mapper", true),
            ("other:=debug", Debug, "lattice_nodes::mapper", false),
            ("polling:=debug", Debug, "polling::epoll", true),
        ] {
            let found = shows(&plan(rules, ("", "")), level, target);
            assert_eq!(found, shown, "{rules}: {level} of {target}");
        }
    }

    #[test]
    fn rust_log_counts_without_log_level() {
        let by = |rules, text| {
            shows(
                &plan(rules, ("RUST_LOG", text)),
                Level::Debug,
                "lattice_nodes",
            )
        };
        assert!(by("", "lattice_nodes=debug") && !by("info", "debug"));
    }

    #[test]
    fn colours_follow_rcutils() {
        let style = |value| plan("", ("RCUTILS_COLORIZED_OUTPUT", value)).style;
        let found = ["1", "0", ""].map(style);
        assert_eq!(
            found,
            [WriteStyle::Always, WriteStyle::Never, WriteStyle::Auto]
        );
    }
}
