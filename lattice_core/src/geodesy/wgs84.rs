//! WGS84 ellipsoid: geodetic coordinates to ECEF and back.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::GeodesyError;

/// Semi-major axis of WGS84, metres.
const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;
/// Flattening of WGS84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

const SEMI_MINOR_AXIS_M: f64 = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING);
/// First eccentricity squared.
const E2: f64 = FLATTENING * (2.0 - FLATTENING);
/// Second eccentricity squared.
const EP2: f64 = E2 / (1.0 - E2);

/// Accepted heights; others have a wrong unit.
const MIN_HEIGHT_M: f64 = -1.0e5;
const MAX_HEIGHT_M: f64 = 1.0e7;
/// The same bounds as distances from the geocentre, with a margin for poles and equator.
const MIN_RADIUS_M: f64 = 6.2e6;
const MAX_RADIUS_M: f64 = 1.7e7;
/// Iterations of Bowring's formula that reach rounding accuracy within the bounds above.
const BOWRING_STEPS: usize = 3;

/// Position on WGS84: geodetic latitude, longitude, ellipsoid height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Geodetic {
    /// Latitude, radians, north positive.
    pub latitude_rad: f64,
    /// Longitude, radians, east positive.
    pub longitude_rad: f64,
    /// Ellipsoid height, metres (not above the geoid).
    pub height_m: f64,
}

impl Geodetic {
    /// Creates a position from degrees and metres above the ellipsoid; longitudes of -360..=360 are wrapped to
    /// -180..=180.
    pub fn from_degrees(
        latitude_deg: f64,
        longitude_deg: f64,
        height_m: f64,
    ) -> Result<Geodetic, GeodesyError> {
        finite("latitude in degrees", latitude_deg)?;
        finite("longitude in degrees", longitude_deg)?;
        finite("height in metres", height_m)?;
        if latitude_deg.abs() > 90.0 {
            return Err(GeodesyError::Latitude {
                degrees: latitude_deg,
            });
        }
        if longitude_deg.abs() > 360.0 {
            return Err(GeodesyError::Longitude {
                degrees: longitude_deg,
            });
        }
        check_height(height_m)?;
        let turned_deg = if longitude_deg > 180.0 {
            longitude_deg - 360.0
        } else if longitude_deg < -180.0 {
            longitude_deg + 360.0
        } else {
            longitude_deg
        };
        Ok(Geodetic {
            latitude_rad: latitude_deg.to_radians(),
            longitude_rad: turned_deg.to_radians(),
            height_m,
        })
    }

    /// Latitude in degrees, north positive.
    pub fn latitude_deg(&self) -> f64 {
        self.latitude_rad.to_degrees()
    }

    /// Longitude in degrees, east positive.
    pub fn longitude_deg(&self) -> f64 {
        self.longitude_rad.to_degrees()
    }
}

/// ECEF coordinates of a position, metres; exact up to rounding.
pub fn ecef_from_geodetic(place: &Geodetic) -> Vector3<f64> {
    let (sin_lat, cos_lat) = place.latitude_rad.sin_cos();
    let (sin_lon, cos_lon) = place.longitude_rad.sin_cos();
    let normal_m = SEMI_MAJOR_AXIS_M / (1.0 - E2 * sin_lat * sin_lat).sqrt();
    let horizontal_m = (normal_m + place.height_m) * cos_lat;
    Vector3::new(
        horizontal_m * cos_lon,
        horizontal_m * sin_lon,
        (normal_m * (1.0 - E2) + place.height_m) * sin_lat,
    )
}

