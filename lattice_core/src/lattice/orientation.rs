//! Orientation of a lattice in the map.
//!
//! The number of cells that flat ground occupies grows with the height of the cell. In the paper's axes FCC cells are
//! 1.587 cell sizes tall and BCC cells 1.260; in the ground orientation they are 1.122 and 1.091.

use std::str::FromStr;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::error::LatticeError;
use super::generator::unit_generator;
use super::kind::LatticeKind;
pub use super::named_orientation::Orientation;

impl Orientation {
    /// Rotation from the axes of Ryde & Brünig 2011 to those of the map.
    ///
    /// Computed by square roots only, so the bits are the same on every machine. Fails for crystal axes that the
    /// lattice does not have, and for [`Orientation::Ground`] of a custom lattice, which depends on its basis: use
    /// [`Lattice::with_orientation`](crate::lattice::Lattice::with_orientation).
    pub fn map_from_lattice(self, kind: LatticeKind) -> Result<UnitQuaternion<f64>, LatticeError> {
        let up = match self {
            Self::Paper => None,
            Self::Ground => match kind {
                LatticeKind::Cubic | LatticeKind::Hex | LatticeKind::HexOptimal => None,
                LatticeKind::Fcc => crystal_direction(kind, [1, 1, 0]),
                LatticeKind::Bcc | LatticeKind::Mcc => crystal_direction(kind, [1, 1, 1]),
                LatticeKind::Custom => return Err(LatticeError::NoBasis),
            },
            Self::Up(axis) => {
                let direction = crystal_direction(kind, axis);
                Some(direction.ok_or(LatticeError::NoCrystalAxes(self, kind))?)
            }
        };
        Ok(up.map_or_else(UnitQuaternion::identity, upright))
    }
}

/// Crystal direction in the axes of the paper; not normalized.
fn crystal_direction(kind: LatticeKind, axis: [u8; 3]) -> Option<Vector3<f64>> {
    let [h, k, l] = axis.map(f64::from);
    match kind {
        LatticeKind::Cubic | LatticeKind::Bcc | LatticeKind::Fcc => Some(Vector3::new(h, k, l)),
        // The sides of the cuboid have the indices (1,1,0), (0,1,1) and (1,0,1).
        LatticeKind::Mcc => Some(unit_generator(kind) * Vector3::new(h + l, h + k, k + l)),
        LatticeKind::Hex | LatticeKind::HexOptimal | LatticeKind::Custom => None,
    }
}

/// Smallest rotation of a direction in the upper half space to z.
pub(super) fn upright(direction: Vector3<f64>) -> UnitQuaternion<f64> {
    let direction = if direction.z < 0.0 {
        -direction
    } else {
        direction
    };
    let length = direction.norm_squared().sqrt();
    if direction.x == 0.0 && direction.y == 0.0 {
        return UnitQuaternion::identity();
    }
    // Quaternion of half the angle: (1 + cos, sin axis) before normalization.
    let (x, y, z) = (
        direction.x / length,
        direction.y / length,
        direction.z / length,
    );
    let norm = (2.0 + 2.0 * z).sqrt();
    UnitQuaternion::new_unchecked(Quaternion::new((1.0 + z) / norm, y / norm, -x / norm, 0.0))
}

/// Rotation as a matrix, by +, -, * and / only; orthogonal even if the quaternion is not exactly of length 1.
pub(super) fn matrix(rotation: &UnitQuaternion<f64>) -> Matrix3<f64> {
    let (w, x, y, z) = (rotation.w, rotation.i, rotation.j, rotation.k);
    let s = 2.0 / (w * w + x * x + y * y + z * z);
    Matrix3::new(
        1.0 - s * (y * y + z * z),
        s * (x * y - w * z),
        s * (x * z + w * y),
        s * (x * y + w * z),
        1.0 - s * (x * x + z * z),
        s * (y * z - w * x),
        s * (x * z - w * y),
        s * (y * z + w * x),
        1.0 - s * (x * x + y * y),
    )
}

/// Quaternion of a rotation whose first nonzero number is positive.
pub(super) fn canonical(rotation: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let (w, x, y, z) = (rotation.w, rotation.i, rotation.j, rotation.k);
    let first = [w, x, y, z].into_iter().find(|c| *c != 0.0);
    if first.is_some_and(|c| c < 0.0) {
        UnitQuaternion::new_unchecked(Quaternion::new(-w, -x, -y, -z))
    } else {
        rotation
    }
}

