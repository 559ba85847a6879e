//! Quantizer of blocks of points.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::form::{Bcc, Cubic, Fcc, Form, Hex, Mcc};
use super::kernel::{BLOCK, Constants, Lane, LaneSums, Lanes, STEPS};
use super::simd::{self, Simd};
use crate::lattice::{BlockKey, Lattice, LatticeIndex, LatticeKind};
use crate::prefetch::prefetch;

/// Cache lines of a block of points.
const BLOCK_LINES: usize = BLOCK * size_of::<[f32; 3]>() / 64;

/// Half of one unit in the last place of 1.
const EPSILON: f64 = 1.0 / (1_u64 << 24) as f64;
/// Maximum distance of a point from the phase's lattice point in the kernel, in cuboid sides.
const KERNEL_REACH: f64 = (1 << 13) as f64;
/// Bound of the indices of the phase's lattice point.
const BASE_LIMIT: u64 = 1 << 18;

/// Quantizes batches of points that share a rigid transform to the lattice.
#[derive(Clone, Debug)]
pub struct BatchQuantizer {
    lattice: Lattice,
    lattice_from_points: Isometry3<f64>,
    rotation: Option<Matrix3<f64>>,
    pub(super) kernel: Option<Kernel>,
    side_m: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Kernel {
    run: simd::Run,
    run_with_statistics: simd::Run,
    pub(super) one: fn(&Constants, [f32; 3]) -> Lane,
    pub(super) constants: Constants,
}

/// Sums over the points of a batch, in 2^-20 of a cell side (cube root of the cell volume).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct BatchSums {
    /// Number of points.
    pub points: u64,
    /// Sum of distances from the lattice points.
    pub distances: u64,
    /// Sum of squared distances.
    pub squares: u64,
    /// Maximum squared distance.
    pub largest_square: u64,
    /// True if a point is too far from the origin of its frame for 32-bit fixed point, or the lattice has no kernel.
    pub far: bool,
}

/// Block of points with their cells.
pub struct BatchBlock<'a> {
    /// Cell of each point.
    pub codes: &'a [BlockKey],
    /// Quantization error of the points that have a cell.
    pub sums: &'a BatchSums,
    /// Coordinates of the points by axis, in the frame of the points: units of 2^-20 m, modulo 2^32, rounded to
    /// within one unit. Invalid if `sums.far`.
    pub fixed: &'a [[i32; BLOCK]; 3],
}

impl BatchSums {
    /// Adds other points.
    pub fn add(&mut self, other: &BatchSums) {
        self.points += other.points;
        self.distances += other.distances;
        self.squares += other.squares;
        self.largest_square = self.largest_square.max(other.largest_square);
        self.far |= other.far;
    }
}

impl BatchQuantizer {
    /// Creates a quantizer of points with lattice coordinates `lattice_from_points * p`, metres.
    pub fn new(lattice: &Lattice, lattice_from_points: Isometry3<f64>) -> BatchQuantizer {
        Self::with_simd(lattice, lattice_from_points, Simd::detect())
    }

    /// [`BatchQuantizer::new`] with a given instruction set, which does not change results.
    pub fn with_simd(
        lattice: &Lattice,
        lattice_from_points: Isometry3<f64>,
        simd: Simd,
    ) -> BatchQuantizer {
        let rotates = lattice_from_points.rotation != nalgebra::UnitQuaternion::identity();
        let rotation = rotates.then(|| *lattice_from_points.rotation.to_rotation_matrix().matrix());
        BatchQuantizer {
            lattice: lattice.clone(),
            lattice_from_points,
            rotation,
            kernel: Kernel::new(lattice, &lattice_from_points, simd),
            side_m: lattice.cell_side_m(),
        }
    }

    /// Point in the lattice frame, metres: rotated, then translated, each in double precision.
    #[inline]
    pub fn transform<T: Into<f64>>(&self, p: [T; 3]) -> Vector3<f64> {
        let p = Vector3::from(p.map(T::into));
        let turned = match &self.rotation {
            Some(rotation) => rotation * p,
            None => p,
        };
        self.lattice_from_points.translation.vector + turned
    }

    /// The translation of `lattice_from_points`, metres.
    pub fn translation_m(&self) -> [f64; 3] {
        self.lattice_from_points.translation.vector.into()
    }

    /// Appends the cell of each point, or [`BlockKey::NONE`] where [`Lattice::quantize`] of the transformed point is
    /// `None`.
    pub fn codes(&self, points: &[[f32; 3]], codes: &mut Vec<BlockKey>) {
        codes.reserve(points.len());
        self.for_blocks(points, |block, _| codes.extend_from_slice(block));
    }

