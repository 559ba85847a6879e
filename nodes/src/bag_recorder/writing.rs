//! The thread that writes the bag.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use lattice_bag::{BagError, BagWriter};
use lattice_runtime::Shutdown;

use super::cache::{Cache, Item, Next};

/// Time after which what was written survives a killed process.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);

/// Messages and bytes that are in the bag.
#[derive(Default)]
pub(super) struct Written {
    pub messages: AtomicU64,
    pub bytes: AtomicU64,
}

/// Writes all that comes until the cache is closed. An error ends the recording.
pub(super) fn spawn(
    bag: BagWriter,
    cache: Arc<Cache>,
    written: Arc<Written>,
    shutdown: Shutdown,
) -> std::io::Result<JoinHandle<Result<(), BagError>>> {
    let thread = Builder::new().name("write bag".to_owned());
    thread.spawn(move || {
        let result = write(bag, &cache, &written);
        // Where it has failed nobody empties the cache any more.
        cache.close();
        shutdown.request();
        result
    })
}

fn write(mut bag: BagWriter, cache: &Cache, written: &Written) -> Result<(), BagError> {
    let mut flushed = Instant::now();
    // Nothing for a topic that no bag takes.
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
                let Some(topic) = places.get(topic).copied().flatten() else {
                    continue;
                };
                match bag.write(topic, log_time_ns, &data) {
                    // No CDR, which nobody could read.
                    Err(error @ BagError::Invalid { .. }) => log::warn!("left out: {error}"),
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
