//! WGS84, ECEF, ENU, GPS time and headings.
//!
//! Geodetic heights are ellipsoidal. A map is the ENU frame at a fixed origin, never a
//! projection: it has no zones, no scale factor and no grid convergence.

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
