//! The console log in the form of rcutils, and a tap for `/rosout`.

mod plan;
mod throttle;

pub use throttle::Throttle;

use crate::ros_args::RosArgs;
use env_logger::{Builder, Logger};
use log::{Level, Log, Metadata, Record, SetLoggerError};
use plan::Plan;
use std::{
    cell::Cell,
    io::Write,
    sync::OnceLock,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

/// Takes every record that passes the log level; the text is the name of the node it is from.
pub type Sink = Box<dyn Fn(&Record<'_>, &str) + Send + Sync>;

/// Between two errors of RustDDS that are shown.
const RUSTDDS_PERIOD: Duration = Duration::from_secs(2);

static SINK: OnceLock<Sink> = OnceLock::new();

thread_local! {
    /// Set while the sink runs, so that what it logs does not come back to it.
    static IN_SINK: Cell<bool> = const { Cell::new(false) };
}

/// Starts logging to the console for a process whose node is `node_name`.
///
/// `--log-level` decides what is shown, without it `RUST_LOG`, without both `info`. Prints the
/// warnings of the command line. Fails if a logger is there already.
pub fn init(args: &RosArgs, node_name: &str) -> Result<(), SetLoggerError> {
    let plan = Plan::new(args, node_name, |name| std::env::var(name).ok());
    let mut builder = Builder::new();
    for (target, level) in &plan.filters {
        let _ = builder.filter(target.as_deref(), *level);
    }
    if let Some(text) = &plan.rust_log {
        let _ = builder.parse_filters(text);
    }
    let name = node_name.to_owned();
    let _ = builder
        .write_style(plan.style)
        .format(move |buffer, record| {
            let style = buffer.default_level_style(record.level());
            let now = SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .unwrap_or_default();
            let line = line(record, now.as_nanos(), source(record.target(), &name));
            writeln!(buffer, "{style}{line}{style:#}")
        });
    let console = builder.build();
    let level = console.filter();
    let logger = Tee {
        console,
        to_console: !args.no_stdout_logs,
        node_name: node_name.to_owned(),
        rustdds: Throttle::new(RUSTDDS_PERIOD),
    };
    log::set_boxed_logger(Box::new(logger))?;
    log::set_max_level(level);
    for warning in &args.warnings {
        log::warn!("{warning}");
    }
    Ok(())
}

/// Also gives the log to `sink`, for `/rosout`; false if there is one already.
pub fn tee(sink: Sink) -> bool {
    SINK.set(sink).is_ok()
}

struct Tee {
    console: Logger,
    to_console: bool,
    node_name: String,
    rustdds: Throttle,
}

impl Log for Tee {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        self.console.enabled(metadata)
    }

    fn log(&self, record: &Record<'_>) {
        if !self.console.matches(record) {
            return;
        }
        if self.is_flood(record) {
            return;
        }
        if self.to_console {
            self.console.log(record);
        }
        if let Some(sink) = SINK.get()
            && !IN_SINK.replace(true)
        {
            sink(record, source(record.target(), &self.node_name));
            IN_SINK.set(false);
        }
    }

    fn flush(&self) {
        self.console.flush();
    }
}

impl Tee {
    /// True for an error of RustDDS soon after another, unless its warnings are asked for too.
    fn is_flood(&self, record: &Record<'_>) -> bool {
        let target = record.target();
        let warning = Metadata::builder()
            .level(Level::Warn)
            .target(target)
            .build();
        if !target.starts_with(plan::RUSTDDS) || self.console.enabled(&warning) {
            return false;
        }
        match self.rustdds.check() {
            Some(more @ 1..) => log::warn!("{more} more errors of {}", plan::RUSTDDS),
            Some(0) => {}
            None => return true,
        }
        false
    }
}

/// The node of a record: the process's, unless the record has a target that is no module path.
fn source<'a>(target: &'a str, node_name: &'a str) -> &'a str {
    const LIBRARIES: [&str; 3] = ["lattice_core", "lattice_msgs", "lattice_nodes"];
    if target.contains("::") || LIBRARIES.contains(&target) {
        node_name
    } else {
        target
    }
}

/// `[INFO] [seconds.nanoseconds] [node]: text`, as rcutils prints it.
fn line(record: &Record<'_>, now_ns: u128, source: &str) -> String {
    let (seconds, nanoseconds) = (now_ns / 1_000_000_000, now_ns % 1_000_000_000);
    format!(
        "[{}] [{seconds}.{nanoseconds:09}] [{source}]: {}",
        record.level(),
        record.args()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn lines_look_like_those_of_rcutils() {
        let text = format_args!("no points for 5 s");
        let record = Record::builder().level(Level::Warn).args(text).build();
        let text = line(&record, 1_700_000_000_000_000_042, "mapper");
        let expected = "[WARN] [1700000000.000000042] [mapper]: no points for 5 s";
        assert_eq!(text, expected);
    }

    #[test]
    fn records_are_named_after_their_node() {
        assert_eq!(source("lattice_nodes::runtime", "front"), "front");
        assert_eq!(source("lattice_nodes", "front"), "front");
        assert_eq!(source("rustdds::network", "front"), "front");
        assert_eq!(source("lattice_mapper", "front"), "lattice_mapper");
    }

    #[test]
    fn the_sink_gets_what_passes_and_not_its_own_messages() {
        static TEE: OnceLock<Tee> = OnceLock::new();
        static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
        let console = Builder::new()
            .filter_level(log::LevelFilter::Info)
            .filter_module("rustdds", log::LevelFilter::Error)
            .build();
        let log = TEE.get_or_init(|| Tee {
            console,
            to_console: false,
            node_name: "front".to_owned(),
            rustdds: Throttle::new(RUSTDDS_PERIOD),
        });
        let heard = |record: &Record<'_>, node: &str| {
            let line = format!("{node}: {}", record.args());
            HEARD.lock().unwrap().push(line);
            send(
                TEE.get().unwrap(),
                Level::Error,
                format_args!("from the sink"),
            );
        };
        assert!(tee(Box::new(heard)));
        assert!(!tee(Box::new(|_, _| {})), "there is one already");
        send(log, Level::Info, format_args!("one"));
        send(log, Level::Debug, format_args!("two"));
        send(log, Level::Warn, format_args!("three"));
        let error = Record::builder()
            .level(Level::Error)
            .target("rustdds::discovery")
            .build();
        assert!(!log.is_flood(&error));
        assert!(log.is_flood(&error), "the second at once");
        assert_eq!(*HEARD.lock().unwrap(), ["front: one", "front: three"]);
    }

    fn send(log: &Tee, level: Level, text: std::fmt::Arguments<'_>) {
        let mut record = Record::builder();
        record.level(level).target("lattice_nodes");
        log.log(&record.args(text).build());
    }
}
