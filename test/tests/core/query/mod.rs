//! Queries against brute force, on every lattice, near and far from the map origin.

mod clearance;
mod nearest;
mod path;
mod polyhedra;
mod worlds;
