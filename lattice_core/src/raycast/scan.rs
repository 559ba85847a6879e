//! Rays of a scan: one per cell that they end in.

use nalgebra::Vector3;
use rustc_hash::FxHashSet;

use super::families::{Families, Origin, Ray};
use super::masks::ScanMasks;
use super::packed::Packed;
use super::steps::{Line, Place, Visit, step_all};
use super::surface::Probe;
use super::traversal::{Kernel, Outside, Traversal};
use crate::cloud::Cloud;
use crate::lattice::Simd;

/// Points seen from one position, in the map frame; a scan is one or more of these.
#[derive(Clone, Copy, Debug)]
pub struct RayBundle<'a> {
    /// Sensor position, map frame, metres.
    pub origin_m: Vector3<f64>,
    /// End points of the rays.
    pub ends: &'a Cloud,
}

/// Numbers of points, rays and cells of a scan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ScanReport {
    /// Number of points in the scan.
    pub points: u64,
    /// Points with a NaN or infinite coordinate; all points of a bundle if its origin has one.
    pub not_finite: u64,
    /// Points out of the range of keys; all points of a bundle if its origin is.
    pub out_of_range: u64,
    /// Points beyond the range limit, whose rays were followed up to it.
    pub beyond_max_range: u64,
    /// Cells that were hit.
    pub hits: u64,
    /// Rays that were followed: one per end cell.
    pub rays: u64,
    /// Cells traversed, counted for each ray.
    pub visits: u64,
    /// Cells traversed and not hit, each counted once.
    pub misses: u64,
    /// New blocks of 512 cells refused for lack of memory.
    pub blocks_refused: u64,
    /// Cells of rays and ends that lie in blocks without memory during the scan, counted for each ray.
    pub entries_refused: u64,
}

/// Range of the rays.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reach {
    /// Range limit, metres: rays of farther points end there without a hit; `INFINITY` for no limit.
    pub max_range_m: f64,
    /// Last part of each ray that clears nothing, metres: rays that graze a surface traverse the cells before the one
    /// that they end in.
    pub keep_m: f64,
    /// Last part of each ray that clears nothing, as a fraction 0 to 1; the longer of the two applies.
    ///
    /// Ground seen at a grazing angle from a height is traversed, within its own cells, over a length that grows with
    /// the distance.
    pub keep_ratio: f64,
}

impl Default for Reach {
    fn default() -> Reach {
        Reach {
            max_range_m: f64::INFINITY,
            keep_m: 0.0,
            keep_ratio: 0.0,
        }
    }
}

/// End cells of rays, each once.
pub(super) struct Ends {
    hits: Vec<Packed>,
    /// Cells in which the range limit ends rays.
    open: Vec<Packed>,
}

