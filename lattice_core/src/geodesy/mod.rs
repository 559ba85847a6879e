//! WGS84, ECEF, ENU, GPS time and headings.
//!
//! Heights are ellipsoid heights. A map is an ENU frame at a fixed origin, not a projection: it has no zones, scale
//! factor or grid convergence.

mod enu;
mod error;
mod gps_time;
mod ins;
mod wgs84;

pub use enu::EnuFrame;
pub use error::GeodesyError;
pub use gps_time::utc_ns_from_gps;
pub use ins::{InsMount, enu_from_flu, yaw_rad_from_azimuth_deg};
pub use wgs84::{Geodetic, ecef_from_geodetic, geodetic_from_ecef};
