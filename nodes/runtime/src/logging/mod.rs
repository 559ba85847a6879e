//! Logging in the format of rcutils: to the console, to a file, and to a sink for `/rosout`.

mod file;
mod layout;
mod levels;
mod plan;
mod record;
mod throttle;

pub(crate) use levels::{level, set_level};
pub use throttle::Throttle;

use crate::config::ros_args::RosArgs;
use crate::sync::lock;
use env_logger::Logger;
use file::LogFile;
use layout::Layout;
use levels::{Console, Shown};
use log::{Log, Metadata, Record, SetLoggerError};
use plan::Plan;
use record::{now_ns, source};
use std::{
    cell::Cell,
    sync::{Arc, Mutex, OnceLock},
};

/// Receives every record that passes the log level, with the name of its node.
pub type Sink = Box<dyn Fn(&Record<'_>, &str) + Send + Sync>;

static SINK: OnceLock<Sink> = OnceLock::new();

thread_local! {
    /// Set while the sink runs, so that it does not receive its own records.
    static IN_SINK: Cell<bool> = const { Cell::new(false) };
}

/// Initializes logging for a process whose node is `node_name`.
///
/// The level is that of `--log-level`, else `RUST_LOG`, else `info`. Prints the warnings of the command
/// line. Fails if a logger is installed already.
pub fn init(args: &RosArgs, node_name: &str) -> Result<(), SetLoggerError> {
    let lookup = |name: &str| std::env::var(name).ok();
    let layout = Arc::new(Layout::new(&lookup));
    let plan = Plan::new(args, node_name, lookup);
    let console = Console::new(plan, Arc::clone(&layout), node_name);
    let first = console.build();
    let level = first.filter();
    let shown = Arc::new(Mutex::new(Arc::new(first)));
    let file = match args.no_log_file {
        true => None,
        false => Some(LogFile::open(args.log_file_name.as_deref(), lookup)),
    };
    let (file, refused) = match file.transpose() {
        Ok(file) => (file, None),
        Err(problem) => (None, Some(problem)),
    };
    let logger = Tee {
        console: Arc::clone(&shown),
        to_console: !args.no_stdout_logs,
        layout,
        file,
        node_name: node_name.to_owned(),
    };
    log::set_boxed_logger(Box::new(logger))?;
    log::set_max_level(level);
    levels::install(console, shown);
    for warning in args.warnings.iter().chain(&refused) {
        log::warn!("{warning}");
    }
    Ok(())
}

/// Adds `sink` as a second output, for `/rosout`; false if one is set already.
pub fn tee(sink: Sink) -> bool {
    SINK.set(sink).is_ok()
}

struct Tee {
    /// Replaced when a level changes.
    console: Shown,
    to_console: bool,
    layout: Arc<Layout>,
    file: Option<LogFile>,
    node_name: String,
}

impl Log for Tee {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        self.console().enabled(metadata)
    }

    fn log(&self, record: &Record<'_>) {
        let console = self.console();
        if !console.matches(record) {
            return;
        }
        if self.to_console {
            console.log(record);
        }
        let source = source(record.target(), &self.node_name);
        if let Some(file) = &self.file {
            file.write(&self.layout.line(record, now_ns(), source));
        }
        if let Some(sink) = SINK.get()
            && !IN_SINK.replace(true)
        {
            sink(record, source);
            IN_SINK.set(false);
        }
    }

    fn flush(&self) {
        self.console().flush();
    }
}

impl Tee {
    fn console(&self) -> Arc<Logger> {
        Arc::clone(&lock(&self.console))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use env_logger::Builder;
    use log::Level;

    #[test]
    fn records_are_named_after_their_node() {
        assert_eq!(source("lattice_nodes::runtime", "front"), "front");
        assert_eq!(source("lattice_nodes", "front"), "front");
        assert_eq!(source("polling::epoll", "front"), "front");
        assert_eq!(source("lattice_mapper", "front"), "lattice_mapper");
    }

    #[test]
    fn the_sink_gets_what_passes_and_not_its_own_messages() {
        static TEE: OnceLock<Tee> = OnceLock::new();
        static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
        let console = Builder::new().filter_level(log::LevelFilter::Info).build();
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().display().to_string();
        let place = |name: &str| (name == "ROS_LOG_DIR").then(|| folder.clone());
        let log = TEE.get_or_init(|| Tee {
            console: Arc::new(Mutex::new(Arc::new(console))),
            to_console: false,
            layout: Arc::new(Layout::new(&|_| None)),
            file: Some(LogFile::open(Some("front"), place).unwrap()),
            node_name: "front".to_owned(),
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
        let written = std::fs::read_dir(directory.path()).unwrap().next().unwrap();
        let written = std::fs::read_to_string(written.unwrap().path()).unwrap();
        assert_eq!(written.lines().count(), 4, "{written}");
        assert!(written.contains("[front]: three"), "{written}");
        assert_eq!(*HEARD.lock().unwrap(), ["front: one", "front: three"]);
    }

    fn send(log: &Tee, level: Level, text: std::fmt::Arguments<'_>) {
        let mut record = Record::builder();
        record.level(level).target("lattice_nodes");
        log.log(&record.args(text).build());
    }
}
