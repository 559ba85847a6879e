//! Marks of one scan, whose rays are followed by all threads.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::masks::{Mask, ScanMasks};
use super::packed::Packed;
use super::rays::{Ends, Rays};
use super::scan::{RayBundle, Reach, ScanReport};
use super::surface::{Probe, Surfaces};
use super::traversal::{Outside, Traversal};
use crate::lattice::Lattice;
use crate::voxels::VoxelStore;

/// Number of rays that are worth a thread: they take a millisecond, and waking it some 10 us.
const RAYS_OF_PART: usize = 1024;
/// Smallest memory of a part, bytes: masks of 160 blocks.
const BYTES_OF_PART: usize = 1 << 16;

/// Cells that one scan hits and traverses, and the voxels of a store that it passes through.
///
/// The marks are the same for any number of threads: each has masks of its own, which are united. If one of them has
/// not enough memory, a single thread follows all rays.
#[derive(Clone, Debug)]
pub(super) struct Marks {
    all: Part,
    parts: Vec<Part>,
    /// Memory of all parts.
    parts_bytes: MarkBytes,
}

/// Limits of memory, bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct MarkBytes {
    pub(super) masks: usize,
    pub(super) surfaces: usize,
}

impl MarkBytes {
    fn over(self, parts: usize) -> MarkBytes {
        MarkBytes {
            masks: self.masks / parts,
            surfaces: self.surfaces / parts,
        }
    }
}

/// Marks of all rays, or of those of one thread.
#[derive(Clone, Debug)]
struct Part {
    masks: ScanMasks,
    surfaces: Surfaces,
}

impl Part {
    fn new(lattice: &Lattice, bytes: MarkBytes) -> Part {
        Part {
            masks: ScanMasks::new(bytes.masks / ScanMasks::BYTES_PER_BLOCK),
            surfaces: Surfaces::new(lattice, bytes.surfaces),
        }
    }

    /// Follows rays; the hits are marked in `hits`, or in the part itself. Returns the number of visits.
    fn follow<'a>(
        &mut self,
        rays: impl Iterator<Item = (&'a Rays<'a>, [&'a [Packed]; 2])>,
        hits: Option<&ScanMasks>,
        store: Option<&dyn VoxelStore>,
    ) -> u64 {
        let (masks, surfaces) = (&mut self.masks, &mut self.surfaces);
        surfaces.clear();
        let mut probe = store.map(|store| Probe::new(surfaces, store));
        rays.map(|(rays, ends)| rays.follow_all(masks, hits, ends, &mut probe))
            .sum()
    }

    fn is_complete(&self) -> bool {
        self.masks.refusals() == 0 && !self.surfaces.was_full()
    }

    fn bytes(&self) -> usize {
        self.masks.bytes() + self.surfaces.bytes()
    }
}

impl Marks {
    /// Creates marks within limits of memory; half of it is for the parts of threads, if that is enough for two.
    pub(super) fn new(lattice: &Lattice, bytes: MarkBytes) -> Marks {
        let half = bytes.over(2);
        let none = MarkBytes {
            masks: 0,
            surfaces: 0,
        };
        let (all, parts_bytes) = match half.masks >= 2 * BYTES_OF_PART {
            true => (half, half),
            false => (bytes, none),
        };
        Marks {
            all: Part::new(lattice, all),
            parts: Vec::new(),
            parts_bytes,
        }
    }

    pub(super) fn bytes(&self) -> usize {
        let parts: usize = self.parts.iter().map(Part::bytes).sum();
        self.all.bytes() + parts
    }

    pub(super) fn masks(&self) -> &ScanMasks {
        &self.all.masks
    }

    /// Voxels of the store that the last scan passed through, each once, in no order.
    pub(super) fn passed(&self) -> &[Packed] {
        self.all.surfaces.passed()
    }

    /// Voxels of a store that the last scan traversed and did not hit.
    pub(super) fn traversed_voxels(&self, store: &dyn VoxelStore) -> Vec<Packed> {
        let mut traversed = Vec::new();
        for (block, passed, hit) in self.masks().blocks() {
            let missed = passed.without(hit);
            let voxels = Mask::of_voxels(store, block).and(&missed);
            traversed.extend(voxels.places().map(|place| Packed::at(block, place)));
        }
        traversed
    }

