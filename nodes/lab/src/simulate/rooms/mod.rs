//! Rooms of labelled rectangles that a robot maps and a headset scans: small, and made in no time.

mod alike;
mod flat;

pub use flat::{Flat, LOOKS};
