//! Conversion of network output to images: class and confidence of each pixel.

use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::std_msgs::Header;

use super::network::{Scores, Size, Values};
use crate::camera::{SHARES, Share, SoftLabels};

/// Interpretation of network scores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// Probabilities are their softmax.
    Logits,
    /// Scores are probabilities.
    Probabilities,
}

/// Label of pixels without a class in 16-bit images; 255 in 8-bit ones.
const NONE: u16 = u16::MAX;

/// Output images with the header of the labelled image.
#[derive(Clone, Debug, PartialEq)]
pub struct Labelled {
    /// mono8 for fewer than 256 classes, else mono16.
    pub labels: Image,
    /// mono8, 255 is certain; `None` if the network outputs classes only.
    pub confidence: Option<Image>,
    /// Probabilities of the best classes, if requested and available.
    pub soft: Option<SoftLabels>,
}

/// Converts network output. `classes` is the number of class names, if any; `with_soft` requests the
/// probabilities of several classes.
pub fn labelled(
    header: &Header,
    scores: &Scores,
    meaning: Meaning,
    classes: Option<usize>,
    with_soft: bool,
) -> Result<Labelled, String> {
    let pixels = scores.size.pixels();
    let mut soft = None;
    let (numbers, confidence, most) = match &scores.values {
        Values::Scores { classes, values } => {
            if *classes == 0 || classes.checked_mul(pixels) != Some(values.len()) {
                return Err(format!("{} values for {classes} classes", values.len()));
            }
            let (numbers, probabilities) = chosen(values, pixels, meaning);
            if with_soft {
                let shares = shares(values, &probabilities, meaning);
                let size = [scores.size.width, scores.size.height];
                soft = SoftLabels::new(size, *classes, shares);
            }
            // The cast converts NaN to 0.
            let bytes = probabilities.iter().map(|p| (p * 255.0).round() as u8);
            (numbers, Some(bytes.collect()), *classes)
        }
        Values::Classes(numbers) => {
            if numbers.len() != pixels {
                return Err(format!("{} classes for {pixels} pixels", numbers.len()));
            }
            let number = |n: &i64| u16::try_from(*n).unwrap_or(NONE);
            let numbers: Vec<u16> = numbers.iter().map(number).collect();
            let known = numbers.iter().filter(|n| **n != NONE).max();
            let found = known.map_or(0, |n| usize::from(*n) + 1);
            (numbers, None, classes.unwrap_or(0).max(found))
        }
    };
    let byte = |number: u16| u8::try_from(number).unwrap_or(u8::MAX);
    let labels = match most <= usize::from(u8::MAX) {
        true => ("mono8", numbers.iter().map(|n| byte(*n)).collect()),
        false => {
            let bytes = numbers.iter().flat_map(|n| n.to_le_bytes());
            ("mono16", bytes.collect())
        }
    };
    Ok(Labelled {
        labels: image(header, scores.size, labels.0, labels.1),
        confidence: confidence.map(|bytes| image(header, scores.size, "mono8", bytes)),
        soft,
    })
}

/// Best class of each pixel and its probability. NaN is never best.
fn chosen(values: &[f32], pixels: usize, meaning: Meaning) -> (Vec<u16>, Vec<f32>) {
    let mut best = vec![f32::NEG_INFINITY; pixels];
    let mut numbers = vec![NONE; pixels];
    for (class, plane) in values.chunks_exact(pixels).enumerate() {
        let class = u16::try_from(class).unwrap_or(NONE);
        for ((value, best), number) in plane.iter().zip(&mut best).zip(&mut numbers) {
            if *value > *best {
                (*best, *number) = (*value, class);
            }
        }
    }
    let probabilities = match meaning {
        Meaning::Probabilities => best,
        Meaning::Logits => {
            let mut sums = vec![0.0f32; pixels];
            for plane in values.chunks_exact(pixels) {
                for ((value, best), sum) in plane.iter().zip(&best).zip(&mut sums) {
                    *sum += (value - best).exp();
                }
            }
            sums.iter().map(|sum| 1.0 / sum).collect()
        }
    };
    (numbers, probabilities)
}

