//! Poses in files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::AnyError;

/// Most bytes of a file of 16 numbers.
const MAX_BYTES: u64 = 1 << 16;

/// A transform from a file of 16 numbers, row by row.
///
/// # Errors
/// Names the file that cannot be read or is no rigid transform.
pub fn read_pose(path: &Path) -> Result<Isometry3<f64>, AnyError> {
    let wrong = |why: &str| format!("{}: {why}", path.display());
    let mut text = String::new();
    let file = File::open(path).map_err(|e| wrong(&e.to_string()))?;
    let read = file.take(MAX_BYTES).read_to_string(&mut text);
    read.map_err(|e| wrong(&e.to_string()))?;
    parse_pose(&text).ok_or_else(|| wrong("is not a rigid transform of 4 x 4 numbers").into())
}

fn parse_pose(text: &str) -> Option<Isometry3<f64>> {
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    let rows: [f64; 16] = numbers?.try_into().ok()?;
    let [a, b, c, x, d, e, f, y, g, h, i, z, ..] = rows;
    let matrix = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let off = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    // The file of small_gicp has six digits.
    let rigid = off < 1e-3 && matrix.determinant() > 0.0 && [x, y, z].iter().all(|t| t.is_finite());
    rigid.then(|| {
        let rotation = Rotation3::from_matrix(&matrix);
        let translation = Translation3::new(x, y, z);
        Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_transform_is_read_and_anything_else_refused() {
        let text = "0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n";
        let read = parse_pose(text).unwrap();
        let expected = Isometry3::new(
            Vector3::new(1.0, 2.0, 3.0),
            Vector3::z() * std::f64::consts::FRAC_PI_2,
        );
        assert!((read.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-12);
        for bad in [
            "",
            "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0",
            "0 1 0 0 1 0 0 0 0 0 1 0 0 0 0 1",
            "2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1",
            "1 0 0 NaN 0 1 0 0 0 0 1 0 0 0 0 1",
            "1 0 0 x 0 1 0 0 0 0 1 0 0 0 0 1",
        ] {
            assert_eq!(parse_pose(bad), None, "{bad}");
        }
    }
}