/// Geodetic position of ECEF coordinates in metres, by iterating Bowring's (1976) formula on the parametric latitude.
///
/// At the poles the longitude is that of `atan2`, zero on the axis. Fails if not finite, or more than 100 km below or
/// 10 000 km above the ellipsoid.
pub fn geodetic_from_ecef(ecef_m: &Vector3<f64>) -> Result<Geodetic, GeodesyError> {
    finite("ECEF x in metres", ecef_m.x)?;
    finite("ECEF y in metres", ecef_m.y)?;
    finite("ECEF z in metres", ecef_m.z)?;
    let axis_distance_m = ecef_m.x.hypot(ecef_m.y);
    let radius_m = axis_distance_m.hypot(ecef_m.z);
    if !(MIN_RADIUS_M..=MAX_RADIUS_M).contains(&radius_m) {
        return Err(GeodesyError::Radius {
            radius_m,
            min_m: MIN_RADIUS_M,
            max_m: MAX_RADIUS_M,
        });
    }
    let mut parametric_rad = ecef_m.z.atan2((1.0 - FLATTENING) * axis_distance_m);
    let mut latitude_rad = parametric_rad;
    for _ in 0..BOWRING_STEPS {
        let (sin_b, cos_b) = parametric_rad.sin_cos();
        latitude_rad = (ecef_m.z + EP2 * SEMI_MINOR_AXIS_M * sin_b.powi(3))
            .atan2(axis_distance_m - E2 * SEMI_MAJOR_AXIS_M * cos_b.powi(3));
        let (sin_lat, cos_lat) = latitude_rad.sin_cos();
        parametric_rad = ((1.0 - FLATTENING) * sin_lat).atan2(cos_lat);
    }
    let (sin_lat, cos_lat) = latitude_rad.sin_cos();
    // Second order in the error of the latitude, and regular at poles and equator.
    let height_m = axis_distance_m * cos_lat + ecef_m.z * sin_lat
        - SEMI_MAJOR_AXIS_M * (1.0 - E2 * sin_lat * sin_lat).sqrt();
    check_height(height_m)?;
    Ok(Geodetic {
        latitude_rad,
        longitude_rad: ecef_m.y.atan2(ecef_m.x),
        height_m,
    })
}

fn finite(name: &'static str, value: f64) -> Result<(), GeodesyError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(GeodesyError::NotFinite { name, value })
    }
}

fn check_height(height_m: f64) -> Result<(), GeodesyError> {
    if (MIN_HEIGHT_M..=MAX_HEIGHT_M).contains(&height_m) {
        Ok(())
    } else {
        Err(GeodesyError::Height {
            height_m,
            min_m: MIN_HEIGHT_M,
            max_m: MAX_HEIGHT_M,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn the_poles_are_exact() {
        for sign in [1.0, -1.0] {
            let ecef = Vector3::new(0.0, 0.0, sign * (SEMI_MINOR_AXIS_M + 100.0));
            let found = geodetic_from_ecef(&ecef).unwrap();
            assert_eq!(found.latitude_rad, sign * FRAC_PI_2);
            assert_eq!(found.longitude_rad, 0.0);
            assert!((found.height_m - 100.0).abs() < 1.0e-8);
        }
    }

    #[test]
    fn the_geocentre_and_space_are_refused() {
        let x = |x: f64| geodetic_from_ecef(&Vector3::new(x, 0.0, 0.0)).unwrap_err();
        for far in [0.0, 1.0e-300, 43_000.0, 6.0e6, f64::MAX] {
            assert!(matches!(x(far), GeodesyError::Radius { .. }), "{far}");
        }
        let too_deep = x(SEMI_MAJOR_AXIS_M - 1.1e5);
        assert!(matches!(too_deep, GeodesyError::Height { .. }));
        assert!(matches!(x(f64::NAN), GeodesyError::NotFinite { .. }));
    }

    #[test]
    fn degrees_are_checked() {
        let error = |lat, lon, height| Geodetic::from_degrees(lat, lon, height).unwrap_err();
        use GeodesyError as E;
        assert!(matches!(error(90.1, 0.0, 0.0), E::Latitude { .. }));
        assert!(matches!(error(0.0, 361.0, 0.0), E::Longitude { .. }));
        assert!(matches!(error(0.0, 0.0, 1.0e9), E::Height { .. }));
        let infinite = error(0.0, f64::INFINITY, 0.0);
        assert!(matches!(infinite, E::NotFinite { .. }));
        let turned = |lon| {
            Geodetic::from_degrees(0.0, lon, 0.0)
                .unwrap()
                .longitude_deg()
        };
        assert_eq!((turned(350.0), turned(-190.0)), (-10.0, 170.0));
    }
}
