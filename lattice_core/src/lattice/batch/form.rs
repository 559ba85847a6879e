//! Lattices as forms of one kernel, in single precision.
//!
//! In coordinates `u = T w`, every lattice of the paper is Z^3, alone or with a second centred copy. The copy is
//! centred in the cuboid (BCC, MCC, FCC with c/a = 1, 2^(1/4), sqrt 2) or in its xy face (hex). The nearest point is
//! the rounded one, or that one moved by half a side along every centred axis towards the remainder, whichever is
//! nearer.

use std::num::Wrapping;

use nalgebra::Matrix3;

use crate::lattice::LatticeKind;

/// Integers of the kernel, which may wrap for undecided points.
pub(super) type Int = Wrapping<i32>;

/// Compile-time constants of a lattice.
pub(super) trait Form: Copy + Send + Sync + 'static {
    /// True if there is a second copy.
    const CENTRED: bool;
    /// True if the copy is also shifted along z.
    const CENTRED_Z: bool;

    /// Value of `weights . |rest|` above which the second copy is nearer.
    fn threshold(weights: [f32; 3]) -> f32;

    /// Index in the paper's basis from doubled coordinates.
    fn index(doubled: [Int; 3]) -> [Int; 3];
}

/// Z^3.
#[derive(Clone, Copy)]
pub(super) struct Cubic;
/// Centred cuboid with the paper's BCC basis.
#[derive(Clone, Copy)]
pub(super) struct Bcc;
/// Centred cuboid with the paper's FCC basis, its square rotated by 45 degrees.
#[derive(Clone, Copy)]
pub(super) struct Fcc;
/// Centred cuboid with the paper's MCC basis.
#[derive(Clone, Copy)]
pub(super) struct Mcc;
/// Prism over a centred rectangle.
#[derive(Clone, Copy)]
pub(super) struct Hex;

impl Form for Cubic {
    const CENTRED: bool = false;
    const CENTRED_Z: bool = false;

    fn threshold(_: [f32; 3]) -> f32 {
        f32::MAX
    }

    #[inline(always)]
    fn index([x, y, z]: [Int; 3]) -> [Int; 3] {
        [x >> 1, y >> 1, z >> 1]
    }
}

macro_rules! centred_cuboid {
    ($form:ident, $index:expr) => {
        impl Form for $form {
            const CENTRED: bool = true;
            const CENTRED_Z: bool = true;

            fn threshold(weights: [f32; 3]) -> f32 {
                0.25 * (weights[0] + weights[1] + weights[2])
            }

            #[inline(always)]
            fn index(doubled: [Int; 3]) -> [Int; 3] {
                $index(doubled)
            }
        }
    };
}

centred_cuboid!(Bcc, |[x, y, z]: [Int; 3]| [(x - z) >> 1, (y - z) >> 1, z]);
centred_cuboid!(Fcc, |[x, y, z]: [Int; 3]| [
    (x + z) >> 1,
    ((y - x) >> 1) - z,
    -z
]);
centred_cuboid!(Mcc, |[x, y, z]: [Int; 3]| [
    (x + z) >> 1,
    (x + y) >> 1,
    (y + z) >> 1
]);

impl Form for Hex {
    const CENTRED: bool = true;
    const CENTRED_Z: bool = false;

    fn threshold(weights: [f32; 3]) -> f32 {
        0.25 * (weights[0] + weights[1])
    }

    #[inline(always)]
    fn index([x, y, z]: [Int; 3]) -> [Int; 3] {
        [(x + y) >> 1, y, z >> 1]
    }
}

/// `T` with `u = T w` for index `w`, and the squared sides of the cuboid relative to the first; `None` for a lattice
/// without a form.
pub(super) fn axes(
    kind: LatticeKind,
    generator: &Matrix3<f64>,
) -> Option<(Matrix3<f64>, [f64; 3])> {
    let turn = match kind {
        LatticeKind::Cubic => Matrix3::identity(),
        LatticeKind::Bcc => Matrix3::new(1.0, 0.0, 0.5, 0.0, 1.0, 0.5, 0.0, 0.0, 0.5),
        LatticeKind::Fcc => Matrix3::new(1.0, 0.0, 0.5, 1.0, 1.0, -0.5, 0.0, 0.0, -0.5),
        LatticeKind::Mcc => 0.5 * Matrix3::new(1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0, 1.0),
        LatticeKind::Hex | LatticeKind::HexOptimal => {
            Matrix3::new(1.0, -0.5, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0)
        }
        LatticeKind::Custom => return None,
    };
    // Columns of G T^-1 are the sides of the cuboid.
    let sides = generator * turn.try_inverse()?;
    let squares = [0, 1, 2].map(|i| sides.column(i).norm_squared());
    Some((turn, squares))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Lattice;

    #[test]
    fn the_axes_are_at_right_angles() {
        for kind in LatticeKind::ALL {
            let generator = Lattice::new(kind, 1.0).unwrap().generator();
            let (turn, _) = axes(kind, &generator).unwrap();
            let sides = generator * turn.try_inverse().unwrap();
            let gram = sides.transpose() * sides;
            let off = gram - Matrix3::from_diagonal(&gram.diagonal());
            assert!(off.amax() < 1e-14, "{kind}: {gram}");
        }
    }

    #[test]
    fn indices_are_the_inverse_of_the_axes() {
        fn check<F: Form>(kind: LatticeKind) {
            let generator = Lattice::new(kind, 1.0).unwrap().generator();
            let (turn, _) = axes(kind, &generator).unwrap();
            for code in 0..7 * 7 * 7 {
                let w = [code % 7 - 3, code / 7 % 7 - 3, code / 49 - 3];
                let doubled = 2.0 * turn * nalgebra::Vector3::from(w.map(f64::from));
                let exact: [i32; 3] = [0, 1, 2].map(|i| doubled[i] as i32);
                assert_eq!(exact.map(f64::from), <[f64; 3]>::from(doubled));
                assert_eq!(F::index(exact.map(Wrapping)).map(|i| i.0), w, "{kind}");
            }
        }
        check::<Cubic>(LatticeKind::Cubic);
        check::<Bcc>(LatticeKind::Bcc);
        check::<Fcc>(LatticeKind::Fcc);
        check::<Mcc>(LatticeKind::Mcc);
        check::<Hex>(LatticeKind::Hex);
        check::<Hex>(LatticeKind::HexOptimal);
    }
}
