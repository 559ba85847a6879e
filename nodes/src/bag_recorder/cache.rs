//! Queue, bounded in bytes, between the receiving threads and the writing one.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex};
use std::time::Duration;

use lattice_bag::TopicSpec;
use lattice_runtime::lock;

/// Item to be written.
pub(super) enum Item {
    /// The next topic; indices count from 0.
    Topic(TopicSpec),
    Message {
        topic: usize,
        log_time_ns: i64,
        data: Vec<u8>,
    },
    /// Starts a new storage file.
    Split,
}

impl Item {
    fn bytes(&self) -> usize {
        match self {
            Item::Message { data, .. } => data.len(),
            _ => 0,
        }
    }
}

/// Result of waiting for an item.
pub(super) enum Next {
    Item(Item),
    Nothing,
    /// The queue is closed and empty.
    End,
}

/// The queue. Items that do not fit are dropped and counted.
pub(super) struct Cache {
    max_bytes: usize,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    items: VecDeque<Item>,
    bytes: usize,
    /// Dropped messages of each topic.
    lost: Vec<u64>,
    closed: bool,
}

impl Cache {
    pub(super) fn new(max_bytes: usize) -> Self {
        Self {
            max_bytes,
            state: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    /// Adds an item; a message only if it fits. A single message always fits an empty queue.
    pub(super) fn push(&self, item: Item) {
        let mut state = lock(&self.state);
        let bytes = item.bytes();
        let full = state.bytes > 0 && state.bytes.saturating_add(bytes) > self.max_bytes;
        if let Item::Message { topic, .. } = item
            && (full || state.closed)
        {
            if state.lost.len() <= topic {
                state.lost.resize(topic + 1, 0);
            }
            if let Some(lost) = state.lost.get_mut(topic) {
                *lost += 1;
            }
            return;
        }
        state.bytes = state.bytes.saturating_add(bytes);
        state.items.push_back(item);
        drop(state);
        self.changed.notify_one();
    }

    /// Waits up to `patience` for the next item.
    pub(super) fn next(&self, patience: Duration) -> Next {
        let waits = |state: &mut State| state.items.is_empty() && !state.closed;
        let waited = self
            .changed
            .wait_timeout_while(lock(&self.state), patience, waits);
        let (mut state, _) = waited.unwrap_or_else(|poisoned| poisoned.into_inner());
        match state.items.pop_front() {
            Some(item) => {
                state.bytes = state.bytes.saturating_sub(item.bytes());
                Next::Item(item)
            }
            None if state.closed => Next::End,
            None => Next::Nothing,
        }
    }

    /// Rejects further messages; queued ones can still be taken.
    pub(super) fn close(&self) {
        lock(&self.state).closed = true;
        self.changed.notify_all();
    }

    /// Dropped messages of a topic.
    pub(super) fn lost(&self, topic: usize) -> u64 {
        lock(&self.state).lost.get(topic).copied().unwrap_or(0)
    }

    /// Dropped messages.
    pub(super) fn all_lost(&self) -> u64 {
        lock(&self.state).lost.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(topic: usize, bytes: usize) -> Item {
        Item::Message {
            topic,
            log_time_ns: 0,
            data: vec![0; bytes],
        }
    }

    fn next(cache: &Cache) -> Option<usize> {
        match cache.next(Duration::ZERO) {
            Next::Item(item) => Some(item.bytes()),
            _ => None,
        }
    }

    #[test]
    fn what_does_not_fit_is_counted_and_what_is_there_comes_in_order() {
        let cache = Cache::new(100);
        for (topic, bytes) in [(0, 60), (1, 41), (1, 40), (0, 1), (1, 500)] {
            cache.push(message(topic, bytes));
        }
        cache.push(Item::Split);
        assert_eq!([cache.lost(0), cache.lost(1), cache.all_lost()], [1, 2, 3]);
        assert_eq!(
            [next(&cache), next(&cache), next(&cache)],
            [Some(60), Some(40), Some(0)]
        );
        assert!(next(&cache).is_none());
        cache.push(message(2, 500));
        assert_eq!(
            next(&cache),
            Some(500),
            "one finds room where nothing else is"
        );
    }

    #[test]
    fn a_closed_cache_gives_what_it_has_and_ends() {
        let cache = Cache::new(100);
        cache.push(message(0, 1));
        cache.close();
        cache.push(message(0, 1));
        assert_eq!((next(&cache), cache.lost(0)), (Some(1), 1));
        assert!(matches!(cache.next(Duration::MAX), Next::End));
    }
}
