//! The laboratory: simulated machines, real logs.

mod cell_counts;
mod evaluate_kitti;
mod house;
mod printed_formulas;
mod replay_kitti;
mod simulate;