/// Marks the cells that a scan hits and traverses, and shows `probe` the voxels that it traverses and does not hit.
///
/// Rays go to the lattice points of their end cells, so the marks do not depend on the order of the points of a
/// bundle. A cell hit by several bundles has a ray of the first.
pub(super) fn mark(
    traversal: &Traversal,
    masks: &mut ScanMasks,
    datum_m: &Vector3<f64>,
    scan: &[RayBundle<'_>],
    reach: Reach,
    probe: Option<Probe<'_>>,
) -> ScanReport {
    masks.clear();
    let mut report = ScanReport::default();
    let mut bundles = Vec::with_capacity(scan.len());
    for bundle in scan {
        let points = bundle.ends.len() as u64;
        report.points += points;
        let origin_m = bundle.origin_m - datum_m;
        match traversal.cell_of(&origin_m) {
            Err(Outside::NotFinite) => report.not_finite += points,
            Err(Outside::OutOfRange) => report.out_of_range += points,
            Ok(start) => bundles.push(Rays {
                traversal,
                origin_m,
                start,
                base_m: bundle.ends.datum_m - datum_m,
                points: bundle.ends,
                reach,
            }),
        }
    }
    mark_bundles(&bundles, masks, probe, &mut report);
    report
}

fn mark_bundles(
    bundles: &[Rays],
    masks: &mut ScanMasks,
    mut probe: Option<Probe<'_>>,
    report: &mut ScanReport,
) {
    let ends = |rays: &Rays| rays.ends(masks, report);
    let mut ends: Vec<Ends> = bundles.iter().map(ends).collect();
    for ends in &mut ends {
        // One ray serves both.
        ends.open.retain(|cell| !masks.is_hit(*cell));
    }
    let mut follow = |masks: &mut ScanMasks, ends: &[Ends]| -> u64 {
        if let Some(probe) = &mut probe {
            probe.clear();
        }
        let pairs = bundles.iter().zip(ends);
        pairs
            .map(|(rays, ends)| rays.follow_all(masks, ends, &mut probe))
            .sum()
    };
    report.visits = follow(masks, &ends);
    if masks.refusals() > 0 {
        // The choice of refused blocks must not depend on the order of the points: repeat with complete, sorted ends.
        masks.clear();
        for (rays, ends) in bundles.iter().zip(&mut ends) {
            ends.hits = rays.all_hits();
            ends.hits.retain(|cell| masks.hit(*cell));
            ends.open.sort_unstable();
        }
        report.visits = follow(masks, &ends);
    }
    report.hits = ends.iter().map(|ends| ends.hits.len() as u64).sum();
    report.rays = report.hits + ends.iter().map(|ends| ends.open.len() as u64).sum::<u64>();
    report.entries_refused = masks.refusals();
}

/// Rays of one bundle, in metres from lattice point 0.
struct Rays<'a> {
    traversal: &'a Traversal,
    origin_m: Vector3<f64>,
    start: Packed,
    base_m: Vector3<f64>,
    points: &'a Cloud,
    reach: Reach,
}

