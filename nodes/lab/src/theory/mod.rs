//! Figures of merit of lattice cells, which the papers compare.

mod clearance;
mod figures;

pub use clearance::{clearance_stencil, distance_between_cells_m, touching_clearance_m};
pub use figures::{mean_distance_m, mean_width_m, second_moment, surface_m2};
