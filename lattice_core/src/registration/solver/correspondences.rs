//! Correspondences of source and target points, found at one pose and evaluated at others.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use super::correspondence::{Correspondence, Metric};
use super::method_labels::{Labels, labels};
use super::normal_equations::NormalEquations;
use super::robust_kernel::Kernel;
use crate::kd_tree::{Nearest, Neighbors};
use crate::registration::prepared::squared_reach;
use crate::registration::prepared::surface::Surface;
use crate::registration::{
    MAX_CANDIDATES, Method, PreparedCloud, RegisterOptions, SemanticVariant,
};

/// Source points per parallel task.
const CHUNK: usize = 256;
/// Target index of a source point without a correspondence.
pub(super) const NONE: u32 = u32::MAX;

/// Candidate correspondence of a source point.
#[derive(Clone, Copy)]
pub(super) struct Slot {
    pub target: u32,
    pub weight: f64,
}

/// Source and target surface of the whole clouds, or of one class.
pub(super) struct Layer<'a> {
    pub source: &'a Surface,
    pub target: &'a Surface,
}

/// Correspondences of two clouds with their cost.
pub(super) struct Correspondences<'a> {
    layers: Vec<Layer<'a>>,
    pub(super) labels: Labels<'a>,
    pub(super) options: &'a RegisterOptions<'a>,
    pub(super) metric: Metric,
    kernel: Kernel,
    /// Flatness of the source covariances if the gradient includes their rotation, else 0. The Hessian does not
    /// include it.
    turn: f64,
    /// Factor on the variances.
    pub(super) scale: f64,
    /// Centre of the rotations in the source, metres; lever arms start there.
    center: Point3<f64>,
    candidates: usize,
    stride: usize,
    squared_gate_m2: f64,
    /// Candidates of each used source point, by layer.
    slots: Vec<Vec<Slot>>,
}

/// Pose as a rotation matrix and a translation, for many points.
pub(super) struct Placed {
    rotation: nalgebra::Matrix3<f64>,
    p: Vector3<f64>,
    /// Transformed centre of the source.
    center: Vector3<f64>,
}

impl Placed {
    fn new(pose: &Isometry3<f64>, center: &Point3<f64>) -> Placed {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let p = pose.translation.vector;
        Placed {
            rotation,
            p,
            center: rotation * center.coords + p,
        }
    }

    #[inline(always)]
    fn place(&self, surface: &Surface, i: usize) -> (Point3<f64>, Vector3<f64>) {
        let q = self.rotation * surface.points_m[i].coords + self.p;
        (q.into(), self.rotation * surface.normals[i])
    }
}

