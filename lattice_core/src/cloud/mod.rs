//! Point clouds: field access for any layout, per-point time, deskew.

mod points;

pub use points::Cloud;
