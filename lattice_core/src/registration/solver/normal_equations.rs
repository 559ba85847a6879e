//! Normal equations of correspondences.
//!
//! All vectors are along the axes of the target: q = T x, z = R (x - c), r = y - q, m = R n_s, where c is the centre
//! of the source. A step (rho, phi) changes r to r - rho - phi x z, so J = [-I, [z]x]. With the axes rotated by R^T,
//! this is the right perturbation about the centre, T C Exp(delta) C^-1, where C translates by c.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3, Vector6};

use super::correspondence::Correspondence;
use super::robust_kernel::Kernel;

/// Accumulated normal equations.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NormalEquations {
    pub cost: f64,
    /// Sum of the kernel weights, and of these times |r|^2.
    pub weight: f64,
    pub squared_m2: f64,
    /// Number of source points with a correspondence of positive weight.
    pub inliers: usize,
    pub pairs: usize,
    /// Upper triangle, by rows, of the rank-one terms.
    h: [f64; 21],
    b: [f64; 6],
    /// Sums of w base, w base z and w base z z^T (upper triangle).
    base: [f64; 10],
}

impl NormalEquations {
    /// Adds a correspondence. `turn` is the flatness of the source covariance if the gradient includes its rotation,
    /// else 0.
    #[inline(always)]
    pub fn add(&mut self, pair: &Correspondence, weight: f64, kernel: Kernel, turn: f64) {
        let g = pair.gradient();
        let (cost, slope) = kernel.apply(weight, pair.r.dot(&g));
        self.cost += cost;
        self.weight += slope;
        self.squared_m2 += slope * pair.r.norm_squared();
        self.pairs += 1;

        let z = &pair.z;
        // (z + R C_s R^T g) x g, where C_s = I - turn m m^T
        let mut torque = z.cross(&g);
        if turn != 0.0 {
            torque -= (turn * pair.m.dot(&g)) * pair.m.cross(&g);
        }
        for axis in 0..3 {
            self.b[axis] -= slope * g[axis];
            self.b[3 + axis] -= slope * torque[axis];
        }

        let i = &pair.information;
        let w = slope * i.base;
        let wz = w * z;
        let base = [
            w,
            wz.x,
            wz.y,
            wz.z,
            wz.x * z.x,
            wz.x * z.y,
            wz.x * z.z,
            wz.y * z.y,
            wz.y * z.z,
            wz.z * z.z,
        ];
        for (sum, term) in self.base.iter_mut().zip(base) {
            *sum += term;
        }
        self.add_rank_one(slope * i.a_weight, &i.a, z);
        self.add_rank_one(slope * i.m_weight, &pair.m, z);
    }

    /// Adds w v v^T, v = (a, z x a).
    #[inline(always)]
    fn add_rank_one(&mut self, w: f64, a: &Vector3<f64>, z: &Vector3<f64>) {
        let arm = z.cross(a);
        let v = [a.x, a.y, a.z, arm.x, arm.y, arm.z];
        let mut sums = self.h.iter_mut();
        for (row, value) in v.iter().enumerate() {
            for (other, sum) in v[row..].iter().zip(sums.by_ref()) {
                *sum += w * value * other;
            }
        }
    }

    /// Adds other normal equations; the order of the additions is that of the calls.
    pub fn merge(mut self, other: &NormalEquations) -> NormalEquations {
        self.cost += other.cost;
        self.weight += other.weight;
        self.squared_m2 += other.squared_m2;
        self.inliers += other.inliers;
        self.pairs += other.pairs;
        let arrays: [(&mut [f64], &[f64]); 3] = [
            (&mut self.h, &other.h),
            (&mut self.b, &other.b),
            (&mut self.base, &other.base),
        ];
        for (to, from) in arrays {
            for (to, from) in to.iter_mut().zip(from) {
                *to += from;
            }
        }
        self
    }

    /// Hessian and half gradient of the cost by the right perturbation (rho, phi) of the pose about the centre.
    pub fn system(&self, pose: &Isometry3<f64>) -> (Matrix6<f64>, Vector6<f64>) {
        let mut h = Matrix6::zeros();
        let mut at = 0;
        for row in 0..6 {
            for column in row..6 {
                h[(row, column)] = self.h[at];
                h[(column, row)] = self.h[at];
                at += 1;
            }
        }
        let [w, x, y, z, xx, xy, xz, yy, yz, zz] = self.base;
        let skew = Vector3::new(x, y, z).cross_matrix();
        let outer = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let turning = Matrix3::from_diagonal_element(outer.trace()) - outer;
        let parts = [
            (0, 0, Matrix3::from_diagonal_element(w)),
            (0, 3, -skew),
            (3, 0, skew),
            (3, 3, turning),
        ];
        for (row, column, part) in parts {
            let mut view = h.fixed_view_mut::<3, 3>(row, column);
            view += part;
        }
        let back = pose.rotation.inverse().to_rotation_matrix().into_inner();
        let mut axes = Matrix6::zeros();
        axes.fixed_view_mut::<3, 3>(0, 0).copy_from(&back);
        axes.fixed_view_mut::<3, 3>(3, 3).copy_from(&back);
        (axes * h * axes.transpose(), axes * Vector6::from(self.b))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, SMatrix};
    use proptest::prelude::*;

    use super::*;
    use crate::pose::se3;
    use crate::registration::solver::correspondence::Metric;

