//! Benchmarks: their input, their clock and what they print.
//!
//! A point file is little-endian f32 `x y z i`, 16 bytes a point. `FILE.scans` beside it says which points
//! belong to one scan: records of 32 bytes, three f64 (position of the scanner, m) and a u64 (points).

mod camera;
mod clock;
mod file;
mod hash26;
mod insert;
mod neighbors;
mod points;
mod quantize;
mod raycast;
mod register;
mod report;
mod segment;
mod site;
mod transport;

pub use camera::{CameraReport, CameraSetup, camera};
pub(crate) use clock::{Spent, timed};
pub use file::{FileMethod, file};
pub use insert::{Store, insert};
pub use neighbors::{NeighborMethod, neighbors};
pub use points::{ScanRecord, read_points, read_scans};
pub use quantize::{QuantizeMethod, QuantizeOutput, quantize};
pub use raycast::{RaycastMethod, raycast};
pub use register::{RegisterSetup, register};
pub use report::Report;
pub use segment::{SegmentReport, segment};
pub use site::{SiteOptions, SiteSummary, write_site};
pub use transport::{Received, TransportReport, TransportSetup, listen, send};
