//! Point cloud in the map frame: an exact datum and short offsets.

use nalgebra::Vector3;

/// Points in the map frame (ENU, metres) with one stamp.
///
/// A point is `datum_m + offset`. The datum is in f64, so that offsets in f32 keep millimetres far from the map
/// origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// Time of the cloud, nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// Datum of the offsets in the map frame, metres.
    pub datum_m: Vector3<f64>,
    /// Offsets from the datum, metres.
    pub offsets_m: Vec<[f32; 3]>,
}

impl Cloud {
    /// Cloud of `points_m` (map frame, metres) stored relative to `datum_m`.
    pub fn from_points(stamp_ns: i64, datum_m: Vector3<f64>, points_m: &[Vector3<f64>]) -> Cloud {
        let offsets_m = points_m
            .iter()
            .map(|p| {
                let d = p - datum_m;
                [d.x as f32, d.y as f32, d.z as f32]
            })
            .collect();
        Cloud {
            stamp_ns,
            datum_m,
            offsets_m,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.offsets_m.len()
    }

    /// Tests whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.offsets_m.is_empty()
    }

    /// Point `i` in the map frame, metres; NaN if `i` is not below [`Cloud::len`].
    pub fn point_m(&self, i: usize) -> Vector3<f64> {
        match self.offsets_m.get(i) {
            Some(offset) => self.datum_m + widen(offset),
            None => Vector3::repeat(f64::NAN),
        }
    }

    /// All points in the map frame, metres, in order.
    pub fn points_m(&self) -> impl ExactSizeIterator<Item = Vector3<f64>> + '_ {
        self.offsets_m.iter().map(|o| self.datum_m + widen(o))
    }
}

fn widen(offset: &[f32; 3]) -> Vector3<f64> {
    let [x, y, z] = *offset;
    Vector3::new(f64::from(x), f64::from(y), f64::from(z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_far_datum_keeps_millimetres() {
        let datum = Vector3::new(4.0e6, -3.0e6, 250.0);
        let p = datum + Vector3::new(12.345_678, -98.765_432, 1.234_567);
        let cloud = Cloud::from_points(7, datum, &[p]);
        assert!((cloud.point_m(0) - p).norm() < 1.0e-5);
        assert_eq!(cloud.points_m().collect::<Vec<_>>(), vec![cloud.point_m(0)]);
    }

    #[test]
    fn a_point_that_is_not_there_is_nan() {
        let cloud = Cloud::from_points(0, Vector3::zeros(), &[]);
        assert!(cloud.is_empty());
        assert!(cloud.point_m(0).x.is_nan());
    }
}