    /// Writes the lattice index of each point to `indices`, of the same length.
    ///
    /// Returns the position of the first point without a cell in `points`; the indices of such points are invalid.
    pub fn indices(&self, points: &[[f32; 3]], indices: &mut [LatticeIndex]) -> Option<usize> {
        let (mut bad, mut at, mut rest) = (None, 0, indices);
        self.for_blocks(points, |block, sums| {
            if bad.is_none() && sums.points != block.len() as u64 {
                let none = block.iter().position(|&key| key == BlockKey::NONE);
                bad = none.map(|place| at + place);
            }
            let len = block.len().min(rest.len());
            let (now, later) = std::mem::take(&mut rest).split_at_mut(len);
            for (index, key) in now.iter_mut().zip(block) {
                *index = key.unpack();
            }
            (at, rest) = (at + block.len(), later);
        });
        bad
    }

    /// Visits the cells of up to [`BatchQuantizer::BLOCK`] points at a time, in order. Of the sums, only the number
    /// of points with a cell is kept.
    #[inline]
    pub fn for_blocks(&self, points: &[[f32; 3]], mut visit: impl FnMut(&[BlockKey], &BatchSums)) {
        self.blocks::<false>(points, |block| visit(block.codes, block.sums));
    }

    /// [`BatchQuantizer::for_blocks`] with the quantization error of the points that have a cell.
    #[inline]
    pub fn for_blocks_with_sums(&self, points: &[[f32; 3]], visit: impl FnMut(&BatchBlock)) {
        self.blocks::<true>(points, visit);
    }

    /// Maximum number of points in a block.
    pub const BLOCK: usize = BLOCK;

    #[inline]
    fn blocks<const STATISTICS: bool>(
        &self,
        points: &[[f32; 3]],
        mut visit: impl FnMut(&BatchBlock),
    ) {
        let mut lanes = Lanes::default();
        let (blocks, rest) = points.as_chunks::<BLOCK>();
        for (number, block) in blocks.iter().enumerate() {
            if let Some(soon) = blocks.get(number + 2) {
                // They follow in bursts, which hardware prefetching does not predict.
                prefetch::<BLOCK_LINES, _>(soon);
            }
            let sums = self.block::<STATISTICS>(block, BLOCK, &mut lanes);
            visit(&BatchBlock {
                codes: &lanes.codes,
                sums: &sums,
                fixed: &lanes.fixed,
            });
        }
        if !rest.is_empty() {
            let mut block = [[f32::NAN; 3]; BLOCK];
            block
                .iter_mut()
                .zip(rest)
                .for_each(|(to, from)| *to = *from);
            let sums = self.block::<STATISTICS>(&block, rest.len(), &mut lanes);
            visit(&BatchBlock {
                codes: lanes.codes.get(..rest.len()).unwrap_or_default(),
                sums: &sums,
                fixed: &lanes.fixed,
            });
        }
    }

    /// Computes the codes of the first `used` points.
    #[inline]
    fn block<const STATISTICS: bool>(
        &self,
        points: &[[f32; 3]; BLOCK],
        used: usize,
        lanes: &mut Lanes,
    ) -> BatchSums {
        let sums = match &self.kernel {
            Some(kernel) if STATISTICS => {
                (kernel.run_with_statistics)(&kernel.constants, points, lanes)
            }
            Some(kernel) => (kernel.run)(&kernel.constants, points, lanes),
            None => {
                lanes.decided.fill(0);
                LaneSums::default()
            }
        };
        let mut sums = BatchSums {
            points: used as u64,
            distances: sums.distances as u64,
            squares: sums.squares as u64,
            largest_square: sums.largest_square as u64,
            // Without a kernel the fixed-point positions are not filled in.
            far: self.kernel.is_none(),
        };
        let mut open = lanes.open();
        while open != 0 {
            let first = 8 * open.trailing_zeros() as usize;
            self.settle(points, first..(first + 8).min(used), lanes, &mut sums);
            open &= open - 1;
        }
        sums
    }

    /// Decides the points that the kernel left undecided.
    #[cold]
    fn settle(
        &self,
        points: &[[f32; 3]; BLOCK],
        places: std::ops::Range<usize>,
        lanes: &mut Lanes,
        sums: &mut BatchSums,
    ) {
        for i in places {
            let (Some(&p), Some(code), Some(&decided)) =
                (points.get(i), lanes.codes.get_mut(i), lanes.decided.get(i))
            else {
                continue;
            };
            if decided != 0 {
                continue;
            }
            let near = |x: f32| x.abs() < super::kernel::FIXED_REACH_M;
            sums.far |= !p.into_iter().all(near);
            let (exact, own) = self.exactly(p);
            *code = exact;
            if exact == BlockKey::NONE {
                sums.points -= 1;
            } else {
                sums.distances += own.distances;
                sums.squares += own.squares;
                sums.largest_square = sums.largest_square.max(own.largest_square);
            }
        }
    }

