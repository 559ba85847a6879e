//! Errors of positions.

use thiserror::Error;

/// A position that is not a place on or near the Earth.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum GeodesyError {
    /// A coordinate is NaN or infinite.
    #[error("{name} is {value}; drop the position until the receiver has a fix")]
    NotFinite {
        /// Name of the coordinate, with its unit.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The latitude is beyond a pole.
    #[error(
        "latitude {degrees} deg is not within -90..=90; check the unit and the order of latitude and longitude"
    )]
    Latitude {
        /// The refused latitude, degrees.
        degrees: f64,
    },
    /// The longitude is more than one turn.
    #[error("longitude {degrees} deg is not within -360..=360; check the unit")]
    Longitude {
        /// The refused longitude, degrees.
        degrees: f64,
    },
    /// The height is no height above the ellipsoid.
    #[error(
        "height {height_m} m is not within {min_m}..={max_m} m above the ellipsoid; check the unit"
    )]
    Height {
        /// The refused height, metres above the ellipsoid.
        height_m: f64,
        /// Lowest height taken, metres.
        min_m: f64,
        /// Highest height taken, metres.
        max_m: f64,
    },
    /// An ECEF point too near to, or too far from, the geocentre.
    #[error(
        "point is {radius_m} m from the geocentre, not within {min_m}..={max_m} m; check that it is ECEF in metres"
    )]
    Radius {
        /// Distance from the geocentre, metres.
        radius_m: f64,
        /// Shortest distance taken, metres.
        min_m: f64,
        /// Longest distance taken, metres.
        max_m: f64,
    },
}
