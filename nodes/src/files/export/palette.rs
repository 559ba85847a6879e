//! Colour map by height.

/// OKLab lightness of the lowest and the highest colour.
const LIGHTNESS: [f64; 2] = [0.46, 0.91];
/// OKLab hue of the lowest and the highest colour, degrees: blue to yellow.
const HUE_DEG: [f64; 2] = [272.0, 95.0];
/// OKLab chroma, if in the gamut.
const CHROMA: f64 = 0.135;

/// sRGB colour for a fraction of the height range, dark blue for 0 to yellow for 1.
///
/// Lightness and hue are linear in OKLab (Ottosson 2020), so that equal steps look equal.
pub fn color_at(fraction: f64) -> [u8; 3] {
    linear_at(fraction).map(srgb)
}

/// [`color_at`] as linear light, 0 to 1.
pub fn linear_at(fraction: f64) -> [f64; 3] {
    let t = if fraction.is_nan() {
        0.5
    } else {
        fraction.clamp(0.0, 1.0)
    };
    let between = |[low, high]: [f64; 2]| low + (high - low) * t;
    let (lightness, hue) = (between(LIGHTNESS), between(HUE_DEG).to_radians());
    on_screen(lightness, hue)
}

/// sRGB colour of an unordered category; consecutive indices have distant hues.
pub fn category_color(index: usize) -> [u8; 3] {
    /// Golden angle in degrees, which spreads any first few hues.
    const TURN_DEG: f64 = 137.507_764;
    let lightness = [0.70, 0.56, 0.82][index % 3];
    let hue = (30.0 + index as f64 * TURN_DEG).rem_euclid(360.0);
    on_screen(lightness, hue.to_radians()).map(srgb)
}

/// Linear light of an OKLab lightness and hue (rad), with the largest chroma in the gamut.
fn on_screen(lightness: f64, hue: f64) -> [f64; 3] {
    let mut chroma = CHROMA;
    loop {
        let rgb = oklab_to_linear(lightness, chroma * hue.cos(), chroma * hue.sin());
        let on_screen = rgb.iter().all(|c| (-1e-3..=1.001).contains(c));
        if on_screen || chroma < 0.01 {
            return rgb.map(|c| c.clamp(0.0, 1.0));
        }
        chroma *= 0.98;
    }
}

/// OKLab to linear sRGB, with the constants of the definition.
fn oklab_to_linear(l: f64, a: f64, b: f64) -> [f64; 3] {
    let cube = |v: f64| v * v * v;
    let l_ = cube(l + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m_ = cube(l - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s_ = cube(l - 0.089_484_177_5 * a - 1.291_485_548_0 * b);
    [
        4.076_741_662_1 * l_ - 3.307_711_591_3 * m_ + 0.230_969_929_2 * s_,
        -1.268_438_004_6 * l_ + 2.609_757_401_1 * m_ - 0.341_319_396_5 * s_,
        -0.004_196_086_3 * l_ - 0.703_418_614_7 * m_ + 1.707_614_701_0 * s_,
    ]
}

/// Linear light 0 to 1 as an sRGB byte.
pub fn srgb(linear: f64) -> u8 {
    let c = linear.clamp(0.0, 1.0);
    let encoded = if c <= 0.003_130_8 {
        12.92 * c
    } else {
        1.055 * c.powf(1.0 / 2.4) - 0.055
    };
    (encoded * 255.0).round() as u8
}

/// An sRGB byte as linear light 0 to 1.
pub fn linear(srgb: u8) -> f64 {
    let c = f64::from(srgb) / 255.0;
    if c <= 0.040_45 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    }
}

/// Height range of the colour map: 1st to 99th percentile of the heights, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct HeightRange {
    low_m: f64,
    high_m: f64,
}

impl HeightRange {
    /// Range of finite heights in metres; zero if there are none.
    pub fn of(heights_m: impl IntoIterator<Item = f64>) -> HeightRange {
        let mut heights: Vec<f64> = heights_m.into_iter().filter(|h| h.is_finite()).collect();
        let low = heights.len() / 100;
        let Some(high) = heights.len().checked_sub(low + 1) else {
            return HeightRange {
                low_m: 0.0,
                high_m: 0.0,
            };
        };
        // Both are below the length.
        let mut nth = |n| *heights.select_nth_unstable_by(n, f64::total_cmp).1;
        HeightRange {
            low_m: nth(low),
            high_m: nth(high),
        }
    }

    /// Fraction of a height in the range, 0 to 1; 0.5 if all heights are equal.
    pub fn fraction(&self, height_m: f64) -> f64 {
        let span = self.high_m - self.low_m;
        if span > 0.0 {
            ((height_m - self.low_m) / span).clamp(0.0, 1.0)
        } else {
            0.5
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_rises_evenly() {
        // Luminance to the power 1/3 is close to lightness.
        let lightness = |i: i32| {
            let [r, g, b] = linear_at(f64::from(i) / 20.0);
            (0.2126 * r + 0.7152 * g + 0.0722 * b).cbrt()
        };
        let mean = (lightness(20) - lightness(0)) / 20.0;
        for i in 0..20 {
            let step = lightness(i + 1) - lightness(i);
            assert!(
                (0.5 * mean..1.5 * mean).contains(&step),
                "{i}: {step} of {mean}"
            );
        }
    }

    #[test]
    fn fractions_outside_and_nan_have_colours() {
        assert_eq!(color_at(-3.0), color_at(0.0));
        assert_eq!(color_at(f64::INFINITY), color_at(1.0));
        assert_eq!(color_at(f64::NAN), color_at(0.5));
    }

    #[test]
    fn categories_are_told_apart() {
        for i in 0..18 {
            for j in 0..i {
                let pairs = category_color(i).into_iter().zip(category_color(j));
                let apart = pairs.map(|(a, b)| f64::from(a.abs_diff(b)).powi(2));
                assert!(apart.sum::<f64>().sqrt() > 25.0, "{i} {j}");
            }
        }
    }

    #[test]
    fn srgb_and_linear_are_inverse() {
        for byte in 0..=255 {
            assert_eq!(srgb(linear(byte)), byte);
        }
    }

    #[test]
    fn outliers_do_not_stretch_the_range() {
        let heights = (0..=200).map(f64::from).chain([-1e6, 1e6, f64::NAN]);
        let range = HeightRange::of(heights);
        assert_eq!((range.low_m, range.high_m), (1.0, 199.0));
        assert_eq!(range.fraction(100.0), 0.5);
        assert_eq!((range.fraction(-9.0), range.fraction(1e6)), (0.0, 1.0));
        for flat in [vec![], vec![7.0; 5]] {
            assert_eq!(HeightRange::of(flat).fraction(7.0), 0.5);
        }
    }
}
