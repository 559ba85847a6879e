//! Exact generator matrices of unit cell volume.
//!
//! The paper prints eq. (8)-(12) to four digits; as a basis those would drift by a centimetre in
//! 160 m. Here are the closed forms behind them, by +, -, *, / and square roots only, so that every
//! machine gets the same bits.

use nalgebra::Matrix3;

use super::LatticeKind;

/// The generator of unit determinant, columns are the basis, axes as in Ryde & Brünig eq. (8)-(12).
pub(super) fn unit_generator(kind: LatticeKind) -> Matrix3<f64> {
    match kind {
        LatticeKind::Cubic => Matrix3::identity(),
        LatticeKind::Bcc => {
            let a = cube_root(2.0);
            let b = 0.5 * a;
            Matrix3::new(a, 0.0, b, 0.0, a, b, 0.0, 0.0, b)
        }
        LatticeKind::Fcc => {
            let f = cube_root(0.5);
            Matrix3::new(2.0 * f, f, 0.0, 0.0, -f, f, 0.0, 0.0, -f)
        }
        LatticeKind::Mcc => {
            // Cholesky factor of the Gram matrix of three half diagonals of the centred cuboid with
            // sides 2^(1/4), 2^(1/4), 2^(1/2): eq. (11) without its rounding.
            let root = 2.0_f64.sqrt();
            let s = (0.5 * (1.0 + root)).sqrt();
            let (g12, g13) = (-0.5 / s, 0.5 * (1.0 - root) / s);
            Matrix3::new(s, g12, g13, 0.0, 1.0, root - 2.0, 0.0, 0.0, 1.0 / s)
        }
        LatticeKind::Hex => {
            let a = (2.0 / cube_root(3.0)).sqrt();
            let (y, z) = (0.5 * 3.0_f64.sqrt() * a, a / 2.0_f64.sqrt());
            Matrix3::new(a, -0.5 * a, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
        }
    }
}

/// Cube root of a positive normal number, the same bits on every machine (libm's are not).
pub(super) fn cube_root(v: f64) -> f64 {
    let third = v.to_bits() / 3 + (1023_u64 << 52) / 3 * 2;
    let mut y = f64::from_bits(third);
    for _ in 0..6 {
        y -= (y * y * y - v) / (3.0 * y * y);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn determinants_are_one() {
        for kind in LatticeKind::ALL {
            let volume = unit_generator(kind).determinant();
            assert!((volume - 1.0).abs() < 1e-14, "{kind}: {volume}");
        }
    }

    #[test]
    fn rounds_to_the_digits_the_paper_prints() {
        let printed = |kind| match kind {
            LatticeKind::Cubic => [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            LatticeKind::Bcc => [1.2599, 0.0, 0.63, 0.0, 1.2599, 0.63, 0.0, 0.0, 0.63],
            LatticeKind::Fcc => [1.5874, 0.7937, 0.0, 0.0, -0.7937, 0.7937, 0.0, 0.0, -0.7937],
            LatticeKind::Mcc => [
                1.0987, -0.4551, -0.1885, 0.0, 1.0, -0.5858, 0.0, 0.0, 0.9102,
            ],
            LatticeKind::Hex => [1.1776, -0.5888, 0.0, 0.0, 1.0198, 0.0, 0.0, 0.0, 0.8327],
        };
        for kind in LatticeKind::ALL {
            let error = unit_generator(kind) - Matrix3::from_row_slice(&printed(kind));
            assert!(error.amax() < 0.5001e-4, "{kind}: {error}");
        }
    }

    #[test]
    fn cube_roots_are_right_over_the_allowed_range() {
        for exponent in -60..=60 {
            let v = 1.7 * 2.0_f64.powi(exponent);
            assert!((cube_root(v) / v.cbrt() - 1.0).abs() < 4e-16, "{v}");
        }
        assert_eq!(cube_root(0.125), 0.5);
        assert_eq!(cube_root(1.0), 1.0);
        assert_eq!(cube_root(1e9), 1000.0);
    }
}
