//! Exact generator matrices of unit cell volume.
//!
//! The paper prints eq. (8)-(12) to four digits, which would drift by a centimetre over 160 m. These are the closed
//! forms, computed by +, -, *, / and square roots only, so that every machine gives the same bits.

use nalgebra::Matrix3;

use super::LatticeKind;

/// Generator of unit determinant: columns are the basis, axes as in Ryde & Brünig eq. (8)-(12). The identity for
/// `Custom`.
pub(super) fn unit_generator(kind: LatticeKind) -> Matrix3<f64> {
    match kind {
        LatticeKind::Cubic | LatticeKind::Custom => Matrix3::identity(),
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
            prisms(a, a / 2.0_f64.sqrt())
        }
        LatticeKind::HexOptimal => {
            // Height that minimizes the mean squared error 5/18 A / sqrt(3) + h^2 / 12 for A h = 1.
            let root = 3.0_f64.sqrt();
            let h = cube_root(5.0 / (3.0 * root));
            prisms((2.0 / (root * h)).sqrt(), h)
        }
    }
}

/// Hexagonal prisms with centres `a` apart in the plane and `h` along z.
fn prisms(a: f64, h: f64) -> Matrix3<f64> {
    let y = 0.5 * 3.0_f64.sqrt() * a;
    Matrix3::new(a, -0.5 * a, 0.0, 0.0, y, 0.0, 0.0, 0.0, h)
}

/// Cube root of a positive normal number, bit-identical on every machine, unlike that of libm.
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
    fn the_best_prisms_have_the_known_sides() {
        let g = unit_generator(LatticeKind::HexOptimal);
        assert!((g.m11 - 1.0814837).abs() < 5e-8 && (g.m33 - 0.9872551).abs() < 5e-8);
        // Mean squared error of a hexagon of side a / sqrt 3, and of a height.
        let error = |a: f64, h: f64| (5.0 / 36.0 * a * a + h * h / 12.0) / 3.0;
        let at = |h: f64| error((2.0 / (3.0_f64.sqrt() * h)).sqrt(), h);
        let least = at(g.m33);
        assert!((least - 0.0812227).abs() < 5e-8, "{least}");
        assert!(at(0.999 * g.m33) > least && at(1.001 * g.m33) > least);
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
