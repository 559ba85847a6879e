//! Exact nearest lattice points in closed form.
//!
//! Each form uses coordinates `u` in which the lattice is an integer lattice, a centred one, or the even-sum lattice
//! D3. It returns the index in the paper's basis. Only +, -, *, comparisons and rounding half to even are used, so
//! every machine gives the same bits. On a cell border: half to even, the uncentred coset, the lowest axis.

/// Addend that leaves a double, rounded half to even, as an integer in its low bits.
const ROUND: f64 = 1.5 * (1_u64 << 52) as f64;

/// Largest accepted coordinate, far beyond any index that fits a key.
const REACH: f64 = (1_u64 << 48) as f64;

/// Coordinate split into its nearest integer and the remainder in [-1/2, 1/2].
#[derive(Clone, Copy)]
pub(super) struct Split {
    pub(super) near: i64,
    pub(super) rest: f64,
}

/// Nearest integer, half to even, for |u| < 2^51.
#[inline(always)]
pub(crate) fn nearest_integer(u: f64) -> i64 {
    ((u + ROUND).to_bits() as i64).wrapping_sub(ROUND.to_bits() as i64)
}

#[inline(always)]
pub(super) fn split(u: f64) -> Split {
    Split {
        near: nearest_integer(u),
        rest: u - ((u + ROUND) - ROUND),
    }
}

impl Split {
    /// Sign of the remainder; + for zero.
    #[inline(always)]
    fn sign(self) -> i64 {
        if self.rest < 0.0 { -1 } else { 1 }
    }
}

/// False for NaN and beyond `REACH`.
#[inline(always)]
pub(super) fn within_reach(u: [f64; 3]) -> bool {
    (u[0].abs() < REACH) & (u[1].abs() < REACH) & (u[2].abs() < REACH)
}

/// Nearest-point function, selected once per batch.
pub(super) trait ClosedForm: Copy {
    /// Index of the lattice point nearest to `p` (metres); `None` if not finite or out of range.
    fn nearest(self, p: [f64; 3]) -> Option<[i64; 3]>;
}

/// Z^3.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cubic {
    pub(super) per_metre: f64,
}

impl ClosedForm for Cubic {
    #[inline(always)]
    fn nearest(self, p: [f64; 3]) -> Option<[i64; 3]> {
        let u = p.map(|x| x * self.per_metre);
        within_reach(u).then(|| u.map(|u| split(u).near))
    }
}

/// Doubled coordinates (all even or all odd) of the nearest point of Z^3 or Z^3 + 1/2, with axis weights `weights`.
///
/// The centred point is nearer if the weighted remainders exceed a quarter of the weights: it changes the squared
/// distance by sum weight (1/4 - |rest|).
#[inline(always)]
fn centred(u: [f64; 3], z_weight: f64) -> [i64; 3] {
    let [x, y, z] = u.map(split);
    let rests = x.rest.abs() + y.rest.abs() + z_weight * z.rest.abs();
    let odd = i64::from(rests > 0.25 * (2.0 + z_weight));
    [x, y, z].map(|s| 2 * s.near + odd * s.sign())
}

/// Body-centred cubic lattice in the axes of the paper.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bcc {
    pub(super) per_metre: f64,
}

impl ClosedForm for Bcc {
    #[inline(always)]
    fn nearest(self, p: [f64; 3]) -> Option<[i64; 3]> {
        let u = p.map(|x| x * self.per_metre);
        within_reach(u).then(|| {
            let [x, y, z] = centred(u, 1.0);
            [(x - z) >> 1, (y - z) >> 1, z]
        })
    }
}

/// Mean-centred cuboidal lattice: centred tetragonal with c/a = 2^(1/4), in axes rotated by `turn`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mcc {
    pub(super) turn: [[f64; 3]; 3],
}

impl ClosedForm for Mcc {
    #[inline(always)]
    fn nearest(self, p: [f64; 3]) -> Option<[i64; 3]> {
        let u = self
            .turn
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
        within_reach(u).then(|| {
            let [x, y, z] = centred(u, std::f64::consts::SQRT_2);
            [(x + z) >> 1, (x + y) >> 1, (y + z) >> 1]
        })
    }
}

/// Face-centred cubic lattice as D3, the integer points of even sum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fcc {
    pub(super) per_metre: f64,
}

impl ClosedForm for Fcc {
    #[inline(always)]
    fn nearest(self, p: [f64; 3]) -> Option<[i64; 3]> {
        let u = p.map(|x| x * self.per_metre);
        within_reach(u).then(|| {
            let [x, y, z] = u.map(split);
            let odd = (x.near + y.near + z.near) & 1;
            let (ax, ay, az) = (x.rest.abs(), y.rest.abs(), z.rest.abs());
            let move_x = i64::from((ax >= ay) & (ax >= az));
            let move_y = i64::from((ay > ax) & (ay >= az));
            let move_z = 1 - move_x - move_y;
            let kx = x.near + odd * move_x * x.sign();
            let ky = y.near + odd * move_y * y.sign();
            let kz = z.near + odd * move_z * z.sign();
            let w1 = -kz - ky;
            [(kx - w1) >> 1, w1, -kz]
        })
    }
}

/// Hexagonal prisms: a centred plane lattice with sides 1 : sqrt 3, times the heights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hex {
    pub(super) per_metre: [f64; 3],
}

impl ClosedForm for Hex {
    #[inline(always)]
    fn nearest(self, p: [f64; 3]) -> Option<[i64; 3]> {
        let [sx, sy, sz] = self.per_metre;
        let u = [p[0] * sx, p[1] * sy, p[2] * sz];
        within_reach(u).then(|| {
            let [x, y, z] = u.map(split);
            let odd = i64::from(x.rest.abs() + 3.0 * y.rest.abs() > 1.0);
            let (kx, ky) = (2 * x.near + odd * x.sign(), 2 * y.near + odd * y.sign());
            [(kx + ky) >> 1, ky, z.near]
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::lattice::LatticeKind;
    use crate::lattice::generator::unit_generator;
    use crate::lattice::quantizer::cuboid_axes;

    #[test]
    fn split_rounds_half_to_even() {
        for (u, near, rest) in [
            (0.5, 0, 0.5),
            (1.5, 2, -0.5),
            (-0.5, 0, -0.5),
            (-1.5, -2, 0.5),
            (0.499_999_999_999_999_94, 0, 0.499_999_999_999_999_94),
            (-123_456_789.25, -123_456_789, -0.25),
        ] {
            let s = split(u);
            assert_eq!((s.near, s.rest), (near, rest), "{u}");
        }
    }

    #[test]
    fn the_mcc_axes_are_a_rotation_with_the_sides_of_the_cuboid() {
        let rows = cuboid_axes(&unit_generator(LatticeKind::Mcc)).map(Vector3::from);
        let sides = [2.0_f64.powf(0.25), 2.0_f64.powf(0.25), 2.0_f64.sqrt()];
        let axes = [rows[0] * sides[0], rows[1] * sides[1], rows[2] * sides[2]];
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((axes[i].dot(&axes[j]) - expected).abs() < 1e-14);
            }
        }
        assert!(axes[0].cross(&axes[1]).dot(&axes[2]) > 0.0);
    }
}
