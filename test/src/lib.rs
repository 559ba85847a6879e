//! Helpers of the tests.

pub mod clouds;
pub mod data;
pub mod python;