impl<'a> Correspondences<'a> {
    pub fn new(
        source: &'a PreparedCloud,
        target: &'a PreparedCloud,
        options: &'a RegisterOptions<'a>,
        center: Point3<f64>,
    ) -> Correspondences<'a> {
        let layers = match options.method {
            Method::ClassWise => class_layers(source, target, options.min_class_points),
            _ => vec![Layer {
                source: source.surface(),
                target: target.surface(),
            }],
        };
        let flat = |cloud: &PreparedCloud| 1.0 - cloud.plane_epsilon();
        let metric = match options.method {
            Method::PointToPoint => Metric::Points,
            _ => Metric::Planes {
                target: flat(target),
                source: flat(source),
            },
        };
        let turns = !matches!(options.method, Method::PointToPoint | Method::Gicp);
        let stride = options.source_stride.max(1);
        let candidates = match options.method {
            Method::Semantic(_) => options.neighbors.clamp(1, MAX_CANDIDATES),
            _ => 1,
        };
        let none = Slot {
            target: NONE,
            weight: 0.0,
        };
        let slots = layers.iter().map(|layer| {
            let used = layer.source.points_m.len().div_ceil(stride);
            vec![none; used * candidates]
        });
        Correspondences {
            slots: slots.collect(),
            layers,
            labels: labels(source, target, options),
            metric,
            kernel: Kernel::None,
            turn: if turns { flat(source) } else { 0.0 },
            scale: 1.0,
            center,
            candidates,
            stride,
            squared_gate_m2: squared_reach(options.gate_m),
            options,
        }
    }

    /// Factor on the variances at which a third of the gate across two planes is one standard deviation.
    pub fn widest_scale(&self) -> f64 {
        let Metric::Planes { target, source } = self.metric else {
            return 1.0;
        };
        let across_m2 = (1.0 - target) + (1.0 - source);
        (self.squared_gate_m2 / 9.0 / across_m2).clamp(1.0, 1e12)
    }

    /// Finds the correspondences at a pose and accumulates their normal equations.
    pub fn find(&mut self, pose: &Isometry3<f64>, scale: f64) -> NormalEquations {
        self.scale = scale;
        self.kernel = kernel(self.options, scale);
        let placed = Placed::new(pose, &self.center);
        let mut slots = std::mem::take(&mut self.slots);
        let mut sums = NormalEquations::default();
        for (layer, slots) in self.layers.iter().zip(&mut slots) {
            let chunks = slots.par_chunks_mut(CHUNK * self.candidates).enumerate();
            let parts: Vec<NormalEquations> = chunks
                .map(|(chunk, slots)| self.find_chunk(layer, &placed, chunk * CHUNK, slots))
                .collect();
            sums = parts.iter().fold(sums, NormalEquations::merge);
        }
        self.slots = slots;
        sums
    }

    /// Normal equations of the same correspondences at another pose.
    pub fn linearize(&self, pose: &Isometry3<f64>) -> NormalEquations {
        self.each(pose, |sums, pair, weight| {
            sums.add(pair, weight, self.kernel, self.turn);
        })
    }

    /// Cost of the same correspondences at another pose.
    pub fn cost(&self, pose: &Isometry3<f64>) -> f64 {
        let sums = self.each(pose, |sums, pair, weight| {
            sums.cost += self.kernel.apply(weight, pair.squared()).0;
        });
        sums.cost
    }

    fn each(
        &self,
        pose: &Isometry3<f64>,
        add: impl Fn(&mut NormalEquations, &Correspondence, f64) + Sync,
    ) -> NormalEquations {
        let placed = Placed::new(pose, &self.center);
        let mut sums = NormalEquations::default();
        for (layer, slots) in self.layers.iter().zip(&self.slots) {
            let chunks = slots.par_chunks(CHUNK * self.candidates).enumerate();
            let part = |(chunk, slots): (usize, &[Slot])| {
                let mut sums = NormalEquations::default();
                for (at, slots) in slots.chunks_exact(self.candidates).enumerate() {
                    let i = (chunk * CHUNK + at) * self.stride;
                    let (q, m) = placed.place(layer.source, i);
                    let before = sums.pairs;
                    for slot in slots.iter().filter(|slot| slot.target != NONE) {
                        let pair = self.pair(layer, &placed, (&q, &m), slot.target);
                        add(&mut sums, &pair, slot.weight);
                    }
                    sums.inliers += usize::from(sums.pairs > before);
                }
                sums
            };
            let parts: Vec<NormalEquations> = chunks.map(part).collect();
            sums = parts.iter().fold(sums, NormalEquations::merge);
        }
        sums
    }

    #[inline(always)]
    pub(super) fn pair(
        &self,
        layer: &Layer,
        placed: &Placed,
        source: (&Point3<f64>, &Vector3<f64>),
        target: u32,
    ) -> Correspondence {
        let j = target as usize;
        let target = (&layer.target.points_m[j], &layer.target.normals[j]);
        Correspondence::new(self.metric, &placed.center, source, target)
    }

    fn find_chunk(
        &self,
        layer: &Layer,
        placed: &Placed,
        first: usize,
        slots: &mut [Slot],
    ) -> NormalEquations {
        let mut sums = NormalEquations::default();
        let mut found = Neighbors::default();
        for (at, slots) in slots.chunks_exact_mut(self.candidates).enumerate() {
            let i = (first + at) * self.stride;
            let (q, m) = placed.place(layer.source, i);
            match slots {
                [slot] => self.find_one(layer, &q, slot),
                _ => self.find_many(layer, &q, slots, &mut found),
            }
            if let Method::Semantic(variant) = self.options.method {
                self.weigh(variant, layer, placed, (i, &q, &m), slots);
            }
            let mut counts = false;
            for slot in slots.iter().filter(|slot| slot.target != NONE) {
                let pair = self.pair(layer, placed, (&q, &m), slot.target);
                sums.add(&pair, slot.weight, self.kernel, self.turn);
                counts = true;
            }
            sums.inliers += usize::from(counts);
        }
        sums
    }

    /// Finds the nearest target point; the search starts with the distance of the last one.
    fn find_one(&self, layer: &Layer, q: &Point3<f64>, slot: &mut Slot) {
        let mut nearest = Nearest {
            index: NONE,
            squared: self.squared_gate_m2,
        };
        if let Some(y) = layer.target.points_m.get(slot.target as usize) {
            let squared = nalgebra::distance_squared(y, q);
            if squared <= nearest.squared {
                nearest = Nearest {
                    index: slot.target,
                    squared,
                };
            }
        }
        layer.target.tree.search(q, &mut nearest);
        *slot = Slot {
            target: nearest.index,
            weight: 1.0,
        };
    }

    /// Finds the nearest target points of a source point.
    fn find_many(&self, layer: &Layer, q: &Point3<f64>, slots: &mut [Slot], found: &mut Neighbors) {
        let old = slots
            .iter()
            .map(|slot| layer.target.points_m.get(slot.target as usize))
            .map(|y| y.map_or(f64::MAX, |y| nalgebra::distance_squared(y, q)));
        let reach = old.fold(0.0, f64::max).min(self.squared_gate_m2);
        found.start(slots.len(), reach);
        layer.target.tree.search(q, found);
        let mut indices = found.indices().iter();
        for slot in slots {
            *slot = Slot {
                target: indices.next().copied().unwrap_or(NONE),
                weight: 1.0,
            };
        }
    }
}

/// Surfaces of the classes that both clouds contain.
fn class_layers<'a>(
    source: &'a PreparedCloud,
    target: &'a PreparedCloud,
    min_points: usize,
) -> Vec<Layer<'a>> {
    let layer = |(class, source): &'a (u16, Surface)| {
        let target = target.classes().iter().find(|(c, _)| c == class);
        let large = source.points_m.len() > min_points;
        target
            .filter(|_| large)
            .map(|(_, target)| Layer { source, target })
    };
    source.classes().iter().filter_map(layer).collect()
}

/// Robust kernel of a method.
fn kernel(options: &RegisterOptions, scale: f64) -> Kernel {
    let alpha = options.cauchy_alpha;
    if !(alpha.is_finite() && alpha > 0.0) {
        return Kernel::None;
    }
    let a2 = alpha * alpha * scale;
    match options.method {
        Method::PointToPoint | Method::Gicp => Kernel::None,
        Method::Semantic(SemanticVariant::AsPrinted) => Kernel::CauchyAround { a2 },
        Method::ClassWise if options.kernel_of_square => Kernel::CauchyOfSquare { a2 },
        Method::GicpSe3 | Method::Semantic(_) | Method::ClassWise => Kernel::Cauchy { a2 },
    }
}
