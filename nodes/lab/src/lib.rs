//! The laboratory of Lattice: simulated machines and houses, the papers computed anew, evaluations and
//! benchmarks. A robot builds none of it.
#![deny(unsafe_code)]

pub mod bench;
pub mod datasets;
pub mod evaluate;
pub mod matching;
pub mod mesh;
pub mod metrics;
pub mod options;
pub mod paper;
mod plot;
pub mod printed;
pub mod random;
pub mod render;
pub mod simulate;
pub mod theory;
