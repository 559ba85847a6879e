//! Logger levels changed at run time.

use std::io::Write;
use std::sync::{Arc, Mutex, OnceLock};

use env_logger::{Builder, Logger};
use log::LevelFilter;

use super::layout::Layout;
use super::plan::Plan;
use super::{now_ns, source};
use crate::sync::lock;

/// Limits of loggers with a level, and of the length of a name.
const MAX_SET: usize = 256;
const MAX_NAME_BYTES: usize = 255;

/// Console settings; a changed level creates a new logger from them.
pub(super) struct Console {
    plan: Plan,
    layout: Arc<Layout>,
    node_name: String,
}

/// Console settings of the process, and the active logger.
static CONSOLE: OnceLock<(Mutex<Console>, Shown)> = OnceLock::new();

/// The active logger.
pub(super) type Shown = Arc<Mutex<Arc<Logger>>>;

impl Console {
    pub(super) fn new(plan: Plan, layout: Arc<Layout>, node_name: &str) -> Self {
        Self {
            plan,
            layout,
            node_name: node_name.to_owned(),
        }
    }

    pub(super) fn build(&self) -> Logger {
        let (layout, name) = (Arc::clone(&self.layout), self.node_name.clone());
        let mut builder = Builder::new();
        self.plan.build(&mut builder, &self.node_name);
        let _ = builder
            .write_style(self.plan.style)
            .target(self.plan.target())
            .format(move |buffer, record| {
                let style = buffer.default_level_style(record.level());
                let line = layout.line(record, now_ns(), source(record.target(), &name));
                writeln!(buffer, "{style}{line}{style:#}")
            });
        builder.build()
    }

    /// Sets a level by its number; 0 removes it.
    fn set(&mut self, logger: &str, level: u32) -> Result<(), String> {
        let filter = match level {
            0 => None,
            10 => Some(LevelFilter::Debug),
            20 => Some(LevelFilter::Info),
            30 => Some(LevelFilter::Warn),
            40 | 50 => Some(LevelFilter::Error),
            other => {
                return Err(format!(
                    "level {other} is not one of 0, 10, 20, 30, 40 and 50"
                ));
            }
        };
        let set = &mut self.plan.set;
        let is_new = !set.contains_key(logger);
        match filter {
            None => drop(set.remove(logger)),
            Some(_) if logger.len() > MAX_NAME_BYTES || (is_new && set.len() >= MAX_SET) => {
                return Err(format!(
                    "a logger name exceeds {MAX_NAME_BYTES} bytes, or {MAX_SET} loggers have a level"
                ));
            }
            Some(filter) => drop(set.insert(logger.to_owned(), (level, filter))),
        }
        Ok(())
    }
}

pub(super) fn install(console: Console, shown: Shown) {
    // Set once: a process has one logger.
    let _ = CONSOLE.set((Mutex::new(console), shown));
}

/// Sets the level of a logger by its number in `rcl_interfaces/msg/LoggerLevel`. The empty name is the
/// root; level 0 removes the setting.
pub(crate) fn set_level(logger: &str, level: u32) -> Result<(), String> {
    let (console, shown) = CONSOLE.get().ok_or("logging is not initialized")?;
    let mut console = lock(console);
    console.set(logger, level)?;
    let logger = console.build();
    let most = logger.filter();
    *lock(shown) = Arc::new(logger);
    log::set_max_level(most);
    Ok(())
}

/// Level set for a logger; 0: none.
pub(crate) fn level(logger: &str) -> u32 {
    let console = CONSOLE.get().map(|(console, _)| lock(console));
    let set = console.and_then(|console| console.plan.set.get(logger).map(|(level, _)| *level));
    set.unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use log::{Level, Log, Metadata};

    use super::*;
    use crate::config::ros_args::RosArgs;

    #[test]
    fn levels_change_and_are_bounded() {
        let plan = Plan::new(&RosArgs::default(), "mapper", |_| None);
        let layout = Arc::new(Layout::new(&|_| None));
        let mut console = Console::new(plan, layout, "mapper");
        let shows = |console: &Console, level, target| {
            let record = Metadata::builder().level(level).target(target).build();
            console.build().enabled(&record)
        };
        let ours = "lattice_nodes::lattice_mapper";
        assert!(!shows(&console, Level::Debug, ours));
        console.set("robot.mapper", 10).unwrap();
        assert!(shows(&console, Level::Debug, ours));
        console.set("robot.mapper", 0).unwrap();
        assert!(!shows(&console, Level::Debug, ours));
        // One of several nodes of a process.
        console.set("lattice_mapper", 10).unwrap();
        assert!(
            shows(&console, Level::Debug, ours) && !shows(&console, Level::Debug, "lattice_core")
        );
        console.set("", 40).unwrap();
        assert!(!shows(&console, Level::Warn, "lattice_core"));
        assert!(
            shows(&console, Level::Debug, ours),
            "the longer name counts"
        );
        assert!(console.set("mapper", 15).is_err());
        assert!(console.set(&"x".repeat(256), 10).is_err());
        for i in 0..1000 {
            let set = console.set(&format!("l{i}"), 10);
            assert_eq!(set.is_ok(), i + 2 < MAX_SET, "{i}");
        }
        console.set("l0", 20).unwrap();
    }
}