impl FromStr for Orientation {
    type Err = LatticeError;

    fn from_str(name: &str) -> Result<Self, LatticeError> {
        match name {
            "paper" => return Ok(Self::Paper),
            "ground" => return Ok(Self::Ground),
            _ => {}
        }
        let axis = match name.strip_suffix("-up").map(str::as_bytes) {
            Some(&[h, k, l]) => [h, k, l].map(|digit| digit.wrapping_sub(b'0')),
            _ => [0; 3],
        };
        if axis == [0; 3] || axis.iter().any(|digit| *digit > 1) {
            return Err(LatticeError::UnknownOrientation(
                name.chars().take(40).collect(),
            ));
        }
        Ok(Self::Up(axis))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Lattice;

    /// Extent of the cell along z, unit volume.
    fn height(kind: LatticeKind, name: &str) -> f64 {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        let turned = lattice.with_orientation(name.parse().unwrap()).unwrap();
        let z = turned.cell().vertices.iter().map(|v| v.z);
        2.0 * z.fold(0.0, f64::max)
    }

    #[test]
    fn cells_are_as_tall_as_the_theory_says() {
        use LatticeKind::*;
        for (kind, name, expected) in [
            (Cubic, "paper", 1.0),
            (Cubic, "ground", 1.0),
            (Cubic, "110-up", 2.0_f64.sqrt()),
            (Cubic, "111-up", 3.0_f64.sqrt()),
            (Bcc, "paper", 1.259921),
            (Bcc, "ground", 1.0911236),
            (Bcc, "111-up", 1.0911236),
            (Fcc, "paper", 1.587401),
            (Fcc, "001-up", 1.587401),
            (Fcc, "ground", 1.122462),
            (Fcc, "110-up", 1.122462),
            (Fcc, "011-up", 1.122462),
            (Mcc, "ground", 1.0986841),
            (Mcc, "111-up", 1.0986841),
            (Hex, "paper", 0.832683),
            (Hex, "ground", 0.832683),
            (HexOptimal, "ground", 0.987255),
        ] {
            let found = height(kind, name);
            assert!((found - expected).abs() < 1e-6, "{kind} {name}: {found}");
        }
    }

    #[test]
    fn no_direction_is_flatter_than_ground() {
        // The width of a symmetric body is least across the pair of faces that are nearest to it.
        for kind in LatticeKind::ALL {
            let least = 2.0 * Lattice::new(kind, 1.0).unwrap().packing_radius_m();
            assert!((height(kind, "ground") - least).abs() < 1e-12, "{kind}");
            for code in 1..8 {
                let name = format!("{}{}{}-up", code >> 2, code >> 1 & 1, code & 1);
                if crystal_direction(kind, [1; 3]).is_some() {
                    assert!(height(kind, &name) > least - 1e-12, "{kind} {name}");
                }
            }
        }
    }

    #[test]
    fn names_round_trip_and_others_are_refused() {
        for name in ["paper", "ground", "001-up", "110-up", "111-up", "101-up"] {
            assert_eq!(name.parse::<Orientation>().unwrap().to_string(), name);
        }
        for name in ["", "up", "000-up", "120-up", "11-up", "110-UP", "Ground"] {
            let error = name.parse::<Orientation>().unwrap_err().to_string();
            assert!(error.contains("paper, ground"), "{error}");
        }
        let hex = Lattice::new(LatticeKind::Hex, 1.0).unwrap();
        let error = hex.with_orientation(Orientation::Up([1, 1, 0]));
        assert!(error.unwrap_err().to_string().contains("110-up"));
    }

    #[test]
    fn the_matrix_is_that_of_the_quaternion_and_the_sign_is_fixed() {
        let q = UnitQuaternion::from_euler_angles(0.3, -1.2, 2.5);
        let expected = q.to_rotation_matrix();
        assert!((matrix(&q) - expected.matrix()).amax() < 1e-15);
        let opposite = UnitQuaternion::new_unchecked(-q.into_inner());
        assert_eq!(canonical(q), canonical(opposite));
        assert_eq!(matrix(&UnitQuaternion::identity()), Matrix3::identity());
    }
}
