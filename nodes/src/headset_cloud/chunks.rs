//! Surfaces whose chunks have not all come.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_msgs::headset::HeadsetMesh;

use super::refusal::{MeshRefusal, shown};
use super::session::MAX_DELAY_NS;

/// Times of a state of a surface, ns.
#[derive(Clone, Copy)]
pub(super) struct StateTime {
    /// By the clock of the headset.
    pub stamp_ns: i64,
    /// By the clock of the node.
    pub arrival_ns: i64,
}

impl StateTime {
    /// True if this state was overtaken by the one that is known. One that would have been on its way for longer than
    /// messages are has the stamp of a clock that was set back.
    pub(super) fn is_late(self, known: Self) -> bool {
        let older_ns = known.stamp_ns.saturating_sub(self.stamp_ns);
        let later_ns = self.arrival_ns.saturating_sub(known.arrival_ns);
        older_ns > 0 && older_ns.saturating_add(later_ns) <= MAX_DELAY_NS
    }
}

/// Chunks of a state of a surface.
struct Pending {
    /// Of the first chunk.
    time: StateTime,
    /// Surfaces that had begun before.
    number: u64,
    chunks: BTreeMap<u32, Arc<HeadsetMesh>>,
}

/// States of surfaces that wait for their chunks, in bounded memory.
#[derive(Default)]
pub(super) struct Chunks {
    pending: BTreeMap<String, Pending>,
    numbers: usize,
    begun: u64,
}

/// Numbers in the arrays of a chunk, and one for the chunk itself.
fn numbers(chunk: &HeadsetMesh) -> usize {
    1 + chunk.vertices.len() + chunk.triangles.len() + chunk.classes.len()
}

impl Chunks {
    /// Takes a chunk, and gives all of its state once they are there, in order.
    pub fn push(
        &mut self,
        chunk: Arc<HeadsetMesh>,
        time: StateTime,
    ) -> Result<Option<Vec<Arc<HeadsetMesh>>>, MeshRefusal> {
        let known = self.pending.get(&chunk.surface).map(|state| state.time);
        let surface = || shown(&chunk.surface);
        if known.is_some_and(|known| time.is_late(known)) {
            return Err(MeshRefusal::Stale { surface: surface() });
        }
        if known.is_some_and(|known| time.stamp_ns != known.stamp_ns) {
            self.remove(&chunk.surface);
        }
        let of = self.pending.entry(chunk.surface.clone());
        let begun = &mut self.begun;
        let pending = of.or_insert_with(|| {
            *begun += 1;
            Pending {
                time,
                number: *begun,
                chunks: BTreeMap::new(),
            }
        });
        if let Some(first) = pending.chunks.values().next()
            && (first.chunks != chunk.chunks || first.pose != chunk.pose)
        {
            return Err(MeshRefusal::Malformed {
                surface: surface(),
                problem: "pose and number of chunks are not those of its other chunks",
            });
        }
        if pending.chunks.contains_key(&chunk.chunk) {
            let (surface, chunk) = (surface(), chunk.chunk);
            return Err(MeshRefusal::Repeated { surface, chunk });
        }
        self.numbers += numbers(&chunk);
        pending.chunks.insert(chunk.chunk, Arc::clone(&chunk));
        let is_whole = pending.chunks.len() as u64 == u64::from(chunk.chunks);
        let all = is_whole.then(|| self.remove(&chunk.surface));
        Ok(all.map(|chunks| chunks.into_values().collect()))
    }

    /// Forgets the surfaces that have waited longest until these bounds hold; gives how many.
    pub fn bound(&mut self, max_surfaces: usize, max_numbers: usize) -> u64 {
        let mut gone = 0;
        while self.pending.len() > max_surfaces || self.numbers > max_numbers {
            let oldest = self.pending.iter().min_by_key(|(_, state)| state.number);
            let Some(oldest) = oldest.map(|(surface, _)| surface.clone()) else {
                break;
            };
            self.remove(&oldest);
            gone += 1;
        }
        gone
    }

    /// Forgets what waits of a surface.
    pub fn remove(&mut self, surface: &str) -> BTreeMap<u32, Arc<HeadsetMesh>> {
        let gone = self.pending.remove(surface);
        let chunks = gone.map(|gone| gone.chunks).unwrap_or_default();
        let gone = chunks.values().map(|chunk| numbers(chunk)).sum();
        self.numbers = self.numbers.saturating_sub(gone);
        chunks
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Surfaces that wait.
    pub fn len(&self) -> usize {
        self.pending.len()
    }
}
