//! Errors of geodetic positions.

use thiserror::Error;

/// Reason that a position is not on or near the Earth.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum GeodesyError {
    /// NaN or infinite coordinate.
    #[error("{name} is {value}; drop the position until the receiver has a fix")]
    NotFinite { name: &'static str, value: f64 },
    /// Latitude beyond a pole.
    #[error(
        "latitude {degrees} deg is not within -90..=90; check the unit and the order of latitude and longitude"
    )]
    Latitude { degrees: f64 },
    /// Longitude beyond a full turn.
    #[error("longitude {degrees} deg is not within -360..=360; check the unit")]
    Longitude { degrees: f64 },
    /// Ellipsoid height out of range.
    #[error(
        "height {height_m} m is not within {min_m}..={max_m} m above the ellipsoid; check the unit"
    )]
    Height {
        height_m: f64,
        min_m: f64,
        max_m: f64,
    },
    /// ECEF position out of range.
    #[error(
        "point is {radius_m} m from the geocentre, not within {min_m}..={max_m} m; check that it is ECEF in metres"
    )]
    Radius {
        radius_m: f64,
        min_m: f64,
        max_m: f64,
    },
}
