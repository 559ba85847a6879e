//! Publication of the process's log on `/rosout`.

use std::sync::{Mutex, Weak};
use std::time::{SystemTime, UNIX_EPOCH};

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::rcl_interfaces::Log;
use log::{Level, Record};
use smol::channel::{Receiver, Sender, bounded};

use crate::communication::publisher::Publisher;
use crate::logging;
use crate::sync::lock;

/// Queue length for records; the oldest are dropped.
const QUEUE_RECORDS: usize = 512;

/// Longest published text, bytes.
const MAX_TEXT_BYTES: usize = 16 << 10;

/// Runtimes of this process that publish the log.
static LISTENERS: Mutex<Vec<Weak<Listener>>> = Mutex::new(Vec::new());

/// Subscription to the log; dropping it ends it.
pub(crate) struct Listener {
    sender: Sender<Log>,
}

/// Subscribes to the log; returns the queue for [`publish`].
pub(crate) fn listen() -> (std::sync::Arc<Listener>, Receiver<Log>) {
    let (sender, receiver) = bounded(QUEUE_RECORDS);
    let listener = std::sync::Arc::new(Listener { sender });
    lock(&LISTENERS).push(std::sync::Arc::downgrade(&listener));
    // False for all but the first runtime of the process: one sink serves all.
    logging::tee(Box::new(hear));
    (listener, receiver)
}

/// Publishes records until the task is dropped.
///
/// Records may be logged on any thread, under any lock: publishers are only used here.
pub(crate) async fn publish(records: Receiver<Log>, publisher: Publisher<Log>) {
    while let Ok(record) = records.recv().await {
        // Logging a publication error here would recurse.
        let _ = publisher.publish(record);
    }
}

fn hear(record: &Record<'_>, node: &str) {
    // Formatting the record may log; the lock must be free then.
    let listeners: Vec<_> = {
        let mut listeners = lock(&LISTENERS);
        listeners.retain(|listener| listener.strong_count() > 0);
        listeners.iter().filter_map(Weak::upgrade).collect()
    };
    if listeners.is_empty() {
        return;
    }
    let message = message(record, node);
    for listener in listeners {
        let _ = listener.sender.force_send(message.clone());
    }
}

fn message(record: &Record<'_>, node: &str) -> Log {
    let elapsed = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let mut msg = record.args().to_string();
    msg.truncate(msg.floor_char_boundary(MAX_TEXT_BYTES));
    Log {
        stamp: Time::from_ns(i64::try_from(elapsed.as_nanos()).unwrap_or(i64::MAX)),
        level: match record.level() {
            Level::Error => Log::ERROR,
            Level::Warn => Log::WARN,
            Level::Info => Log::INFO,
            Level::Debug | Level::Trace => Log::DEBUG,
        },
        name: node.to_owned(),
        msg,
        file: record.file().unwrap_or_default().to_owned(),
        function: record.module_path().unwrap_or_default().to_owned(),
        line: record.line().unwrap_or(0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_become_messages_and_long_ones_are_cut() {
        let long = "ä".repeat(MAX_TEXT_BYTES);
        let mut record = Record::builder();
        record.level(Level::Warn).line(Some(7));
        let heard = message(&record.args(format_args!("{long}")).build(), "mapper");
        assert_eq!((heard.level, heard.line), (Log::WARN, 7));
        assert_eq!(heard.name, "mapper");
        assert_eq!(heard.msg.len(), MAX_TEXT_BYTES);
        assert!(heard.stamp.to_ns() > 0);
    }

    #[test]
    fn the_oldest_record_gives_way_and_a_listener_that_went_is_forgotten() {
        const NAME: &str = "a test of rosout";
        let (listener, receiver) = listen();
        for i in 0..=QUEUE_RECORDS {
            hear(&Record::builder().args(format_args!("{i}")).build(), NAME);
        }
        let logs = std::iter::from_fn(|| receiver.try_recv().ok());
        let logs = logs.filter(|log| log.name == NAME);
        let texts: Vec<_> = logs.map(|log| log.msg).collect();
        assert_eq!(texts.last(), Some(&QUEUE_RECORDS.to_string()));
        assert!(!texts.contains(&"0".to_owned()));
        drop(listener);
        let nobody = format_args!("nobody");
        hear(&Record::builder().args(nobody).build(), NAME);
        assert!(receiver.is_closed());
    }
}
