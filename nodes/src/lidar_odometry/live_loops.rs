//! Loop closure of a running odometry, on a thread of its own because a registration takes seconds.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use std::{io, thread};

use crossbeam_channel::{Receiver, Sender, bounded};
use lattice_core::loop_closure::{LoopCloser, Segment};
use lattice_core::odometry::Verdict;
use lattice_runtime::lock;
use nalgebra::{Isometry3, Vector3};

use super::machine::Registered;
use crate::convert::corrections::PlacedCorrections;

/// Capacity of the queue of segments: hundreds of metres of path.
const QUEUE: usize = 64;

/// Segment with the number of its drive.
type Work = (u32, Segment);

/// Loops and corrections of the drive so far.
#[derive(Clone, Debug, Default)]
pub(super) struct LoopState {
    drive: u32,
    /// Version, incremented by each change.
    pub version: u64,
    pub corrections: PlacedCorrections,
    /// Positions of both ends of each closed loop, metres, map frame.
    pub lines_m: Vec<[Vector3<f64>; 2]>,
    pub refused: u64,
    /// Begun submaps: number, end of the last scan before, time of the first point, ns.
    begun: Vec<(u32, i64, i64)>,
    /// End of the newest scan with a certain pose, ns.
    end_ns: i64,
}

impl LoopState {
    /// Begins the submap of a scan with verdict `OK`, unless it has begun.
    fn on_scan(&mut self, submap: u32, begin_ns: i64, end_ns: i64) {
        let before_ns = std::mem::replace(&mut self.end_ns, end_ns);
        let anchors = self.corrections.corrections.anchors();
        if anchors.last().is_some_and(|last| last.submap >= submap) {
            return;
        }
        if anchors.is_empty() {
            self.corrections.placed.insert(submap);
        }
        self.begun.push((submap, before_ns, begin_ns));
        let corrections = &mut self.corrections.corrections;
        corrections.begin_submap(submap, before_ns, begin_ns);
        self.version += 1;
    }
}

/// Loops of a running odometry.
pub(super) struct LiveLoops {
    state: Arc<Mutex<LoopState>>,
    work: Sender<Work>,
    /// Number of segments dropped because the queue was full.
    pub segments_queue_full: u64,
}

impl LiveLoops {
    /// Starts the thread; `on_change` is called after each segment. The thread ends when this is dropped.
    pub fn start(on_change: impl Fn() + Send + Sync + 'static) -> io::Result<Self> {
        let (work, queue) = bounded(QUEUE);
        let state: Arc<Mutex<LoopState>> = Arc::default();
        // The cores belong to the odometry.
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "loops".to_owned())
            .build()
            .map_err(io::Error::other)?;
        let shared = Arc::clone(&state);
        let seek = move || pool.install(|| seek(&queue, &shared, &on_change));
        thread::Builder::new()
            .name("loops queue".to_owned())
            .spawn(seek)?;
        Ok(Self {
            state,
            work,
            segments_queue_full: 0,
        })
    }

    /// Handles a registered scan: queues its segment, if any, for loop closure, and begins its submap.
    pub fn on_scan(&mut self, found: &Registered) {
        let (drive, result) = (found.drive, &found.result);
        if let Some(segment) = &found.segment {
            let sent = self.work.try_send((drive, segment.clone()));
            self.segments_queue_full += u64::from(sent.is_err());
        }
        let mut state = lock(&self.state);
        if state.drive != drive {
            *state = LoopState {
                drive,
                version: state.version + 1,
                ..LoopState::default()
            };
        }
        if result.verdict == Verdict::Ok {
            state.on_scan(result.submap, result.first_ns, result.end_ns);
        }
    }

    /// Current state, if its version differs from `version`.
    pub fn newer_than(&self, version: u64) -> Option<LoopState> {
        let state = lock(&self.state);
        (state.version != version).then(|| state.clone())
    }

    /// Pose of the odometry frame in the map (`map_from_odom`). Submaps without a known pose have that of the submap
    /// before.
    pub fn map_from_odom(&self, stamp_ns: i64) -> Isometry3<f64> {
        let anchor = lock(&self.state).corrections.corrections.at(stamp_ns);
        anchor.map_or_else(Isometry3::identity, |anchor| anchor.map_from_odom)
    }

    /// True if the pose of a submap in the map is known.
    pub fn is_placed(&self, submap: u32) -> bool {
        lock(&self.state).corrections.placed.contains(&submap)
    }

    /// Numbers of closed and of rejected loops.
    pub fn counts(&self) -> [u64; 2] {
        let state = lock(&self.state);
        [state.lines_m.len() as u64, state.refused]
    }
}

/// Searches for loops until the queue ends.
fn seek(queue: &Receiver<Work>, state: &Mutex<LoopState>, on_change: &dyn Fn()) {
    let (mut closer, mut drive) = (LoopCloser::default(), 0);
    for (of_drive, segment) in queue {
        if of_drive != drive {
            (closer, drive) = (LoopCloser::default(), of_drive);
        }
        if let Err(error) = closer.add(segment) {
            log::debug!("no loop is sought: {error}");
            continue;
        }
        renew(&mut lock(state), &closer, drive);
        on_change();
    }
}

/// Updates the state to the segments of a closer.
fn renew(state: &mut LoopState, closer: &LoopCloser, drive: u32) {
    if state.drive != drive {
        return;
    }
    let mut corrections = closer.corrections();
    let Some((first, last)) = corrections
        .anchors()
        .first()
        .zip(corrections.anchors().last())
    else {
        return;
    };
    let (first, last) = (first.submap, last.submap);
    // Submaps that begin after the last segment.
    for (submap, end_ns, begin_ns) in &state.begun {
        if *submap > last {
            corrections.begin_submap(*submap, *end_ns, *begin_ns);
        }
    }
    let placed: BTreeSet<u32> = closer.joined_with(first);
    let closed = (closer.attempts().iter()).filter(|attempt| attempt.is_closed);
    let place = |number: usize| {
        let pose = closer.map_from_anchors().get(number);
        pose.map_or_else(Vector3::zeros, |pose| pose.translation.vector)
    };
    state.lines_m = closed
        .map(|attempt| [attempt.from, attempt.to].map(place))
        .collect();
    state.refused = (closer.attempts().len() - state.lines_m.len()) as u64;
    state.corrections = PlacedCorrections {
        corrections,
        placed,
    };
    state.version += 1;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_submap_begins_without_a_place_in_the_middle_of_the_pause() {
        let mut state = LoopState::default();
        for end_ns in [1000, 1100] {
            state.on_scan(0, end_ns - 100, end_ns);
        }
        let first = state.corrections.clone();
        assert_eq!((first.corrections.anchors().len(), state.version), (1, 1));
        assert!(first.map_from_odom(5000).is_some());
        state.on_scan(1, 2900, 3000);
        let lost = &state.corrections;
        assert!(lost.map_from_odom(1999).is_some() && lost.map_from_odom(2000).is_none());
        assert_eq!(state.version, 2);
    }
}
