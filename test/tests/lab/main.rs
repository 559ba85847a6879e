//! The laboratory: simulated machines, real logs.

mod evaluate_kitti;
mod free_space;
mod house;
mod replay_kitti;
mod simulate;
