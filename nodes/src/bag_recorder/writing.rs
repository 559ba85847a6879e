//! Thread that writes the bag.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use lattice_bag::{BagError, BagWriter};
use lattice_runtime::{Shutdown, lock};

use super::cache::{Cache, Item, Next};

/// Flush period: messages older than this survive a killed process.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);

/// Messages and bytes written.
#[derive(Default)]
pub(super) struct Written {
    pub messages: AtomicU64,
    pub bytes: AtomicU64,
    /// Messages of each topic that are not representable in a bag.
    pub refused: Mutex<BTreeMap<usize, u64>>,
}

impl Written {
    fn refuse(&self, topic: usize) {
        *lock(&self.refused).entry(topic).or_default() += 1;
    }
}

/// Writes all items until the cache is closed. An error ends the recording.
pub(super) fn spawn(
    bag: BagWriter,
    cache: Arc<Cache>,
    written: Arc<Written>,
    shutdown: Shutdown,
) -> std::io::Result<JoinHandle<Result<(), BagError>>> {
    let thread = Builder::new().name("write bag".to_owned());
    thread.spawn(move || {
        let result = write(bag, &cache, &written);
        // After a failure nothing empties the cache.
        cache.close();
        shutdown.request();
        result
    })
}

fn write(mut bag: BagWriter, cache: &Cache, written: &Written) -> Result<(), BagError> {
    let mut flushed = Instant::now();
    // `None` for a topic that cannot be recorded.
    let mut places: Vec<Option<usize>> = Vec::new();
    let mut is_dirty = false;
    loop {
        match cache.next(FLUSH_PERIOD) {
            Next::Item(Item::Topic(topic)) => places.push(match bag.add_topic(topic) {
                Err(error @ BagError::Invalid { .. }) => {
                    log::warn!("not recorded: {error}");
                    None
                }
                added => Some(added?),
            }),
            Next::Item(Item::Message {
                topic,
                log_time_ns,
                data,
            }) => {
                let Some(place) = places.get(topic).copied().flatten() else {
                    written.refuse(topic);
                    continue;
                };
                match bag.write(place, log_time_ns, &data) {
                    // Not CDR, so not readable.
                    Err(error @ BagError::Invalid { .. }) => {
                        log::warn!("message not recorded: {error}");
                        written.refuse(topic);
                    }
                    wrote => {
                        wrote?;
                        written.messages.fetch_add(1, Relaxed);
                        written.bytes.fetch_add(data.len() as u64, Relaxed);
                    }
                }
                is_dirty = true;
            }
            Next::Item(Item::Split) => bag.split()?,
            Next::Nothing => {}
            Next::End => return bag.finish(),
        }
        if is_dirty && flushed.elapsed() >= FLUSH_PERIOD {
            bag.flush()?;
            (flushed, is_dirty) = (Instant::now(), false);
        }
    }
}

#[cfg(test)]
mod tests {
    use lattice_bag::{Storage, TopicSpec, WriterOptions};

    use super::*;

    #[test]
    fn messages_that_no_bag_can_hold_are_not_written_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let options = WriterOptions::default();
        let bag = BagWriter::create(&folder.path().join("bag"), Storage::Mcap, options).unwrap();
        let (cache, written) = (Arc::new(Cache::new(1000)), Arc::new(Written::default()));
        let topic = |name: &str| {
            Item::Topic(TopicSpec {
                name: name.to_owned(),
                type_name: "std_msgs/msg/Empty".to_owned(),
                type_hash: String::new(),
                definition: None,
                offered_qos: Vec::new(),
            })
        };
        let message = |topic, bytes: usize| Item::Message {
            topic,
            log_time_ns: 7,
            data: [&[0, 1, 0, 0][..], &[0; 8]].concat()[..bytes].to_vec(),
        };
        // A name that no topic has; then a sound topic with a message that is no CDR.
        for item in [topic("/good"), topic("bad name"), message(0, 12)] {
            cache.push(item);
        }
        for item in [
            message(1, 12),
            message(1, 12),
            message(0, 2),
            message(0, 12),
        ] {
            cache.push(item);
        }
        cache.close();
        let thread = spawn(bag, cache, Arc::clone(&written), Shutdown::default()).unwrap();
        thread.join().unwrap().unwrap();
        assert_eq!(*lock(&written.refused), BTreeMap::from([(0, 1), (1, 2)]));
        assert_eq!(written.messages.load(Relaxed), 2);
    }
}
