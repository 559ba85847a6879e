//! The laboratory: simulated machines, real logs.

mod cell_counts;
mod evaluate_kitti;
mod free_space;
mod house;
mod printed_formulas;
mod replay_kitti;
mod scans;
mod simulate;
