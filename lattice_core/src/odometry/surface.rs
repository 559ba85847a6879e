//! The surface in a cell: a plane where its points lie in one, else a point.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::moments::Moments;

/// Minimum number of points of a plane: two more than determine it and its thickness.
const PLANE_POINTS: i64 = 6;
/// Ratio of the smallest to the middle eigenvalue below which points form a plane.
const PLANE_FLATNESS: f64 = 0.1;
/// Standard deviation of a return about a plane, by noise of ranges and poses, metres.
const PLANE_NOISE_M: f64 = 0.03;
/// Minimum standard deviation of the points of a plane in both of its directions, metres: returns of one beam lie on
/// a line as wide as their noise, and the plane through it has a random normal. Twice as much would exclude recesses
/// of 0.15 m, which constrain motion along a corridor.
const LEAST_WIDTH_M: f64 = PLANE_NOISE_M;
/// Information along a plane, as a fraction of that of a point: the position of a centroid in its plane is arbitrary.
const ALONG_PLANE: f64 = 0.05;

/// Plane with the uncertainty of its normal.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub normal: Vector3<f64>,
    /// Variance of a return across the plane, m^2.
    pub across_m2: f64,
    /// Covariance of the normal: of a plane fitted to `n` points, `(λ0 + ε²) / ((n - 3) λ)` along each axis in the
    /// plane. `ε` keeps a few points that lie in a plane by chance from a certain normal.
    pub tilt: Matrix3<f64>,
}

/// Surface of a cell, for points near it.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// Centroid, metres.
    pub mean_m: Vector3<f64>,
    /// Information of a residual from the centroid, m^-2.
    pub information: Matrix3<f64>,
    pub plane: Option<Plane>,
}

impl Surface {
    /// Surface of a cell with its centre and cell size, metres.
    ///
    /// A plane has the information `n nᵀ / (λ0 + ε²)` across. A point that is anywhere in the cell has the variance
    /// `side² / 12` in each axis.
    pub fn of(moments: &Moments, center_m: &Vector3<f64>, side_m: f64) -> Surface {
        let own = Surface {
            mean_m: center_m + moments.mean_m(),
            information: Matrix3::identity() * isotropic(side_m),
            plane: None,
        };
        own.with_plane_of(moments, side_m)
    }

    /// Surface with the orientation of a plane through its points and those around it, if they form one.
    pub fn with_plane_of(mut self, moments: &Moments, side_m: f64) -> Surface {
        if moments.count() < PLANE_POINTS {
            return self;
        }
        let eigen = SymmetricEigen::new(moments.covariance_m2());
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let [l0, l1, l2] = order.map(|i| eigen.eigenvalues[i].max(0.0));
        let [v0, v1, v2] = order.map(|i| eigen.eigenvectors.column(i).into_owned());
        if l0 < PLANE_FLATNESS * l1 && l1 > LEAST_WIDTH_M * LEAST_WIDTH_M {
            let across_m2 = l0 + PLANE_NOISE_M * PLANE_NOISE_M;
            let normal = v0 * v0.transpose();
            let along = ALONG_PLANE * isotropic(side_m);
            self.information = normal / across_m2 + (Matrix3::identity() - normal) * along;
            let thickness = across_m2 / (moments.count() - 3) as f64;
            let tilt =
                v1 * v1.transpose() * (thickness / l1) + v2 * v2.transpose() * (thickness / l2);
            self.plane = Some(Plane {
                normal: v0,
                across_m2,
                tilt,
            });
        }
        self
    }
}

/// Information of a point that is anywhere in a cell: the variance is `side² / 12` in each axis.
fn isotropic(side_m: f64) -> f64 {
    12.0 / (side_m * side_m)
}
