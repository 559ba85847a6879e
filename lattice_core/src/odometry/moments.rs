//! Moments of the points of a cell, as integers: exact, mergeable, subtractable.

use nalgebra::{Matrix3, Vector3};

/// Length of a unit, metres.
const UNIT_M: f64 = 1e-3;

/// Count, sums (mm from the centre of the cell) and second moments (mm^2) of points.
///
/// With offsets below 1 km, the moments of 2^23 points fit.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Moments {
    count: i64,
    sums: [i64; 3],
    /// Second moments xx, yy, zz, xy, xz, yz.
    products: [i64; 6],
}

impl Moments {
    /// Moments of one point, by its offset from the centre of its cell, metres.
    pub(super) fn of(offset_m: &Vector3<f64>) -> Moments {
        let [x, y, z] = [0, 1, 2].map(|i| (offset_m[i] / UNIT_M).round() as i64);
        Moments {
            count: 1,
            sums: [x, y, z],
            products: [x * x, y * y, z * z, x * y, x * z, y * z],
        }
    }

    /// Number of points.
    pub fn count(&self) -> i64 {
        self.count
    }

    /// Centroid relative to the centre of the cell, metres; zero without points.
    pub fn mean_m(&self) -> Vector3<f64> {
        let scale = UNIT_M / self.count.max(1) as f64;
        Vector3::from(self.sums.map(|sum| sum as f64 * scale))
    }

    /// Covariance about the centroid, m^2; zero without points.
    pub fn covariance_m2(&self) -> Matrix3<f64> {
        let scale = UNIT_M * UNIT_M / self.count.max(1) as f64;
        let [xx, yy, zz, xy, xz, yz] = self.products.map(|product| product as f64 * scale);
        let mean = self.mean_m();
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - mean * mean.transpose()
    }

    /// Moments about another point: offsets grow by `shift_m`, rounded to mm.
    pub(super) fn about(&self, shift_m: &Vector3<f64>) -> Moments {
        let [x, y, z] = [0, 1, 2].map(|i| (shift_m[i] / UNIT_M).round() as i64);
        let [a, b, c] = self.sums;
        let [xx, yy, zz, xy, xz, yz] = self.products;
        let n = self.count;
        Moments {
            count: n,
            sums: [a + n * x, b + n * y, c + n * z],
            products: [
                xx + 2 * a * x + n * x * x,
                yy + 2 * b * y + n * y * y,
                zz + 2 * c * z + n * z * z,
                xy + a * y + b * x + n * x * y,
                xz + a * z + c * x + n * x * z,
                yz + b * z + c * y + n * y * z,
            ],
        }
    }

    /// Adds `sign` times the moments of `other`.
    pub(super) fn add(&mut self, other: &Moments, sign: i64) {
        self.count += sign * other.count;
        for (to, from) in self.sums.iter_mut().zip(other.sums) {
            *to += sign * from;
        }
        for (to, from) in self.products.iter_mut().zip(other.products) {
            *to += sign * from;
        }
    }
}
