//! The pose of the sensor in the header of a PCD file.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Motion that is of printing, m and rad.
const STILL: f64 = 1e-6;

/// Remark on `VIEWPOINT tx ty tz qw qx qy qz`, unless it is the origin.
///
/// It is not applied: some programs write points of the sensor with it (CloudCompare places them by it), others points that
/// are placed already (the recorder of perception_pcl), and nothing in the file tells which.
pub(super) fn remark(words: &[&str]) -> Option<String> {
    let shown: String = words.join(" ").chars().take(100).collect();
    let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
    let Some(&[x, y, z, qw, qx, qy, qz]) = numbers.as_deref() else {
        return Some(format!(
            "VIEWPOINT {shown} is no pose of 7 numbers, and ignored"
        ));
    };
    let place_m = Vector3::new(x, y, z);
    let turn = Quaternion::new(qw, qx, qy, qz);
    // A zero quaternion is what careless writers put for none; one of another length is as good as its direction.
    let turn = UnitQuaternion::try_new(turn, STILL).unwrap_or_default();
    let is_origin = place_m.norm() <= STILL && turn.angle() <= STILL;
    (!is_origin).then(|| {
        format!(
            "VIEWPOINT {shown} places the sensor away from the origin; it is not applied, and the points are taken as \
             they stand. If they are in the sensor's frame, transform them before"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(line: &str) -> Option<String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        remark(&words)
    }

    #[test]
    fn the_origin_in_any_spelling_is_no_remark() {
        for line in [
            "0 0 0 1 0 0 0",
            "0.0 -0 0 -1 0 0 0",
            "0 0 0 2 0 0 0",
            "0 0 0 0 0 0 0",
            "1e-9 0 0 1 0 0 1e-9",
        ] {
            assert_eq!(of(line), None, "{line}");
        }
    }

    #[test]
    fn another_place_or_turn_is_told() {
        for line in [
            "100 0 0 1 0 0 0",
            "0 0 0 0.7 0 0 0.7",
            "0 0 0 0 0 0 5",
            "0 0 0.5 0 0 0 0",
            "nan 0 0 1 0 0 0",
        ] {
            let told = of(line).unwrap();
            assert!(
                told.contains(line) && told.contains("not applied"),
                "{told}"
            );
        }
        for line in ["", "0 0 0", "0 0 0 1 0 0 0 0", "a b c d e f g"] {
            assert!(of(line).unwrap().contains("no pose of 7 numbers"), "{line}");
        }
    }
}
