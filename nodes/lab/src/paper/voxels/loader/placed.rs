//! Table I as printed, and the points of a log in a lattice at many places of it.

use crate::paper::estimate::Estimate;
use crate::paper::voxels::rotations::Quantized;
use crate::report::plot::title;
use crate::theory::second_moment;
use lattice_core::lattice::{Lattice, LatticeKind};

/// Points of the log, and the volume of a cell, as in the paper.
pub const POINTS: usize = 19_399;
pub const VOLUME_M3: f64 = 0.125;

/// A row of Table I.
#[derive(Clone, Copy)]
pub struct Printed {
    pub voxels: f64,
    pub mse: f64,
    pub distance_error: f64,
}

/// Table I in its order: voxels, mean squared error by dimension, "distance error".
pub const TABLE: [(LatticeKind, [f64; 3]); 5] = [
    (LatticeKind::Cubic, [3139.0, 0.0226, 0.2606]),
    (LatticeKind::Fcc, [3197.0, 0.0197, 0.2432]),
    (LatticeKind::Bcc, [3150.0, 0.0195, 0.2421]),
    (LatticeKind::Mcc, [3078.0, 0.0186, 0.2365]),
    (LatticeKind::Hex, [2904.0, 0.0218, 0.2560]),
];

pub fn printed(kind: LatticeKind) -> Option<Printed> {
    let row = TABLE.iter().find(|row| row.0 == kind);
    row.map(|&(_, [voxels, mse, distance_error])| Printed {
        voxels,
        mse,
        distance_error,
    })
}

/// The points of the simulated log in one lattice, at places of the lattice spread over its cell.
pub struct Placed {
    pub lattice: Lattice,
    pub places: Vec<Quantized>,
    pub printed: Option<Printed>,
}

impl Placed {
    pub fn each(&self, of: impl Fn(&Quantized) -> f64) -> Vec<f64> {
        self.places.iter().map(of).collect()
    }

    pub fn mean(&self, of: impl Fn(&Quantized) -> f64) -> Estimate {
        Estimate::of(self.each(of))
    }

    pub fn voxels(&self) -> Estimate {
        self.mean(|q| q.voxels as f64)
    }

    pub fn name(&self) -> &'static str {
        title(self.lattice.kind())
    }

    /// Mean squared error by dimension of evenly spread points, m^2.
    pub fn mse_of_theory(&self) -> f64 {
        second_moment(&self.lattice) * self.lattice.cell_side_m().powi(2)
    }
}

pub fn rms_m(q: &Quantized) -> f64 {
    (3.0 * q.mse_m2).sqrt()
}

pub fn find(all: &[Placed], kind: LatticeKind) -> Option<&Placed> {
    all.iter().find(|placed| placed.lattice.kind() == kind)
}
