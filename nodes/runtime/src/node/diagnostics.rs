//! Diagnostic status of the nodes' tasks, published on `/diagnostics` at 1 Hz.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::{Arc, Mutex};

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue};
use lattice_msgs::std_msgs::Header;

use crate::sync::lock;

/// Limit of tasks of all nodes in a process.
const MAX_TASKS: usize = 1000;

/// Key of the value that is `false` while a node cannot do its work. `lattice health` treats a warning with it
/// as an error.
pub const WORKING: &str = "working";

/// Level of a diagnostic status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Normal operation.
    Ok,
    /// Works, but needs attention.
    Warn,
    /// Does not work.
    Error,
    /// No recent status.
    Stale,
}

/// Diagnostic tasks of one node.
#[derive(Clone)]
pub struct Diagnostics {
    node: String,
    tasks: Arc<Tasks>,
    losses: Counts,
}

/// Current counters by name.
pub(crate) type Counts = Arc<dyn Fn() -> Vec<(String, u64)> + Send + Sync>;

/// Tasks of all nodes of a process, by node and task.
#[derive(Default)]
pub(crate) struct Tasks {
    states: Mutex<BTreeMap<(String, String), DiagnosticStatus>>,
}

impl Diagnostics {
    pub(crate) fn new(node: &str, tasks: &Arc<Tasks>, losses: Counts) -> Self {
        Self {
            node: node.to_owned(),
            tasks: Arc::clone(tasks),
            losses,
        }
    }

    /// Messages and requests lost in this process, by topic, as in the task `transport`.
    pub fn losses(&self) -> Vec<(String, u64)> {
        (self.losses)()
    }

    /// Sets the status of `task` with its values. It is repeated at 1 Hz until set again.
    ///
    /// A new task is ignored if the process has 1000 already.
    pub fn set<K: Display, V: Display>(
        &self,
        task: &str,
        level: Level,
        message: impl Into<String>,
        values: impl IntoIterator<Item = (K, V)>,
    ) {
        let status = status(&self.node, task, level, message, values);
        let mut states = lock(&self.tasks.states);
        let key = (self.node.clone(), task.to_owned());
        if states.len() < MAX_TASKS || states.contains_key(&key) {
            states.insert(key, status);
        }
    }

    /// Marks all tasks of an ended node as stale.
    pub(crate) fn end(&self) {
        let mut states = lock(&self.tasks.states);
        for (_, status) in states.iter_mut().filter(|(key, _)| key.0 == self.node) {
            status.level = DiagnosticStatus::STALE;
            status.message = "not at work".to_owned();
        }
    }
}

/// Status named `node: task`, as the ROS tools expect.
pub(crate) fn status<K: Display, V: Display>(
    node: &str,
    task: &str,
    level: Level,
    message: impl Into<String>,
    values: impl IntoIterator<Item = (K, V)>,
) -> DiagnosticStatus {
    let values = values.into_iter().map(|(key, value)| KeyValue {
        key: key.to_string(),
        value: value.to_string(),
    });
    DiagnosticStatus {
        level: match level {
            Level::Ok => DiagnosticStatus::OK,
            Level::Warn => DiagnosticStatus::WARN,
            Level::Error => DiagnosticStatus::ERROR,
            Level::Stale => DiagnosticStatus::STALE,
        },
        name: format!("{}: {task}", node.trim_start_matches('/')),
        message: message.into(),
        hardware_id: "lattice".to_owned(),
        values: values.collect(),
    }
}

impl Tasks {
    /// Message of all statuses, `extra` first.
    pub(crate) fn message(&self, stamp_ns: i64, extra: DiagnosticStatus) -> DiagnosticArray {
        let states = lock(&self.states);
        DiagnosticArray {
            header: Header {
                stamp: Time::from_ns(stamp_ns),
                ..Header::default()
            },
            status: std::iter::once(extra)
                .chain(states.values().cloned())
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_state_of_a_task_counts() {
        let tasks = Arc::new(Tasks::default());
        let diagnostics = Diagnostics::new("/robot/mapper", &tasks, Arc::new(Vec::new));
        diagnostics.set("map", Level::Error, "no clouds", [("clouds", 0)]);
        diagnostics.set("map", Level::Ok, "running", [("clouds", 7)]);
        let transport = status("/robot/mapper", "transport", Level::Warn, "x", [("a", "b")]);
        let message = tasks.message(1_500_000_000, transport);
        assert_eq!(message.header.stamp.to_ns(), 1_500_000_000);
        let names: Vec<_> = message.status.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["robot/mapper: transport", "robot/mapper: map"]);
        let map = &message.status[1];
        assert_eq!(
            (map.level, map.values[0].value.as_str()),
            (DiagnosticStatus::OK, "7")
        );
        diagnostics.end();
        let ended = &tasks
            .message(
                0,
                status("/robot/mapper", "transport", Level::Ok, "x", [("", "")]),
            )
            .status;
        assert_eq!(
            (ended[0].level, ended[1].level),
            (DiagnosticStatus::OK, DiagnosticStatus::STALE)
        );
    }
}