    /// Takes the marks of traversed voxels back that no ray passed through; returns their number.
    pub(super) fn spare_voxels(&mut self, store: &dyn VoxelStore) -> usize {
        let traversed = self.traversed_voxels(store);
        let Part { masks, surfaces } = &mut self.all;
        traversed.iter().for_each(|cell| masks.spare(*cell));
        for cell in surfaces.passed() {
            masks.pass(*cell);
        }
        traversed.len() - surfaces.passed().len()
    }

    /// Marks cells as hit, in place of those of a scan.
    pub(super) fn set_hits(&mut self, cells: impl Iterator<Item = Packed>) {
        self.all.masks.clear();
        for cell in cells {
            self.all.masks.hit(cell);
        }
    }

    /// Marks the cells that a scan hits and traverses, and finds the voxels of `store` that it passes through.
    ///
    /// Rays go to the lattice points of their end cells, so the marks do not depend on the order of the points of a
    /// bundle. A cell hit by several bundles has a ray of the first.
    pub(super) fn mark(
        &mut self,
        traversal: &Traversal,
        datum_m: &Vector3<f64>,
        scan: &[RayBundle<'_>],
        reach: Reach,
        store: Option<&dyn VoxelStore>,
    ) -> ScanReport {
        self.all.masks.clear();
        let mut report = ScanReport::default();
        let mut bundles = Vec::with_capacity(scan.len());
        for bundle in scan {
            let points = bundle.ends.len() as u64;
            report.points += points;
            match Rays::new(traversal, datum_m, bundle, reach) {
                Err(Outside::NotFinite) => report.not_finite += points,
                Err(Outside::OutOfRange) => report.out_of_range += points,
                Ok(rays) => bundles.push(rays),
            }
        }
        let masks = &mut self.all.masks;
        let ends = |rays: &Rays| rays.ends(masks, &mut report);
        let mut ends: Vec<Ends> = bundles.iter().map(ends).collect();
        for ends in &mut ends {
            // One ray serves both.
            ends.open.retain(|cell| !masks.is_hit(*cell));
        }
        let visits = self.follow_in_parts(&bundles, &ends, store);
        report.visits = visits.unwrap_or_else(|| self.follow_all(&bundles, &ends, store));
        let masks = &mut self.all.masks;
        if masks.refusals() > 0 {
            // The choice of refused blocks must not depend on the order of the points: repeat with complete, sorted ends.
            masks.clear();
            for (rays, ends) in bundles.iter().zip(&mut ends) {
                ends.hits = rays.all_hits();
                ends.hits.retain(|cell| masks.hit(*cell));
                ends.open.sort_unstable();
            }
            report.visits = self.follow_all(&bundles, &ends, store);
        }
        report.hits = ends.iter().map(|ends| ends.hits.len() as u64).sum();
        report.rays = ends.iter().map(|ends| ends.len() as u64).sum();
        report.entries_refused = self.all.masks.refusals();
        report
    }

    /// Follows all rays by one thread; returns the number of visits.
    fn follow_all(
        &mut self,
        bundles: &[Rays],
        ends: &[Ends],
        store: Option<&dyn VoxelStore>,
    ) -> u64 {
        let ends = ends.iter().map(|ends| ends.part(0, 1));
        self.all.follow(bundles.iter().zip(ends), None, store)
    }

    /// Follows the rays by several threads; returns the number of visits, or `None` if there are too few rays or not
    /// enough memory.
    fn follow_in_parts(
        &mut self,
        bundles: &[Rays],
        ends: &[Ends],
        store: Option<&dyn VoxelStore>,
    ) -> Option<u64> {
        let rays: usize = ends.iter().map(Ends::len).sum();
        let threads = rayon::current_num_threads().min(self.parts_bytes.masks / BYTES_OF_PART);
        let count = threads.min(rays / RAYS_OF_PART);
        let lattice = &bundles.first()?.traversal.lattice;
        if count < 2 {
            return None;
        }
        if self.parts.len() != threads {
            let part = Part::new(lattice, self.parts_bytes.over(threads));
            self.parts = vec![part; threads];
        }
        let parts = self.parts.get_mut(..count)?;
        let hits = &self.all.masks;
        let follow = |(i, part): (usize, &mut Part)| {
            part.masks.clear();
            let ends = ends.iter().map(|ends| ends.part(i, count));
            part.follow(bundles.iter().zip(ends), Some(hits), store)
        };
        let visits = parts.par_iter_mut().enumerate().map(follow).sum();
        if !parts.iter().all(Part::is_complete) {
            return None;
        }
        self.all.surfaces.clear();
        for part in parts {
            self.all.masks.unite(&part.masks);
            self.all.surfaces.unite(&part.surfaces);
        }
        Some(visits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::lattice::LatticeKind;
    use crate::voxels::VoxelList;

    /// Points of a shell about the origin, and of some walls within it.
    fn cloud(points: u32, radius_m: f64) -> Cloud {
        let at = |i: u32| {
            let up = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(points);
            let (flat, turn) = ((1.0 - up * up).sqrt(), 2.399_963 * f64::from(i));
            let radius_m = if i.is_multiple_of(7) {
                0.4 * radius_m
            } else {
                radius_m
            };
            Vector3::new(flat * turn.cos(), flat * turn.sin(), up) * radius_m
        };
        let points: Vec<Vector3<f64>> = (0..points).map(at).collect();
        Cloud::from_points(0, Vector3::zeros(), &points)
    }

    type Marked = (ScanReport, Vec<(u64, Mask, Mask)>, Vec<Packed>, usize);

    fn marked(threads: usize, kind: LatticeKind, bytes: MarkBytes) -> Marked {
        let lattice = Lattice::new(kind, 0.05).unwrap();
        let mut store = VoxelList::new(lattice.clone(), Vector3::zeros(), 1 << 20).unwrap();
        store.insert(&cloud(20_000, 5.0));
        let (traversal, ends) = (Traversal::new(&lattice), cloud(9_000, 12.0));
        let origin_m = Vector3::new(0.2, -0.1, 0.05);
        let scan = [RayBundle {
            origin_m,
            ends: &ends,
        }];
        let reach = Reach {
            max_range_m: 11.0,
            ..Reach::default()
        };
        let mut marks = Marks::new(&lattice, bytes);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut report = ScanReport::default();
            for _ in 0..2 {
                let datum_m = Vector3::zeros();
                report = marks.mark(&traversal, &datum_m, &scan, reach, Some(&store));
            }
            let blocks = marks.masks().blocks();
            let mut blocks: Vec<_> = blocks.map(|(b, passed, hit)| (b, *passed, *hit)).collect();
            blocks.sort_unstable_by_key(|(block, ..)| *block);
            let mut passed = marks.passed().to_vec();
            passed.sort_unstable();
            (report, blocks, passed, marks.parts.len())
        })
    }

    #[test]
    fn threads_find_what_one_finds() {
        let (masks, surfaces) = (1 << 26, 1 << 24);
        for kind in [LatticeKind::Cubic, LatticeKind::Fcc, LatticeKind::Mcc] {
            let one = marked(1, kind, MarkBytes { masks, surfaces });
            assert!(one.0.rays > 4_000 && one.2.len() > 100, "{:?}", one.0);
            assert_eq!(one.3, 0);
            for threads in [2, 3] {
                let several = marked(threads, kind, MarkBytes { masks, surfaces });
                assert_eq!(several.3, threads);
                assert_eq!(
                    (several.0, several.1, several.2),
                    (one.0, one.1.clone(), one.2.clone())
                );
            }
        }
    }

    #[test]
    fn threads_without_memory_leave_all_rays_to_one() {
        let kind = LatticeKind::Fcc;
        let whole = marked(
            1,
            kind,
            MarkBytes {
                masks: 1 << 26,
                surfaces: 1 << 24,
            },
        );
        for bytes in [
            MarkBytes {
                masks: 1 << 18,
                surfaces: 1 << 24,
            },
            MarkBytes {
                masks: 1 << 26,
                surfaces: 1 << 16,
            },
        ] {
            let one = marked(1, kind, bytes);
            assert!((&one.1, &one.2) != (&whole.1, &whole.2));
            let several = marked(2, kind, bytes);
            assert_eq!(several.3, 2);
            assert_eq!((several.0, several.1, several.2), (one.0, one.1, one.2));
        }
    }
}
