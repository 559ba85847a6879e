//! Planes fitted to neighbourhoods.

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};

/// Squared magnitude relative to the fourth power of the scatter below which the closed form is imprecise.
const DEGENERATE: f64 = 1e-20;

/// Scatter (mean product of the deviations, m^2) of points.
pub(super) fn scatter(points_m: impl Iterator<Item = Point3<f64>>) -> Matrix3<f64> {
    let mut points_m = points_m.peekable();
    // Relative to the first point, so that coordinates far from the origin keep their digits.
    let Some(about) = points_m.peek().copied() else {
        return Matrix3::zeros();
    };
    let (mut count, mut sum) = (0.0, Vector3::zeros());
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
    for point in points_m {
        let d = point - about;
        count += 1.0;
        sum += d;
        xx += d.x * d.x;
        xy += d.x * d.y;
        xz += d.x * d.z;
        yy += d.y * d.y;
        yz += d.y * d.z;
        zz += d.z * d.z;
    }
    let mean = sum / count;
    let [xx, xy, xz, yy, yz, zz] = [
        xx / count - mean.x * mean.x,
        xy / count - mean.x * mean.y,
        xz / count - mean.x * mean.z,
        yy / count - mean.y * mean.y,
        yz / count - mean.y * mean.z,
        zz / count - mean.z * mean.z,
    ];
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// Unit eigenvector of the smallest eigenvalue of a scatter; its sign is arbitrary but deterministic.
pub(super) fn normal(scatter: &Matrix3<f64>) -> Vector3<f64> {
    let third = scatter.trace() / 3.0;
    if third.is_nan() || third <= 0.0 {
        return Vector3::z();
    }
    // Trigonometric eigenvalues of the scaled matrix (Smith 1961), then rows of S - lambda I across.
    let s = scatter / third;
    let b = s - Matrix3::identity();
    let p = (b.norm_squared() / 6.0).sqrt();
    if p < 1e-12 {
        return Vector3::z();
    }
    let half_det = (0.5 * b.determinant() / (p * p * p)).clamp(-1.0, 1.0);
    let angle = half_det.acos() / 3.0 + 2.0 * std::f64::consts::FRAC_PI_3;
    let m = b - Matrix3::from_diagonal_element(2.0 * p * angle.cos());
    let (r0, r1, r2) = (m.column(0), m.column(1), m.column(2));
    let mut best = r0.cross(&r1);
    for other in [r0.cross(&r2), r1.cross(&r2)] {
        if other.norm_squared() > best.norm_squared() {
            best = other;
        }
    }
    let squared = best.norm_squared();
    if squared > DEGENERATE.sqrt() {
        return best / squared.sqrt();
    }
    let eigen = SymmetricEigen::new(*scatter);
    let smallest = eigen.eigenvalues.imin();
    eigen.eigenvectors.column(smallest).into_owned()
}

/// Tests whether points with this scatter and extent are collinear, up to rounding.
pub(super) fn is_line(scatter: &Matrix3<f64>, largest_m: f64) -> bool {
    let mut eigenvalues = scatter.symmetric_eigenvalues();
    eigenvalues.as_mut_slice().sort_by(f64::total_cmp);
    let rounding_m = 1e-12 * largest_m;
    eigenvalues.y <= f64::max(1e-14 * eigenvalues.z, rounding_m * rounding_m)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_normal_is_the_eigenvector_of_the_smallest_eigenvalue(
            turn in prop::array::uniform3(-3.0f64..3.0),
            middle in 1e-6f64..1.0,
            least in 0.0f64..1.0,
            scale in 1e-6f64..1e6,
        ) {
            let turn = nalgebra::Rotation3::new(Vector3::from(turn));
            let values = Vector3::new(1.0, middle, middle * least);
            let scatter = turn * Matrix3::from_diagonal(&values) * turn.inverse() * scale;
            let n = normal(&scatter);
            prop_assert!((n.norm() - 1.0).abs() < 1e-12);
            let residual = (scatter * n - values.z * scale * n).norm() / scale;
            prop_assert!(residual < 1e-9, "{residual}");
        }
    }

    #[test]
    fn scatters_without_a_smallest_axis_give_a_unit_vector() {
        let line = Vector3::new(1.0, 2.0, -3.0);
        for scatter in [
            Matrix3::zeros(),
            Matrix3::identity(),
            line * line.transpose(),
            Matrix3::from_diagonal(&Vector3::new(1e-300, 0.0, 0.0)),
        ] {
            let n = normal(&scatter);
            assert!((n.norm() - 1.0).abs() < 1e-12, "{scatter} {n}");
            assert!((scatter * n).norm() <= scatter.norm() * (1.0 + 1e-12));
        }
        assert!(normal(&(line * line.transpose())).dot(&line).abs() < 1e-7);
    }

    #[test]
    fn scatter_far_from_the_origin_keeps_its_digits() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let points = points.map(|[x, y]| Point3::new(1e6 + x, y - 1e6, 1e6));
        let expected = Matrix3::from_diagonal(&Vector3::new(0.25, 0.25, 0.0));
        assert_eq!(scatter(points.into_iter()), expected);
    }
}
