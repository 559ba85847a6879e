//! Errors of positions.

use thiserror::Error;

/// A position that is not a place on or near the Earth.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum GeodesyError {
    /// A coordinate is NaN or infinite.
    #[error("{name} is {value}; drop the position until the receiver has a fix")]
    NotFinite { name: &'static str, value: f64 },
    /// The latitude is beyond a pole.
    #[error(
        "latitude {degrees} deg is not within -90..=90; check the unit and the order of latitude and longitude"
    )]
    Latitude { degrees: f64 },
    /// The longitude is more than one turn.
    #[error("longitude {degrees} deg is not within -360..=360; check the unit")]
    Longitude { degrees: f64 },
    /// The height is no height above the ellipsoid.
    #[error(
        "height {height_m} m is not within {min_m}..={max_m} m above the ellipsoid; check the unit"
    )]
    Height {
        height_m: f64,
        min_m: f64,
        max_m: f64,
    },
    /// An ECEF point too near to, or too far from, the geocentre.
    #[error(
        "point is {radius_m} m from the geocentre, not within {min_m}..={max_m} m; check that it is ECEF in metres"
    )]
    Radius {
        radius_m: f64,
        min_m: f64,
        max_m: f64,
    },
}