/// Best classes of each pixel with their probabilities, given that of the best.
fn shares(values: &[f32], best: &[f32], meaning: Meaning) -> Vec<[Share; SHARES]> {
    let mut kept = vec![[(f32::NEG_INFINITY, NONE); SHARES]; best.len()];
    for (plane, class) in values.chunks_exact(best.len()).zip(0..NONE) {
        for (value, kept) in plane.iter().zip(&mut kept) {
            let mut new = (*value, class);
            for old in kept {
                if new.0 > old.0 {
                    std::mem::swap(&mut new, old);
                }
            }
        }
    }
    let probability = |value: f32, first: f32, best: f32| match meaning {
        Meaning::Probabilities => value,
        Meaning::Logits => (value - first).exp() * best,
    };
    let pixels = kept.iter().zip(best);
    let pixels = pixels.map(|(kept, best)| {
        let first = kept[0].0;
        kept.map(|(value, class)| match class {
            NONE => Share::NONE,
            class => Share::new(class, probability(value, first, *best)),
        })
    });
    pixels.collect()
}

fn image(header: &Header, size: Size, encoding: &str, data: Vec<u8>) -> Image {
    let pixel = if encoding == "mono8" { 1 } else { 2 };
    Image {
        header: header.clone(),
        height: size.height as u32,
        width: size.width as u32,
        encoding: encoding.to_owned(),
        is_bigendian: 0,
        step: (size.width * pixel) as u32,
        data: data.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: Values, meaning: Meaning, names: Option<usize>) -> Labelled {
        let size = Size {
            width: 2,
            height: 1,
        };
        let scores = Scores { size, values };
        labelled(&Header::default(), &scores, meaning, names, true).unwrap()
    }

    #[test]
    fn the_best_class_has_its_probability() {
        let values = Values::Scores {
            classes: 3,
            values: vec![1.0, 0.0, 1.0 + 3f32.ln(), f32::NAN, 1.0, 0.0],
        };
        let found = of(values, Meaning::Logits, None);
        assert_eq!(found.labels.data.to_vec(), [1, 0]);
        // 3 of 5; nothing is said where a score is no number.
        assert_eq!(found.confidence.unwrap().data.to_vec(), [153, 0]);

        let values = Values::Scores {
            classes: 2,
            values: vec![0.4, f32::NAN, 0.6, f32::NAN],
        };
        let found = of(values, Meaning::Probabilities, None);
        assert_eq!(found.labels.data.to_vec(), [1, 255]);
        assert_eq!(found.confidence.unwrap().data.to_vec(), [153, 0]);
    }

    #[test]
    fn the_best_classes_keep_their_probabilities() {
        // Six classes of two pixels; nothing is known of the second.
        let p = [0.05_f32, 0.4, 0.1, 0.25, 0.15, 0.05];
        let plain: Vec<f32> = p.iter().flat_map(|p| [*p, f32::NAN]).collect();
        let logits: Vec<f32> = p.iter().flat_map(|p| [p.ln() + 3.0, f32::NAN]).collect();
        for (values, meaning) in [(plain, Meaning::Probabilities), (logits, Meaning::Logits)] {
            let classes = p.len();
            let found = of(Values::Scores { classes, values }, meaning, None);
            let soft = found.soft.unwrap();
            for (share, class) in soft.at(0, 0).iter().zip([1, 3, 4, 2]) {
                assert_eq!(share.class, class);
                let expected = p[usize::from(class)];
                assert!((share.probability() - expected).abs() < 1e-4, "{share:?}");
            }
            assert_eq!(soft.at(1, 0), [Share::NONE; SHARES]);
        }
        let chosen = of(Values::Classes(vec![7, 1]), Meaning::Logits, None);
        assert_eq!(chosen.soft, None);
    }

    #[test]
    fn classes_of_networks_that_choose_are_taken_as_they_are() {
        let found = of(Values::Classes(vec![7, -1]), Meaning::Logits, Some(8));
        assert_eq!(found.labels.data.to_vec(), [7, 255]);
        assert_eq!(found.confidence, None);
        let wide = of(Values::Classes(vec![300, -1]), Meaning::Logits, None);
        assert_eq!(
            (wide.labels.encoding.as_str(), wide.labels.step),
            ("mono16", 4)
        );
        assert_eq!(wide.labels.data.to_vec(), [44, 1, 255, 255]);
    }

    #[test]
    fn outputs_of_another_size_are_refused() {
        let size = Size {
            width: 2,
            height: 2,
        };
        let values = Values::Scores {
            classes: 3,
            values: vec![0.0; 11],
        };
        let found = labelled(
            &Header::default(),
            &Scores { size, values },
            Meaning::Logits,
            None,
            false,
        );
        assert_eq!(found.unwrap_err(), "11 values for 3 classes");
    }
}