    /// Code and quantization error of one point in double precision.
    pub(super) fn exactly<T: Into<f64>>(&self, p: [T; 3]) -> (BlockKey, BatchSums) {
        let p = self.transform(p);
        let found = self.lattice.quantize(&p);
        let Some((w, code)) = found.and_then(|w| Some((w, BlockKey::pack(w)?))) else {
            return (BlockKey::NONE, BatchSums::default());
        };
        let off = (p - self.lattice.center(w)) / self.side_m;
        let square = (off.x * off.x + off.y * off.y + off.z * off.z) as f32;
        let square_steps = super::kernel::to_int(square * STEPS) as u64;
        let sums = BatchSums {
            points: 1,
            distances: super::kernel::to_int(square.sqrt() * STEPS) as u64,
            squares: square_steps,
            largest_square: square_steps,
            far: false,
        };
        (code, sums)
    }

    /// Contribution of one point to the sums of [`BatchQuantizer::for_blocks_with_sums`].
    pub fn sums_of(&self, p: [f32; 3]) -> BatchSums {
        if let Some(kernel) = &self.kernel {
            let lane = (kernel.one)(&kernel.constants, p);
            if lane.decided != 0 {
                return BatchSums {
                    points: 1,
                    distances: lane.distance as u64,
                    squares: lane.square as u64,
                    largest_square: lane.square as u64,
                    far: false,
                };
            }
        }
        self.exactly(p).1
    }
}

impl Kernel {
    fn new(lattice: &Lattice, lattice_from_points: &Isometry3<f64>, simd: Simd) -> Option<Kernel> {
        let generator = lattice.generator();
        let (axes, squares) = super::form::axes(lattice.kind(), &generator)?;
        let side_m = lattice.cell_side_m();
        let u_from_lattice = axes * generator.try_inverse()?;
        let m = u_from_lattice * lattice_from_points.rotation.to_rotation_matrix();
        let translation = lattice_from_points.translation.vector;
        let base = lattice.quantize_wide(&translation)?;
        if base.iter().any(|i| i.unsigned_abs() >= BASE_LIMIT) {
            return None;
        }
        let phase = u_from_lattice * (translation - lattice.center_wide(base));
        let largest = m.amax();
        // Error of the products and sums of the closed form for a point at the limit of the keys.
        let far = u_from_lattice.amax() * translation.lp_norm(1);
        let diagonal = m == Matrix3::from_diagonal(&m.diagonal());
        // Error of products of two rounded numbers, their sum, and the added phase.
        let roundings = if diagonal { 3.0 } else { 5.0 };
        let weights = squares.map(|s| (s / squares[0]) as f32);
        let centred_weight: f32 = weights.iter().sum();
        let constants = Constants {
            rows: [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)] as f32)),
            phase: [phase.x as f32, phase.y as f32, phase.z as f32],
            base: base.map(|i| i as i32 + (1 << 20)),
            weights,
            threshold: 0.0,
            excess_per_error: 1.25 * centred_weight,
            squared_sides: squares.map(|s| (s / (side_m * side_m)) as f32),
            error_per_metre: (1.01 * roundings * EPSILON * largest) as f32,
            error: (8.0 * EPSILON + 1e-14 * far) as f32,
            reach_m: ((KERNEL_REACH / largest) as f32).min(super::kernel::FIXED_REACH_M),
        };
        Some(match lattice.kind() {
            LatticeKind::Cubic => Self::of::<Cubic>(constants, diagonal, simd),
            LatticeKind::Bcc => Self::of::<Bcc>(constants, diagonal, simd),
            LatticeKind::Fcc => Self::of::<Fcc>(constants, diagonal, simd),
            LatticeKind::Mcc => Self::of::<Mcc>(constants, diagonal, simd),
            LatticeKind::Hex | LatticeKind::HexOptimal => {
                Self::of::<Hex>(constants, diagonal, simd)
            }
            LatticeKind::Custom => return None,
        })
    }

    fn of<F: Form>(mut constants: Constants, diagonal: bool, simd: Simd) -> Kernel {
        constants.threshold = F::threshold(constants.weights);
        let (run, run_with_statistics, one): (_, _, fn(&Constants, [f32; 3]) -> Lane) = if diagonal
        {
            (
                simd.run::<F, true, false>(),
                simd.run::<F, true, true>(),
                super::kernel::lane::<F, true>,
            )
        } else {
            (
                simd.run::<F, false, false>(),
                simd.run::<F, false, true>(),
                super::kernel::lane::<F, false>,
            )
        };
        Kernel {
            run,
            run_with_statistics,
            one,
            constants,
        }
    }
}
