//! Signs that a participant of RustDDS no longer works.
//!
//! Its two threads end when a wait of theirs is interrupted (EINTR): after Ctrl-Z and `fg`, in a
//! debugger, after a suspended machine wakes up. A peer that was silent for longer than its lease and
//! comes back under the same identity is not matched again.

use std::collections::{BTreeSet, VecDeque};
use std::fs;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use rustdds::{DomainParticipantStatusEvent as Event, LostReason};

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

/// A peer is waited for so long. Then the participant is made anew, so that none is needed to hear it.
const SCOUT_TIME: Duration = Duration::from_secs(600);

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

/// Finds peers that time out and come back, and says when that is worth a renewal.
///
/// RustDDS takes the announcement of a peer that comes back for one it has had, and does not tell. A
/// second participant, made after the loss, hears it as new: a scout.
pub(super) struct Returns {
    /// Prefixes of GUIDs, each with the time of the loss.
    lost: VecDeque<([u8; 12], Instant)>,
    returned: bool,
    scout_made: Option<Instant>,
    /// True if a peer was lost since the scout was made.
    scout_is_stale: bool,
    pause: Duration,
    last: Option<Instant>,
}

impl Returns {
    pub(super) fn new() -> Self {
        Self {
            lost: VecDeque::new(),
            returned: false,
            scout_made: None,
            scout_is_stale: false,
            pause: FIRST_PAUSE,
            last: None,
        }
    }

    /// An event of the participant.
    pub(super) fn hear(&mut self, event: &Event) {
        if let Event::ParticipantLost {
            id,
            reason: LostReason::Timeout { .. },
        } = event
            && let Ok(peer) = id.as_ref().try_into()
        {
            self.lost(peer, Instant::now());
        }
    }

    /// An event of the scout.
    pub(super) fn hear_scout(&mut self, event: &Event) {
        match event {
            Event::ParticipantLost { .. } => self.scout_is_stale = true,
            Event::ParticipantDiscovered { dpd } => self.sighted(dpd.guid.prefix.as_ref()),
            _ => {}
        }
    }

    fn lost(&mut self, peer: [u8; 12], now: Instant) {
        if self.lost.len() >= MAX_LOST {
            self.lost.pop_front();
        }
        self.lost.push_back((peer, now));
        self.scout_is_stale = true;
    }

    fn sighted(&mut self, peer: &[u8]) {
        self.returned |= self.lost.iter().any(|(lost, _)| lost == peer);
    }

    /// True if the scout is to be made, or made anew.
    pub(super) fn scout_due(&mut self, now: Instant) -> bool {
        let young = |made| now.saturating_duration_since(made) < FIRST_PAUSE;
        let due = !self.lost.is_empty()
            && (self.scout_is_stale || self.scout_made.is_none())
            && !self.scout_made.is_some_and(young);
        if due {
            self.scout_made = Some(now);
            self.scout_is_stale = false;
        }
        due
    }

    /// True if the scout knows no peer that is away.
    pub(super) fn scout_is_fresh(&self) -> bool {
        !self.scout_is_stale
    }

    /// True if a peer is back, or one has been away for long, and the last renewal for that reason was
    /// long enough ago. Who flaps cannot keep us at it.
    pub(super) fn due(&mut self, now: Instant) -> bool {
        let quiet = self.last.map(|last| now.saturating_duration_since(last));
        let away = |lost: &([u8; 12], Instant)| now.saturating_duration_since(lost.1) > SCOUT_TIME;
        if !(self.returned || self.lost.front().is_some_and(away))
            || quiet.is_some_and(|quiet| quiet < self.pause)
        {
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
        self.scout_made = None;
        self.scout_is_stale = false;
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
    fn a_scout_is_younger_than_every_loss() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut returns = Returns::new();
        assert!(!returns.scout_due(start), "nobody is missed");
        returns.lost([1; 12], start);
        assert!(returns.scout_due(start) && returns.scout_is_fresh());
        returns.lost([2; 12], at(1));
        assert!(
            !returns.scout_is_fresh() && !returns.scout_due(at(4)),
            "too soon"
        );
        assert!(returns.scout_due(at(5)) && returns.scout_is_fresh());
        assert!(!returns.scout_due(at(100)));
    }

    #[test]
    fn who_flaps_is_answered_less_and_less() {
        let start = Instant::now();
        let mut returns = Returns::new();
        let mut due: Vec<u64> = Vec::new();
        for second in 0..300 {
            let now = start + Duration::from_secs(second);
            returns.lost([7; 12], now);
            returns.sighted(&[7; 12]);
            if returns.due(now) {
                due.push(second);
                returns.renewed();
            }
        }
        assert_eq!(due, [0, 5, 15, 35, 75, 135, 195, 255]);
        returns.renewed();
        returns.sighted(&[8; 12]);
        assert!(
            !returns.due(start + Duration::from_secs(1000)),
            "new, not back"
        );
    }
}
