//! Local east-north-up (ENU) frame at a fixed origin.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::{GeodesyError, Geodetic, ecef_from_geodetic, geodetic_from_ecef};

/// ENU frame tangent to the ellipsoid at its origin, metres.
///
/// ```
/// use lattice_core::geodesy::{EnuFrame, Geodetic};
///
/// let frame = EnuFrame::new(Geodetic::from_degrees(48.0, 11.0, 500.0)?);
/// let north = Geodetic::from_degrees(48.001, 11.0, 500.0)?;
/// let enu_m = frame.enu_from_geodetic(&north);
/// assert!((enu_m.y - 111.2).abs() < 0.1);
/// # Ok::<(), lattice_core::geodesy::GeodesyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnuFrame {
    origin: Geodetic,
    origin_ecef_m: Vector3<f64>,
    ecef_from_enu: Matrix3<f64>,
}

impl EnuFrame {
    /// Creates the frame at `origin`.
    pub fn new(origin: Geodetic) -> EnuFrame {
        EnuFrame {
            origin,
            origin_ecef_m: ecef_from_geodetic(&origin),
            ecef_from_enu: ecef_from_local_level(&origin),
        }
    }

    /// Origin of the frame.
    pub fn origin(&self) -> &Geodetic {
        &self.origin
    }

    /// ENU position of a geodetic place, metres.
    pub fn enu_from_geodetic(&self, place: &Geodetic) -> Vector3<f64> {
        self.ecef_from_enu
            .tr_mul(&(ecef_from_geodetic(place) - self.origin_ecef_m))
    }

    /// Geodetic place of an ENU position, metres; fails as [`geodetic_from_ecef`].
    pub fn geodetic_from_enu(&self, enu_m: &Vector3<f64>) -> Result<Geodetic, GeodesyError> {
        geodetic_from_ecef(&(self.origin_ecef_m + self.ecef_from_enu * enu_m))
    }

    /// Transform from this frame to ECEF, metres: `earth` from `map` of REP 105.
    pub fn ecef_from_enu(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.origin_ecef_m),
            quaternion(self.ecef_from_enu),
        )
    }

    /// Rotation from the local level axes at `place`, which an INS attitude refers to, to the axes of this frame; 9
    /// mrad at a distance of 57 km.
    pub fn enu_from_local_level(&self, place: &Geodetic) -> UnitQuaternion<f64> {
        quaternion(self.ecef_from_enu.tr_mul(&ecef_from_local_level(place)))
    }
}

/// Rotation from the local level axes (columns east, north, up) to ECEF.
fn ecef_from_local_level(place: &Geodetic) -> Matrix3<f64> {
    let (sin_lat, cos_lat) = place.latitude_rad.sin_cos();
    let (sin_lon, cos_lon) = place.longitude_rad.sin_cos();
    Matrix3::new(
        -sin_lon,
        -sin_lat * cos_lon,
        cos_lat * cos_lon,
        cos_lon,
        -sin_lat * sin_lon,
        cos_lat * sin_lon,
        0.0,
        cos_lat,
        sin_lat,
    )
}

fn quaternion(rotation: Matrix3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn local_up_leans_away_from_the_origin() {
        let karlsruhe = Geodetic::from_degrees(49.011, 8.416, 115.0).unwrap();
        let frame = EnuFrame::new(karlsruhe);
        assert!(frame.enu_from_local_level(frame.origin()).angle() < 1.0e-15);
        let east = frame
            .geodetic_from_enu(&Vector3::new(50_000.0, 0.0, 0.0))
            .unwrap();
        let up = frame.enu_from_local_level(&east) * Vector3::z();
        // 50 km over the radius of curvature of the prime vertical at 49 degrees.
        assert!((up.x - 50_000.0 / 6_390_000.0).abs() < 1.0e-5, "{up}");
        assert!(up.y.abs() < 1.0e-4, "{up}");
    }
}
