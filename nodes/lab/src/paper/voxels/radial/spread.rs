//! The spread of distances over a set of cells.

use crate::AnyError;
use crate::paper::estimate::Estimate;
use crate::paper::parallel::in_parallel;
use crate::paper::voxels::sample::Samples;
use crate::paper_values::printed_delta;
use crate::report::plot::{Curve, color, title};
use crate::report::{Cell, numbers};
use crate::theory::{mean_distance_m, second_moment};
use lattice_core::lattice::{Lattice, LatticeIndex, LatticeKind};

/// Bins of the curves, cell sides.
const BIN: f64 = 0.02;
const BINS: usize = 140;

/// Cells about a lattice point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cells {
    Own,
    /// Cells printed in eq. (3)-(7), without 0.
    Printed,
    Faces,
    Touching,
}

impl Cells {
    pub fn of(self, lattice: &Lattice) -> Vec<LatticeIndex> {
        match self {
            Self::Own => vec![[0; 3]],
            Self::Printed => {
                let printed = printed_delta(lattice.kind()).into_iter();
                printed.filter(|w| *w != [0; 3]).collect()
            }
            Self::Faces => lattice.face_neighbors().to_vec(),
            Self::Touching => lattice.touching_neighbors().to_vec(),
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Own => "own cell",
            Self::Printed => "printed set",
            Self::Faces => "share a face",
            Self::Touching => "all touching",
        }
    }
}

/// Distances of the points of a set of cells.
pub struct Spread {
    pub kind: LatticeKind,
    pub cells: Cells,
    pub n: usize,
    pub mean: Estimate,
    pub std: Estimate,
    pub exact_mean: f64,
    pub exact_std: f64,
    pub nearest: f64,
    pub farthest: f64,
    /// Density by distance, a value for each bin.
    density: Vec<f64>,
}

impl Spread {
    pub fn new(
        (kind, cells): (LatticeKind, Cells),
        samples: &Samples,
        seed: u64,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Spread, AnyError> {
        let lattice = Lattice::new(kind, 1.0)?;
        let set = cells.of(&lattice);
        let centers: Vec<_> = set.iter().map(|&w| lattice.center(w)).collect();
        let draws = in_parallel(samples.draws, progress, |draw| {
            let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
            let mut bins = vec![0_u64; BINS];
            samples.visit(&lattice, seed, draw, |p| {
                for center in &centers {
                    let square = (p + center).norm_squared();
                    let distance = square.sqrt();
                    (sum, squares, n) = (sum + distance, squares + square, n + 1.0);
                    if let Some(bin) = bins.get_mut((distance / BIN) as usize) {
                        *bin += 1;
                    }
                }
            });
            let mean = sum / n;
            (mean, (squares / n - mean * mean).sqrt(), bins)
        });
        let points = (samples.points() * set.len()) as f64;
        let mut density = vec![0.0; BINS];
        for (_, _, bins) in &draws {
            for (sum, count) in density.iter_mut().zip(bins) {
                *sum += *count as f64 / points / BIN;
            }
        }
        // Of all cells together: mean distances, and squares by the law of the parallel axis.
        let n = set.len() as f64;
        let means = set.iter().map(|&w| mean_distance_m(&lattice, w));
        let exact_mean = means.sum::<f64>() / n;
        let of_centers = centers.iter().map(|c| c.norm_squared()).sum::<f64>() / n;
        let square = 3.0 * second_moment(&lattice) + of_centers;
        let corners = lattice.cell().vertices.iter();
        let far = corners.flat_map(|v| centers.iter().map(move |c| (v + c).norm()));
        Ok(Spread {
            kind,
            cells,
            n: set.len(),
            mean: Estimate::of(draws.iter().map(|draw| draw.0)),
            std: Estimate::of(draws.iter().map(|draw| draw.1)),
            exact_mean,
            exact_std: (square - exact_mean * exact_mean).sqrt(),
            // The nearest point is in the middle of a face.
            nearest: match cells {
                Cells::Own => 0.0,
                _ => lattice.packing_radius_m(),
            },
            farthest: far.fold(0.0, f64::max),
            density,
        })
    }

    pub fn range(&self) -> f64 {
        self.farthest - self.nearest
    }

    pub fn row(&self) -> Vec<Cell> {
        let names = [title(self.kind), self.cells.name()].map(Cell::from);
        let mut row = names.to_vec();
        row.push(self.n.into());
        row.push(Cell::Number(self.exact_mean, 4));
        row.extend(self.mean.cells(1.0, 5));
        row.push(Cell::Number(self.exact_std, 4));
        row.extend(self.std.cells(1.0, 5));
        row.extend(numbers(4, [self.nearest, self.farthest, self.range()]));
        row
    }

    pub fn curve(&self) -> Curve {
        let steps = self.density.iter().enumerate();
        let steps = steps.map(|(i, density)| ((i as f64 + 0.5) * BIN, *density));
        (color(self.kind), steps.collect())
    }
}
