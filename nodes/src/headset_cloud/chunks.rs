//! Assembly of surfaces from chunks.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_msgs::lattice::HeadsetMesh;

use super::refusal::{MeshRefusal, shown};
use super::session::MAX_DELAY_NS;

/// Stamps of a surface state, ns.
#[derive(Clone, Copy)]
pub(super) struct StateTime {
    /// Stamp by the headset's clock.
    pub stamp_ns: i64,
    /// Arrival by the node's clock.
    pub arrival_ns: i64,
}

impl StateTime {
    /// True if a newer state has overtaken this one. An older stamp beyond the longest message delay
    /// means a clock that was set back.
    pub(super) fn is_late(self, known: Self) -> bool {
        let older_ns = known.stamp_ns.saturating_sub(self.stamp_ns);
        let later_ns = self.arrival_ns.saturating_sub(known.arrival_ns);
        older_ns > 0 && older_ns.saturating_add(later_ns) <= MAX_DELAY_NS
    }
}

/// Chunks of an incomplete surface state.
struct Pending {
    /// Times of the first chunk.
    time: StateTime,
    /// Sequence number of the surface.
    number: u64,
    chunks: BTreeMap<u32, Arc<HeadsetMesh>>,
}

/// Incomplete surface states, in bounded memory.
#[derive(Default)]
pub(super) struct Chunks {
    pending: BTreeMap<String, Pending>,
    numbers: usize,
    begun: u64,
}

/// Memory cost of a chunk: numbers in its arrays, plus one.
fn numbers(chunk: &HeadsetMesh) -> usize {
    1 + chunk.vertices.len() + chunk.triangles.len() + chunk.classes.len()
}

impl Chunks {
    /// Adds a chunk; returns all chunks of its state in order once they are complete.
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
                problem: "pose or number of chunks differs from its other chunks",
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

    /// Drops the oldest incomplete surfaces until the bounds are met; returns their number.
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

    /// Drops the chunks of a surface.
    pub fn remove(&mut self, surface: &str) -> BTreeMap<u32, Arc<HeadsetMesh>> {
        let gone = self.pending.remove(surface);
        let chunks = gone.map(|gone| gone.chunks).unwrap_or_default();
        let gone = chunks.values().map(|chunk| numbers(chunk)).sum();
        self.numbers = self.numbers.saturating_sub(gone);
        chunks
    }

    /// Drops all chunks.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Number of incomplete surfaces.
    pub fn len(&self) -> usize {
        self.pending.len()
    }
}
