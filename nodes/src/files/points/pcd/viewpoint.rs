//! Sensor pose in the header of a PCD file.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Rounding error of a printed identity, m and rad.
const STILL: f64 = 1e-6;

/// Warning about `VIEWPOINT tx ty tz qw qx qy qz`, unless it is the identity.
///
/// It is not applied. Some programs write points in the sensor's frame with it (CloudCompare applies it), others
/// write transformed points (the recorder of perception_pcl), and the file does not distinguish the two.
pub(super) fn remark(words: &[&str]) -> Option<String> {
    let shown: String = words.join(" ").chars().take(100).collect();
    let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
    let Some(&[x, y, z, qw, qx, qy, qz]) = numbers.as_deref() else {
        return Some(format!(
            "VIEWPOINT {shown} is not a pose of 7 numbers; ignored"
        ));
    };
    let place_m = Vector3::new(x, y, z);
    let turn = Quaternion::new(qw, qx, qy, qz);
    // A zero quaternion counts as the identity; others are normalised.
    let turn = UnitQuaternion::try_new(turn, STILL).unwrap_or_default();
    let is_origin = place_m.norm() <= STILL && turn.angle() <= STILL;
    (!is_origin).then(|| {
        format!(
            "VIEWPOINT {shown} places the sensor away from the origin; it is not applied, and the points are used as \
             given. If they are in the sensor's frame, transform them first"
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
            assert!(
                of(line).unwrap().contains("not a pose of 7 numbers"),
                "{line}"
            );
        }
    }
}
