//! Helpers of the tests.

pub mod python;
