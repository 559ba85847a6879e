//! Colours by height, and of voxels.

use lattice_msgs::std_msgs::ColorRGBA;

use crate::convert::map::VoxelColor;

/// Grey of voxels without a colour.
const UNCOLORED: [u8; 3] = [115; 3];

/// Mean colour of a voxel, grey if it has none.
pub fn of_voxel(color: Option<VoxelColor>, alpha: f32) -> ColorRGBA {
    let [r, g, b] = color.map_or(UNCOLORED, |color| color.rgb);
    let [r, g, b] = [r, g, b].map(|value| f32::from(value) / 255.0);
    ColorRGBA { r, g, b, a: alpha }
}

/// Colour of a height: hues run through once every `period_m`.
pub fn of_height(z_m: f64, period_m: f64, alpha: f32) -> ColorRGBA {
    let turns = z_m / period_m;
    // The part behind the point, as the remainders of divisions by 1, without the division.
    let rest = turns - turns.trunc();
    let turn = if rest < 0.0 { rest + 1.0 } else { rest };
    let hue = 6.0 * if turn.is_finite() { turn } else { 0.0 };
    let channel = |shift: f64| {
        let k = hue + shift;
        let k = if k < 6.0 { k } else { k - 6.0 };
        let ramp = (k - 3.0).abs() - 1.0;
        (0.15 + 0.8 * ramp.clamp(0.0, 1.0)) as f32
    };
    ColorRGBA {
        r: channel(0.0),
        g: channel(4.0),
        b: channel(2.0),
        a: alpha,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remainders_are_those_of_divisions() {
        let slow = |z_m: f64, period_m: f64| {
            let hue = 6.0 * (z_m / period_m).rem_euclid(1.0);
            [0.0, 4.0, 2.0].map(|shift: f64| {
                let k = (hue + shift).rem_euclid(6.0);
                (0.15 + 0.8 * ((k - 3.0).abs() - 1.0).clamp(0.0, 1.0)) as f32
            })
        };
        for i in -20_000..20_000 {
            let z_m = f64::from(i) * 0.003_7 + if i % 7 == 0 { 0.0 } else { 1e-17 };
            for period_m in [0.3, 12.0, 1e6] {
                let ColorRGBA { r, g, b, .. } = of_height(z_m, period_m, 1.0);
                assert_eq!([r, g, b], slow(z_m, period_m), "{z_m} of {period_m}");
            }
        }
    }

    #[test]
    fn hues_run_through_once_a_period() {
        let at = |z_m| of_height(z_m, 12.0, 1.0);
        assert_eq!(at(0.0), at(12.0));
        assert_ne!(at(0.0), at(4.0));
        assert!(at(0.0).r > 0.9 && at(0.0).g < 0.2);
        assert!(at(4.0).g > 0.9 && at(8.0).b > 0.9);
        assert!(at(f64::NAN).r.is_finite());
    }
}
