//! Rays of a scan: one per cell that they end in.

use nalgebra::Vector3;
use rustc_hash::FxHashSet;

use super::families::{Families, Origin, Ray};
use super::masks::ScanMasks;
use super::packed::Packed;
use super::scan::{RayBundle, Reach, ScanReport};
use super::steps::{Line, Place, Visit, step_all};
use super::surface::Probe;
use super::traversal::{Kernel, Outside, Traversal};
use crate::cloud::Cloud;
use crate::lattice::Simd;

/// End cells of rays, each once.
pub(super) struct Ends {
    pub(super) hits: Vec<Packed>,
    /// Cells in which the range limit ends rays.
    pub(super) open: Vec<Packed>,
}

impl Ends {
    pub(super) fn len(&self) -> usize {
        self.hits.len() + self.open.len()
    }

    /// Part `i` of `parts`.
    pub(super) fn part(&self, i: usize, parts: usize) -> [&[Packed]; 2] {
        [&self.hits, &self.open].map(|ends| {
            let range = ends.len() * i / parts..ends.len() * (i + 1) / parts;
            ends.get(range).unwrap_or_default()
        })
    }
}

/// Rays of one bundle, in metres from lattice point 0.
pub(super) struct Rays<'a> {
    pub(super) traversal: &'a Traversal,
    origin_m: Vector3<f64>,
    start: Packed,
    base_m: Vector3<f64>,
    points: &'a Cloud,
    reach: Reach,
}

impl<'a> Rays<'a> {
    /// Rays of a bundle; an error if its origin is outside of the range of keys.
    pub(super) fn new(
        traversal: &'a Traversal,
        datum_m: &Vector3<f64>,
        bundle: &RayBundle<'a>,
        reach: Reach,
    ) -> Result<Rays<'a>, Outside> {
        let origin_m = bundle.origin_m - datum_m;
        Ok(Rays {
            traversal,
            origin_m,
            start: traversal.cell_of(&origin_m)?,
            base_m: bundle.ends.datum_m - datum_m,
            points: bundle.ends,
            reach,
        })
    }

    /// Marks the end cells of the rays as hit, and returns them.
    pub(super) fn ends(&self, masks: &mut ScanMasks, report: &mut ScanReport) -> Ends {
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
    pub(super) fn all_hits(&self) -> Vec<Packed> {
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

    /// Follows the rays to some of the ends and marks the cells before each end. The hits of the scan are those of `hits`, or
    /// of the masks themselves. Returns the number of visits.
    pub(super) fn follow_all(
        &self,
        masks: &mut ScanMasks,
        hits: Option<&ScanMasks>,
        ends: [&[Packed]; 2],
        probe: &mut Option<Probe<'_>>,
    ) -> u64 {
        let follow = Follow {
            rays: self,
            masks,
            hits,
            ends,
            probe,
        };
        #[cfg(target_arch = "x86_64")]
        if Simd::detect() == Simd::Avx2 {
            // SAFETY: AVX2 was detected.
            #[allow(unsafe_code)]
            return unsafe { follow.follow_avx2() };
        }
        follow.follow_portably()
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

/// Rays to be followed.
struct Follow<'a, 'p, 'm> {
    rays: &'a Rays<'a>,
    masks: &'m mut ScanMasks,
    hits: Option<&'a ScanMasks>,
    ends: [&'a [Packed]; 2],
    probe: &'m mut Option<Probe<'p>>,
}

impl Follow<'_, '_, '_> {
    /// The same code compiled for AVX2, without fused multiply-add, so that the results are bit-identical.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn follow_avx2(self) -> u64 {
        self.follow_portably()
    }

    #[inline(always)]
    fn follow_portably(self) -> u64 {
        match &self.rays.traversal.kernel {
            Kernel::Four(families) => self.follow(families),
            Kernel::Six(families) => self.follow(families),
            Kernel::Eight(families) => self.follow(families),
        }
    }

    #[inline(always)]
    fn follow<const P: usize>(self, families: &Families<P>) -> u64 {
        let (rays, masks) = (self.rays, self.masks);
        let origin = rays.start(families);
        let ends = self.ends.into_iter().flatten();
        let each = ends.filter_map(|end| Some((rays.ray(families, &origin, *end)?, *end)));
        match self.probe {
            None => step_all(families, &origin, each, &mut Marker { masks }),
            Some(probe) => {
                let mut prober = Prober {
                    rays,
                    masks,
                    hits: self.hits,
                    probe,
                };
                step_all(families, &origin, each, &mut prober)
            }
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
struct Prober<'a, 'p, 'm> {
    rays: &'a Rays<'a>,
    masks: &'m mut ScanMasks,
    hits: Option<&'a ScanMasks>,
    probe: &'m mut Probe<'p>,
}

impl Visit for Prober<'_, '_, '_> {
    #[inline(always)]
    fn visit(&mut self, cell: Packed, place: &mut Place) {
        let (slot, at) = self.masks.pass(cell);
        let is_open = match self.probe.is_open(slot, at) {
            Some(is_open) => is_open,
            None => self.read(slot, at),
        };
        if is_open {
            self.meet(cell, slot, place);
        }
    }
}

impl Prober<'_, '_, '_> {
    #[inline(never)]
    fn read(&mut self, slot: usize, place: usize) -> bool {
        let hits = self.hits.unwrap_or(self.masks);
        self.probe.read(self.masks, hits);
        self.probe.is_open(slot, place).unwrap_or_default()
    }

    #[inline(never)]
    fn meet(&mut self, cell: Packed, slot: usize, place: &mut Place) {
        let line = || self.rays.line(self.probe, place.end);
        let line = place.line.get_or_insert_with(line);
        let hits = self.hits.unwrap_or(self.masks);
        self.probe.meet(hits, cell, slot, line);
    }
}