    /// A pair as its points and normals in their own frames.
    #[derive(Clone, Debug)]
    struct Raw {
        x: Point3<f64>,
        y: Point3<f64>,
        normals: [Vector3<f64>; 2],
        pose: Isometry3<f64>,
        flat: [f64; 2],
    }

    impl Raw {
        fn metric(&self) -> Metric {
            let [target, source] = self.flat;
            Metric::Planes { target, source }
        }

        fn pair(&self, pose: &Isometry3<f64>) -> Correspondence {
            let (q, m) = (pose * self.x, pose.rotation * self.normals[0]);
            let p = pose.translation.vector;
            Correspondence::new(self.metric(), &p, (&q, &m), (&self.y, &self.normals[1]))
        }

        /// (C_t + R C_s R^T)^-1 as it is written.
        fn inverse(&self, pose: &Isometry3<f64>) -> Matrix3<f64> {
            let plane =
                |n: &Vector3<f64>, flat: f64| Matrix3::identity() - flat * n * n.transpose();
            let r = pose.rotation.to_rotation_matrix();
            let source = r * plane(&self.normals[0], self.flat[1]) * r.inverse();
            let c = plane(&self.normals[1], self.flat[0]) + source;
            c.try_inverse().unwrap()
        }

        fn squared(&self, pose: &Isometry3<f64>) -> f64 {
            let r = self.y - pose * self.x;
            r.dot(&(self.inverse(pose) * r))
        }
    }

    fn raw() -> impl Strategy<Value = Raw> {
        let vector = || prop::array::uniform3(-2.0f64..2.0);
        let flat = || prop_oneof![0.5f64..0.9, Just(0.999)];
        (
            (vector(), vector()),
            (vector(), vector()),
            (vector(), vector()),
            (flat(), flat()),
        )
            .prop_filter("normals", |(_, (a, b), ..)| {
                Vector3::from(*a).norm() > 0.1 && Vector3::from(*b).norm() > 0.1
            })
            .prop_map(|((x, y), (a, b), (t, phi), (c, d))| Raw {
                x: x.into(),
                y: y.into(),
                normals: [a, b].map(|n| Vector3::from(n).normalize()),
                pose: Isometry3::new(t.into(), phi.into()),
                flat: [c, d],
            })
    }

    fn kernels() -> [Kernel; 4] {
        [
            Kernel::None,
            Kernel::Cauchy { a2: 9.0 },
            Kernel::CauchyAround { a2: 9.0 },
            Kernel::CauchyOfSquare { a2: 2.25 },
        ]
    }

    proptest! {
        #[test]
        fn the_squared_distance_is_that_of_the_written_out_inverse(raw in raw()) {
            let pair = raw.pair(&raw.pose);
            let expected = raw.squared(&raw.pose);
            prop_assert!((pair.squared() - expected).abs() < 1e-9 * (1.0 + expected));
            let inverse = raw.inverse(&raw.pose);
            let pull = inverse * pair.r;
            prop_assert!((pair.gradient() - pull).norm() < 1e-9 * (1.0 + pull.norm()));
            let determinant = 1.0 / inverse.determinant();
            prop_assert!((pair.information.determinant / determinant - 1.0).abs() < 1e-9);
        }

        #[test]
        fn the_gradient_is_the_numeric_one(raw in raw(), weight in 0.1f64..2.0) {
            for kernel in kernels() {
                let mut sums = NormalEquations::default();
                sums.add(&raw.pair(&raw.pose), weight, kernel, raw.flat[1]);
                let (_, half) = sums.system(&raw.pose);
                let cost = |axis: usize, by: f64| {
                    let mut step = Vector6::zeros();
                    step[axis] = by;
                    kernel.apply(weight, raw.squared(&(raw.pose * se3::exp(&step)))).0
                };
                let h = 1e-4;
                for axis in 0..6 {
                    // Central differences, extrapolated once more.
                    let slope = |h: f64| (cost(axis, h) - cost(axis, -h)) / (2.0 * h);
                    let numeric = (4.0 * slope(h / 2.0) - slope(h)) / 3.0;
                    let analytic = 2.0 * half[axis];
                    let size = 1.0 + half.norm() + sums.cost;
                    prop_assert!(
                        (numeric - analytic).abs() < 1e-7 * size,
                        "{kernel:?} {axis}: {numeric} {analytic}"
                    );
                }
            }
        }

        #[test]
        fn the_hessian_is_jacobian_times_information_times_jacobian(raw in raw(), weight in 0.1f64..2.0) {
            let kernel = Kernel::Cauchy { a2: 9.0 };
            let mut sums = NormalEquations::default();
            sums.add(&raw.pair(&raw.pose), weight, kernel, 0.0);
            let (h, b) = sums.system(&raw.pose);
            let rotation = raw.pose.rotation.to_rotation_matrix().into_inner();
            let mut j: SMatrix<f64, 3, 6> = SMatrix::zeros();
            j.fixed_view_mut::<3, 3>(0, 0).copy_from(&-rotation);
            let arm = rotation * raw.x.coords.cross_matrix();
            j.fixed_view_mut::<3, 3>(0, 3).copy_from(&arm);
            let m = raw.inverse(&raw.pose);
            let slope = kernel.apply(weight, raw.squared(&raw.pose)).1;
            let expected = slope * j.transpose() * m * j;
            prop_assert!((h - expected).norm() < 1e-9 * (1.0 + expected.norm()));
            let r = raw.y - raw.pose * raw.x;
            let expected = slope * j.transpose() * m * r;
            prop_assert!((b - expected).norm() < 1e-9 * (1.0 + expected.norm()));
        }
    }
}
