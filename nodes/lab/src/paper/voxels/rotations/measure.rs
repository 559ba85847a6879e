//! A cloud at many poses, quantized to several lattices.

use crate::AnyError;
use crate::paper::estimate::Estimate;
use crate::paper::parallel::in_parallel;
use crate::paper::streams::{Purpose, stream};
use crate::report::plot::title;
use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeKind, Orientation};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Side of the cube that a cloud is moved in, metres.
const REACH_M: f64 = 16.0;

/// Turns of a cloud before it is quantized.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Turns {
    /// Uniform over all rotations, as in the paper.
    Any,
    /// About the vertical alone: gravity is known.
    Yaw,
}

impl Turns {
    /// Name in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Any => "any rotation",
            Self::Yaw => "yaw only",
        }
    }

    /// Pose `number`, the same for all lattices.
    fn pose(self, seed: u64, number: usize) -> Isometry3<f64> {
        let mut stream = stream(seed, Purpose::Pose, number);
        let any = stream.rotation();
        let rotation = match self {
            Self::Any => any,
            Self::Yaw => {
                let yaw = std::f64::consts::TAU * stream.uniform();
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
            }
        };
        Isometry3::from_parts(Translation3::from(REACH_M * stream.point()), rotation)
    }
}

/// A lattice and how it lies.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Laid {
    pub kind: LatticeKind,
    /// Axes of the lattice in the map.
    pub orientation: Orientation,
}

impl Laid {
    pub fn paper(kind: LatticeKind) -> Laid {
        Laid {
            kind,
            orientation: Orientation::Paper,
        }
    }

    pub fn flat(kind: LatticeKind) -> Laid {
        Laid {
            kind,
            orientation: Orientation::Ground,
        }
    }

    pub fn name(&self) -> String {
        match self.orientation {
            Orientation::Paper => title(self.kind).to_owned(),
            _ => format!("{}, laid flat", title(self.kind)),
        }
    }
}

/// Counts and errors of a lattice for a cloud at each pose.
pub struct Measured {
    pub laid: Laid,
    pub counts: Vec<f64>,
    /// Mean distance of eq. (13) at each pose, metres.
    pub means_m: Vec<f64>,
}

impl Measured {
    /// Mean change of the count against that of another lattice at the same poses.
    pub fn count_to(&self, other: &Measured) -> Estimate {
        changes(&self.counts, &other.counts)
    }

    /// Mean change of the mean distance.
    pub fn mean_to(&self, other: &Measured) -> Estimate {
        changes(&self.means_m, &other.means_m)
    }

    /// Standard deviation of the count.
    pub fn spread(&self) -> Estimate {
        Estimate::deviation_of(&self.counts)
    }

    /// Poses at which another lattice takes fewer voxels.
    pub fn more_than(&self, other: &Measured) -> impl Iterator<Item = bool> {
        let pairs = self.counts.iter().zip(&other.counts);
        pairs.map(|(ours, theirs)| ours > theirs)
    }
}

fn changes(ours: &[f64], theirs: &[f64]) -> Estimate {
    let pairs = ours.iter().zip(theirs);
    Estimate::of(pairs.map(|(a, b)| a / b - 1.0))
}

/// Quantizes a cloud at `poses` poses to each lattice.
pub fn measure(
    points: &[[f32; 3]],
    volume_m3: f64,
    laid: &[Laid],
    (turns, poses, seed): (Turns, usize, u64),
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Measured>, AnyError> {
    let lattices: Vec<Lattice> = laid
        .iter()
        .map(|laid| Lattice::new(laid.kind, volume_m3)?.with_orientation(laid.orientation))
        .collect::<Result<_, _>>()?;
    let trials = in_parallel(poses, progress, |number| {
        let pose = turns.pose(seed, number);
        let of = |lattice| quantized(points, lattice, pose);
        lattices.iter().map(of).collect::<Vec<_>>()
    });
    let of = |(i, &laid): (usize, &Laid)| {
        let own = trials.iter().filter_map(|trial| trial.get(i));
        let (counts, means_m) = own.map(|q| (q.voxels as f64, q.mean_m)).unzip();
        Measured {
            laid,
            counts,
            means_m,
        }
    };
    Ok(laid.iter().enumerate().map(of).collect())
}

#[derive(Clone, Copy, Debug)]
pub struct Quantized {
    pub voxels: usize,
    pub mean_m: f64,
    /// Mean squared error by dimension, m^2.
    pub mse_m2: f64,
}

/// Voxels and distortion of a cloud at a pose.
pub fn quantized(points: &[[f32; 3]], lattice: &Lattice, pose: Isometry3<f64>) -> Quantized {
    let mut codes: Vec<u64> = Vec::with_capacity(points.len());
    let (mut n, mut distances, mut squares) = (0_u64, 0_u64, 0_u64);
    BatchQuantizer::new(lattice, pose).for_blocks_with_sums(points, |block| {
        let inside = block.codes.iter().filter(|code| **code != BlockKey::NONE);
        codes.extend(inside.map(|code| code.raw()));
        n += block.sums.points;
        distances += block.sums.distances;
        squares += block.sums.squares;
    });
    codes.sort_unstable();
    codes.dedup();
    // Sums are in 2^-20 of a cell side, and of its square.
    let side_m = lattice.cell_side_m();
    let mean = |sum: u64| sum as f64 / n.max(1) as f64 / f64::from(1 << 20);
    Quantized {
        voxels: codes.len(),
        mean_m: side_m * mean(distances),
        mse_m2: side_m * side_m * mean(squares) / 3.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_cloud_is_quantized_as_its_points_are() {
        let mut stream = stream(1, Purpose::Uniform, 1);
        let mut point = || (stream.point() * 3.0).cast::<f32>().into();
        let points: Vec<[f32; 3]> = (0..1000).map(|_| point()).collect();
        let lattice = Lattice::new(LatticeKind::Fcc, 0.125).unwrap();
        let pose = Turns::Any.pose(1, 0);
        let (mut voxels, mut sum, mut squares) = (BTreeSet::new(), 0.0, 0.0);
        for p in &points {
            let p = pose * nalgebra::Point3::from(p.map(f64::from));
            let w = lattice.quantize(&p.coords).unwrap();
            let square = (p.coords - lattice.center(w)).norm_squared();
            voxels.insert(w);
            sum += square.sqrt();
            squares += square;
        }
        let found = quantized(&points, &lattice, pose);
        assert_eq!(found.voxels, voxels.len());
        assert!((found.mean_m - sum / 1000.0).abs() < 1e-5);
        assert!((found.mse_m2 - squares / 3000.0).abs() < 1e-5);
    }

    #[test]
    fn counts_and_errors_do_not_depend_on_threads() {
        let points: Vec<[f32; 3]> = (0..500)
            .map(|i| [0.37, 0.11, 0.05].map(|s| s * i as f32))
            .collect();
        let laid = LatticeKind::ALL.map(Laid::paper);
        let on = |threads: usize| {
            let go = || measure(&points, 0.125, &laid, (Turns::Any, 20, 1), &mut |_| {});
            let measured = crate::pool(threads).unwrap().install(go).unwrap();
            let numbers = measured.into_iter().map(|m| (m.counts, m.means_m));
            numbers.collect::<Vec<_>>()
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn yaw_leaves_the_vertical_where_it_is() {
        for number in 0..20 {
            let up = Turns::Yaw.pose(1, number) * Vector3::z();
            assert!((up - Vector3::z()).norm() < 1e-12);
            assert!((Turns::Any.pose(1, number) * Vector3::z()).z < 0.9999);
        }
    }
}