impl Rays<'_> {
    fn ends(&self, masks: &mut ScanMasks, report: &mut ScanReport) -> Ends {
        let mut hits = Vec::new();
        let mut open = FxHashSet::default();
        let reach_square = self.reach.max_range_m * self.reach.max_range_m;
        self.quantize_each(|p, cell| {
            let from_origin = p - self.origin_m;
            let square = from_origin.norm_squared();
            if !square.is_finite() {
                report.not_finite += 1;
            } else if square <= reach_square {
                match cell {
                    Some(cell) if masks.hit(cell) => hits.push(cell),
                    Some(_) => {}
                    None => report.out_of_range += 1,
                }
            } else {
                let end = self.origin_m + from_origin * (self.reach.max_range_m / square.sqrt());
                match self.traversal.cell_of(&end) {
                    Ok(cell) => {
                        report.beyond_max_range += 1;
                        open.insert(cell);
                    }
                    Err(_) => report.out_of_range += 1,
                }
            }
        });
        let open = open.into_iter().collect();
        Ends { hits, open }
    }

    /// Cells of all points within range, sorted.
    fn all_hits(&self) -> Vec<Packed> {
        let reach_square = self.reach.max_range_m * self.reach.max_range_m;
        let mut cells = Vec::new();
        self.quantize_each(|p, cell| {
            if (p - self.origin_m).norm_squared() <= reach_square {
                cells.extend(cell);
            }
        });
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    fn quantize_each(&self, mut visit: impl FnMut(Vector3<f64>, Option<Packed>)) {
        let [bx, by, bz] = self.base_m.into();
        let offsets = self.points.offsets_m.iter();
        let points =
            offsets.map(|&[x, y, z]| [bx + f64::from(x), by + f64::from(y), bz + f64::from(z)]);
        self.traversal.lattice.quantize_each(points, |p, w| {
            let cell = w.and_then(|w| self.traversal.in_range(w));
            visit(Vector3::from(p), cell);
        });
    }

    fn follow_all(&self, masks: &mut ScanMasks, ends: &Ends, probe: &mut Option<Probe<'_>>) -> u64 {
        #[cfg(target_arch = "x86_64")]
        if Simd::detect() == Simd::Avx2 {
            // SAFETY: AVX2 was detected.
            #[allow(unsafe_code)]
            return unsafe { self.follow_all_avx2(masks, ends, probe) };
        }
        self.follow_all_portably(masks, ends, probe)
    }

    /// The same code compiled for AVX2, without fused multiply-add, so that the results are bit-identical.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn follow_all_avx2(
        &self,
        masks: &mut ScanMasks,
        ends: &Ends,
        probe: &mut Option<Probe<'_>>,
    ) -> u64 {
        self.follow_all_portably(masks, ends, probe)
    }

    #[inline(always)]
    fn follow_all_portably(
        &self,
        masks: &mut ScanMasks,
        ends: &Ends,
        probe: &mut Option<Probe<'_>>,
    ) -> u64 {
        match &self.traversal.kernel {
            Kernel::Four(families) => self.follow(families, masks, ends, probe),
            Kernel::Six(families) => self.follow(families, masks, ends, probe),
            Kernel::Eight(families) => self.follow(families, masks, ends, probe),
        }
    }

    fn start<const P: usize>(&self, families: &Families<P>) -> Origin<P> {
        let center = self.traversal.lattice.center(self.start.unpack());
        families.origin(self.origin_m - center, self.start)
    }

    /// Ray to the lattice point of an end, without its last part; `None` if nothing is left.
    #[inline(always)]
    fn ray<const P: usize>(
        &self,
        families: &Families<P>,
        origin: &Origin<P>,
        end: Packed,
    ) -> Option<Ray<P>> {
        let mut ray = self.traversal.lattice.center(end.unpack()) - self.origin_m;
        let length = ray.norm();
        let keep_m = self.reach.keep_m.max(self.reach.keep_ratio * length);
        if keep_m > 0.0 {
            if length <= keep_m {
                return None;
            }
            ray *= 1.0 - keep_m / length;
        }
        Some(Ray {
            walk: families.walk(origin, &ray),
            steps: 0,
            limit: self.traversal.most_steps(length),
        })
    }

    /// Marks the cells from the origin to each end, without the end.
    #[inline(always)]
    fn follow<const P: usize>(
        &self,
        families: &Families<P>,
        masks: &mut ScanMasks,
        ends: &Ends,
        probe: &mut Option<Probe<'_>>,
    ) -> u64 {
        let origin = self.start(families);
        let ends = ends.hits.iter().chain(&ends.open);
        let rays = ends.filter_map(|end| Some((self.ray(families, &origin, *end)?, *end)));
        match probe {
            None => step_all(families, &origin, rays, &mut Marker { masks }),
            Some(probe) => {
                let mut prober = Prober {
                    bundle: self,
                    masks,
                    probe,
                };
                step_all(families, &origin, rays, &mut prober)
            }
        }
    }

    /// Line to the mean of the voxel that a ray ends in, or to its lattice point where there is none.
    fn line(&self, probe: &Probe<'_>, end: Packed) -> Line {
        let center = || self.traversal.lattice.center(end.unpack());
        let to_end = probe.mean_m(end).unwrap_or_else(center) - self.origin_m;
        Line {
            origin_m: self.origin_m,
            direction: to_end.normalize(),
        }
    }
}

/// Marks cells as traversed.
struct Marker<'a> {
    masks: &'a mut ScanMasks,
}

impl Visit for Marker<'_> {
    #[inline(always)]
    fn visit(&mut self, cell: Packed, _place: &mut Place) {
        self.masks.pass(cell);
    }
}

/// Marks cells as traversed, and shows a probe its voxels among them.
struct Prober<'a, 'p> {
    bundle: &'a Rays<'a>,
    masks: &'a mut ScanMasks,
    probe: &'a mut Probe<'p>,
}

impl Visit for Prober<'_, '_> {
    #[inline(always)]
    fn visit(&mut self, cell: Packed, place: &mut Place) {
        let (slot, at) = self.masks.pass(cell);
        if self.probe.is_open(self.masks, slot, at) {
            self.meet(cell, slot, place);
        }
    }
}

impl Prober<'_, '_> {
    #[inline(never)]
    fn meet(&mut self, cell: Packed, slot: usize, place: &mut Place) {
        let line = || self.bundle.line(self.probe, place.end);
        let line = place.line.get_or_insert_with(line);
        self.probe.meet(self.masks, cell, slot, line);
    }
}
