//! The laboratory: simulated machines, real logs.

mod evaluate_kitti;
mod house;
mod replay_kitti;
mod simulate;
