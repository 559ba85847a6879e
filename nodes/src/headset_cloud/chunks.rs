//! Surfaces whose chunks have not all come.

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_msgs::headset::HeadsetMesh;

use super::refusal::{MeshRefusal, shown};

/// Chunks of a state of a surface.
struct Pending {
    stamp_ns: i64,
    chunks: BTreeMap<u32, Arc<HeadsetMesh>>,
}

/// States of surfaces that wait for their chunks, in bounded memory.
#[derive(Default)]
pub(super) struct Chunks {
    pending: BTreeMap<String, Pending>,
    numbers: usize,
}

/// Longest that messages overtake each other. A state that seems to be older yet comes of a clock that was set, or
/// the one before had a stamp of the future.
const OVERTAKEN_NS: i64 = 60_000_000_000;

/// True if a state was overtaken by the one that is known.
pub(super) fn is_late(stamp_ns: i64, known_ns: i64) -> bool {
    let late_ns = known_ns.saturating_sub(stamp_ns);
    (1..=OVERTAKEN_NS).contains(&late_ns)
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
    ) -> Result<Option<Vec<Arc<HeadsetMesh>>>, MeshRefusal> {
        let stamp_ns = chunk.header.stamp.to_ns();
        let known = self.pending.get(&chunk.surface).map(|state| state.stamp_ns);
        let surface = || shown(&chunk.surface);
        if known.is_some_and(|known_ns| is_late(stamp_ns, known_ns)) {
            return Err(MeshRefusal::Stale { surface: surface() });
        }
        if known.is_some_and(|known_ns| stamp_ns != known_ns) {
            self.remove(&chunk.surface);
        }
        let of = self.pending.entry(chunk.surface.clone());
        let pending = of.or_insert_with(|| Pending {
            stamp_ns,
            chunks: BTreeMap::new(),
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

    /// Forgets the surfaces that wait longest until these bounds hold; gives how many.
    pub fn bound(&mut self, max_surfaces: usize, max_numbers: usize) -> u64 {
        let mut gone = 0;
        while self.pending.len() > max_surfaces || self.numbers > max_numbers {
            let oldest = self.pending.iter().min_by_key(|(_, state)| state.stamp_ns);
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
