//! Correspondence of two points and its Mahalanobis distance.
//!
//! All vectors are along the axes of the target: q = T x, z = R (x - c), r = y - q, m = R n_s, where c is the centre
//! of the source.

use nalgebra::{Point3, Vector3};

/// Metric of the residual.
#[derive(Clone, Copy, Debug)]
pub(super) enum Metric {
    /// |r|^2.
    Points,
    /// r^T (C_t + R C_s R^T)^-1 r, where C = I - flatness n n^T.
    Planes { target: f64, source: f64 },
}

/// Information matrix of a correspondence: base I + a_weight a a^T + m_weight m m^T.
pub(super) struct Information {
    pub base: f64,
    pub a: Vector3<f64>,
    pub a_weight: f64,
    pub m_weight: f64,
    /// Determinant of the covariance, m^6.
    pub determinant: f64,
}

impl Metric {
    /// Inverse of 2 I - t n n^T - s m m^T by Woodbury's identity, which inverts only a 2 x 2 matrix.
    #[inline(always)]
    pub fn information(self, n: &Vector3<f64>, m: &Vector3<f64>) -> Information {
        match self {
            Metric::Points => Information {
                base: 1.0,
                a: Vector3::zeros(),
                a_weight: 0.0,
                m_weight: 0.0,
                determinant: 1.0,
            },
            Metric::Planes { target, source } => {
                let cross = n.dot(m) * (target * source).sqrt();
                let (t, s) = (2.0 - target, 2.0 - source);
                let inner = t * s - cross * cross;
                Information {
                    base: 0.5,
                    a: n * target.sqrt() + m * (source.sqrt() * cross / s),
                    a_weight: 0.5 * s / inner,
                    m_weight: 0.5 * source / s,
                    determinant: 2.0 * inner,
                }
            }
        }
    }

    /// Determinant of the covariance of two parallel planes, m^6.
    pub fn min_determinant(self) -> f64 {
        let axis = Vector3::z();
        self.information(&axis, &axis).determinant
    }
}

/// Correspondence along the axes of the target.
pub(super) struct Correspondence {
    /// Target point minus transformed source point, m.
    pub r: Vector3<f64>,
    /// Rotated source point, from the centre of the source, m.
    pub z: Vector3<f64>,
    /// Rotated source normal.
    pub m: Vector3<f64>,
    pub information: Information,
}

impl Correspondence {
    /// Correspondence of a source point, transformed to `q` with normal `m`, and a target point `y` with normal `n`;
    /// `center` is the transformed centre of the source.
    #[inline(always)]
    pub fn new(
        metric: Metric,
        center: &Vector3<f64>,
        (q, m): (&Point3<f64>, &Vector3<f64>),
        (y, n): (&Point3<f64>, &Vector3<f64>),
    ) -> Correspondence {
        Correspondence {
            r: y - q,
            z: q.coords - center,
            m: *m,
            information: metric.information(n, m),
        }
    }

    /// M r, 1/m.
    #[inline(always)]
    pub fn gradient(&self) -> Vector3<f64> {
        let i = &self.information;
        let along_a = i.a_weight * i.a.dot(&self.r);
        let along_m = i.m_weight * self.m.dot(&self.r);
        i.base * self.r + along_a * i.a + along_m * self.m
    }

    /// Squared Mahalanobis distance, r^T M r.
    #[inline(always)]
    pub fn squared(&self) -> f64 {
        let i = &self.information;
        let (along_a, along_m) = (i.a.dot(&self.r), self.m.dot(&self.r));
        i.base * self.r.norm_squared()
            + i.a_weight * along_a * along_a
            + i.m_weight * along_m * along_m
    }
}
