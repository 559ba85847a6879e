//! Signs that a participant of RustDDS no longer works.
//!
//! Its two threads end when a wait of theirs is interrupted (EINTR): after Ctrl-Z and `fg`, in a
//! debugger, after a suspended machine wakes up. A peer that was silent for longer than its lease and
//! comes back under the same identity is not matched again.

use std::collections::{BTreeSet, VecDeque};
use std::fs;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use rustdds::{DomainParticipantStatusEvent as Event, GUID, LostReason};

use crate::sync::lock;

/// After a gap of this length between two looks, the process was stopped or the machine asleep, and
/// peers may have given us up.
const LONG_GAP: Duration = Duration::from_secs(8);

/// Peers that timed out and are remembered, at most.
const MAX_LOST: usize = 1024;

/// Pause after the first renewal because of a peer; each doubles it.
const FIRST_PAUSE: Duration = Duration::from_secs(5);

/// Longest pause, and the quiet time after which the first counts again.
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

/// Names of the threads of RustDDS begin with this.
const THREAD_NAME: &str = "RustDDS ";

/// Threads of a participant: its event loop and its discovery.
const THREADS: usize = 2;

/// The threads of one participant, by their numbers.
#[derive(Debug)]
pub(super) struct Threads(Vec<u32>);

impl Threads {
    /// Makes something that starts threads of RustDDS.
    pub(super) fn of<T>(make: impl FnOnce() -> T) -> (T, Self) {
        // Several participants of one process must not be taken for each other.
        static MAKING: Mutex<()> = Mutex::new(());
        let _making = lock(&MAKING);
        let before = all_threads();
        let made = make();
        let mut started: Vec<_> = all_threads().difference(&before).copied().collect();
        if started.len() != THREADS {
            log::debug!("threads of RustDDS are not watched: {started:?}");
            started.clear();
        }
        (made, Self(started))
    }

    /// False if one has ended.
    pub(super) fn all_run(&self) -> bool {
        self.0.iter().all(|thread| is_ours(*thread))
    }
}

fn all_threads() -> BTreeSet<u32> {
    let tasks = fs::read_dir("/proc/self/task").into_iter().flatten();
    let numbers = tasks.filter_map(|task| task.ok()?.file_name().to_str()?.parse().ok());
    numbers.filter(|thread| is_ours(*thread)).collect()
}

fn is_ours(thread: u32) -> bool {
    let name = fs::read_to_string(format!("/proc/self/task/{thread}/comm"));
    name.is_ok_and(|name| name.starts_with(THREAD_NAME))
}

/// Time since the machine was started, that of its sleep included.
fn since_boot() -> Option<Duration> {
    let text = fs::read_to_string("/proc/uptime").ok()?;
    let seconds = text.split_whitespace().next()?.parse().ok()?;
    Duration::try_from_secs_f64(seconds).ok()
}

/// Finds gaps between looks at the clock.
pub(super) struct Gap(Option<Duration>);

impl Gap {
    pub(super) fn new() -> Self {
        Self(since_boot())
    }

    /// The time since the last look, if it is too long.
    pub(super) fn look(&mut self) -> Option<Duration> {
        self.look_at(since_boot())
    }

    fn look_at(&mut self, now: Option<Duration>) -> Option<Duration> {
        let before = std::mem::replace(&mut self.0, now)?;
        let gap = now?.saturating_sub(before);
        (gap >= LONG_GAP).then_some(gap)
    }
}

/// What the endpoints of a participant have in common.
fn prefix(bytes: &[u8]) -> Option<[u8; 12]> {
    bytes.try_into().ok()
}

/// Finds peers that time out and come back, and says when that is worth a renewal.
pub(super) struct Returns {
    lost: VecDeque<[u8; 12]>,
    returned: bool,
    pause: Duration,
    last: Option<Instant>,
}

impl Returns {
    pub(super) fn new() -> Self {
        Self {
            lost: VecDeque::new(),
            returned: false,
            pause: FIRST_PAUSE,
            last: None,
        }
    }

    pub(super) fn hear(&mut self, event: &Event) {
        match event {
            Event::ParticipantLost {
                id,
                reason: LostReason::Timeout { .. },
            } => {
                if self.lost.len() >= MAX_LOST {
                    self.lost.pop_front();
                }
                self.lost.extend(prefix(id.as_ref()));
            }
            Event::ParticipantDiscovered { dpd } => self.found(dpd.guid),
            _ => {}
        }
    }

    fn found(&mut self, peer: GUID) {
        let before = self.lost.len();
        self.lost.retain(|lost| *lost != peer.prefix.as_ref());
        self.returned |= self.lost.len() < before;
    }

    /// True if a peer is back and the last renewal for that reason long enough ago. Who flaps cannot keep
    /// us at it.
    pub(super) fn due(&mut self, now: Instant) -> bool {
        let quiet = self.last.map(|last| now.saturating_duration_since(last));
        if !self.returned || quiet.is_some_and(|quiet| quiet < self.pause) {
            return false;
        }
        self.pause = match quiet {
            Some(quiet) if quiet < self.pause + LONGEST_PAUSE => {
                LONGEST_PAUSE.min(self.pause.saturating_mul(2))
            }
            _ => FIRST_PAUSE,
        };
        self.last = Some(now);
        true
    }

    /// All peers will be found anew.
    pub(super) fn renewed(&mut self) {
        self.lost.clear();
        self.returned = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_are_seen_to_end() {
        let (stop, stopped) = std::sync::mpsc::channel::<()>();
        let stopped = std::sync::Arc::new(Mutex::new(stopped));
        let (handles, threads) = Threads::of(|| {
            [0, 1].map(|_| {
                let stopped = std::sync::Arc::clone(&stopped);
                std::thread::Builder::new()
                    .name("RustDDS thread".to_owned())
                    .spawn(move || lock(&stopped).recv())
                    .unwrap()
            })
        });
        // Others may make participants meanwhile.
        if threads.0.len() == THREADS {
            assert!(threads.all_run());
        }
        drop(stop);
        for handle in handles {
            assert!(handle.join().unwrap().is_err());
        }
        assert!(threads.0.is_empty() || !threads.all_run());
    }

    #[test]
    fn a_long_gap_is_told_once() {
        let at = |seconds| Some(Duration::from_secs(seconds));
        let mut gap = Gap(at(100));
        assert_eq!(gap.look_at(at(101)), None);
        assert_eq!(gap.look_at(at(120)), at(19));
        assert_eq!(gap.look_at(at(121)), None);
        assert_eq!(gap.look_at(None), None);
    }

    #[test]
    fn who_flaps_is_answered_less_and_less() {
        let start = Instant::now();
        let mut returns = Returns::new();
        let mut due: Vec<u64> = Vec::new();
        for second in 0..300 {
            let peer = GUID::new_participant_guid();
            returns.lost.extend(prefix(peer.prefix.as_ref()));
            returns.found(peer);
            if returns.due(start + Duration::from_secs(second)) {
                due.push(second);
                returns.renewed();
            }
        }
        assert_eq!(due, [0, 5, 15, 35, 75, 135, 195, 255]);
        returns.renewed();
        returns.found(GUID::new_participant_guid());
        assert!(
            !returns.due(start + Duration::from_secs(1000)),
            "new, not back"
        );
    }
}
