//! Readers of pose files.

use std::fs::{File, read_to_string};
use std::io::Read;
use std::path::Path;

use lattice_core::pose::{PoseBuffer, PoseBufferOptions, PushOutcome, StampedPose};
use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};

use crate::{AnyError, at};

/// Size limit of a file with one pose, bytes.
const MAX_BYTES: u64 = 1 << 16;
/// Longest gap between poses of a trajectory that is interpolated, s.
const MAX_GAP_S: f64 = 0.25;
/// Allowed deviation of a quaternion norm from 1, so that quaternions with three digits pass.
const MAX_OFF_NORM: f64 = 1e-2;

/// Reads a transform from a file of 16 numbers, row by row, metres.
///
/// # Errors
/// Unreadable file, or not a rigid transform; the text names the file.
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

/// Reads a trajectory (`map_from_base`) from a TUM file: `stamp x y z qx qy qz qw` per line, in s and m; lines that
/// begin with `#` are comments. Gaps above 0.25 s are not interpolated.
///
/// # Errors
/// Unreadable file, invalid line, stamp not later than the one before, or no poses; the text names file and line.
pub fn read_tum(path: &Path) -> Result<PoseBuffer, AnyError> {
    parse_tum(&read_to_string(path).map_err(at(path))?).map_err(at(path))
}

fn parse_tum(text: &str) -> Result<PoseBuffer, String> {
    let mut poses = PoseBuffer::new(PoseBufferOptions {
        span_s: f64::INFINITY,
        max_gap_s: MAX_GAP_S,
        max_poses: usize::MAX,
        jump_back_s: f64::INFINITY,
    });
    for (i, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let pose = tum_pose(line).ok_or_else(|| {
            let expected =
                "expected `stamp x y z qx qy qz qw`, finite, with a quaternion of norm 1";
            format!("line {}: {line:?} is no pose; {expected}", i + 1)
        })?;
        if poses.push(pose) != PushOutcome::Accepted {
            let why = "is not later than the pose before; sort the lines by time";
            return Err(format!("line {}: {line:?} {why}", i + 1));
        }
    }
    match poses.is_empty() {
        true => Err("has no poses".to_owned()),
        false => Ok(poses),
    }
}

fn tum_pose(line: &str) -> Option<StampedPose> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
    let numbers: [f64; 8] = numbers?.try_into().ok()?;
    let [_, x, y, z, i, j, k, w] = numbers;
    let turn = Quaternion::new(w, i, j, k);
    let is_pose = numbers.iter().all(|n| n.is_finite()) && (turn.norm() - 1.0).abs() < MAX_OFF_NORM;
    let stamp_ns = stamp_ns(words.first()?)?;
    is_pose.then(|| StampedPose {
        stamp_ns,
        map_from_base: Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_quaternion(turn),
        ),
    })
}

/// Converts decimal seconds to ns without rounding: f64 has too few digits for ns since 1970.
fn stamp_ns(text: &str) -> Option<i64> {
    let is_decimal = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (whole, part) = text.split_once('.').unwrap_or((text, ""));
    if !whole.is_empty() && is_decimal(whole) && is_decimal(part) {
        let part: String = part.chars().chain("000000000".chars()).take(9).collect();
        let whole_ns = whole.parse::<i64>().ok()?.checked_mul(1_000_000_000)?;
        return whole_ns.checked_add(part.parse().ok()?);
    }
    let ns = (text.parse::<f64>().ok()? * 1e9).round();
    (ns.abs() < i64::MAX as f64).then_some(ns as i64)
}

/// A line of a TUM file.
pub(crate) fn tum_line(stamp_ns: i64, pose: &Isometry3<f64>) -> String {
    let (second, ns) = (
        stamp_ns.div_euclid(1_000_000_000),
        stamp_ns.rem_euclid(1_000_000_000),
    );
    let numbers = pose.translation.vector.iter().chain(&pose.rotation.coords);
    let numbers: String = numbers.map(|number| format!(" {number:.9}")).collect();
    format!("{second}.{ns:09}{numbers}\n")
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

    #[test]
    fn a_trajectory_is_read_as_it_was_written() {
        let stamp_ns = 1_700_000_000_123_456_789;
        let poses = [0, 200_000_000].map(|after_ns| {
            let pose = Isometry3::new(
                Vector3::new(1.0, -2.0, after_ns as f64 * 1e-8),
                Vector3::new(0.1, -0.2, 3.0),
            );
            (stamp_ns + after_ns, pose)
        });
        let lines = poses.map(|(stamp_ns, pose)| tum_line(stamp_ns, &pose));
        let text = format!("# a comment\n\n{}", lines.concat());
        let read = parse_tum(&text).unwrap();
        for (stamp_ns, pose) in &poses {
            let apart = read.at(*stamp_ns).unwrap().to_homogeneous() - pose.to_homogeneous();
            assert!(apart.amax() < 1e-8, "{apart}");
        }
        let middle = read.at(stamp_ns + 100_000_000).unwrap();
        assert!((middle.translation.z - 1.0).abs() < 1e-8, "{middle}");
        assert!(read.at(stamp_ns - 1).is_err());
        // As numpy writes it.
        let written = parse_tum("1.7e+09 0 0 0 0 0 0 -1").unwrap();
        assert_eq!(written.newest_ns(), Some(1_700_000_000_000_000_000));
    }

    #[test]
    fn lines_that_are_no_poses_in_order_are_named() {
        let good = "1 0 0 0 0 0 0 1\n";
        for (bad, why) in [
            ("", "no poses"),
            ("# only a comment", "no poses"),
            ("1 0 0 0 0 0 0 1\n1.0 0 0 0 0 0 0 1", "line 2"),
            ("1 0 0 0 0 0 0 1\n0.5 0 0 0 0 0 0 1", "not later"),
            ("1 0 0 0 0 0 1", "line 1"),
            ("1 0 0 0 0 0 0 1 0", "line 1"),
            ("1 0 NaN 0 0 0 0 1", "no pose"),
            ("1 0 inf 0 0 0 0 1", "no pose"),
            ("NaN 0 0 0 0 0 0 1", "no pose"),
            ("1e300 0 0 0 0 0 0 1", "no pose"),
            ("99999999999999999999 0 0 0 0 0 0 1", "no pose"),
            ("1 0 0 0 0 0 0 0", "norm 1"),
            ("1 0 0 0 2 0 0 0", "norm 1"),
            ("stamp x y z qx qy qz qw", "line 1"),
        ] {
            let error = parse_tum(bad).unwrap_err();
            assert!(error.contains(why), "{bad}: {error}");
        }
        assert!(parse_tum(good).is_ok());
    }
}
