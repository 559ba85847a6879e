//! Output of a network as images: the class of each pixel, and how sure that is.

use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::std_msgs::Header;

use super::network::{Scores, Size, Values};

/// Meaning of the scores of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// Probabilities are their softmax.
    Logits,
    /// They are probabilities.
    Probabilities,
}

/// Number of pixels without a class in images of 16 bits; 255 in those of a byte.
const NONE: u16 = u16::MAX;

/// Images of an output, with the header of the image that was labelled.
#[derive(Clone, Debug, PartialEq)]
pub struct Labelled {
    /// mono8 with fewer than 256 classes, else mono16.
    pub labels: Image,
    /// mono8, 255 for certain; none if the network gives classes only.
    pub confidence: Option<Image>,
}

/// Images of an output. `classes` is the number of names, where there are some.
pub fn labelled(
    header: &Header,
    scores: &Scores,
    meaning: Meaning,
    classes: Option<usize>,
) -> Result<Labelled, String> {
    let pixels = scores.size.pixels();
    let (numbers, confidence, most) = match &scores.values {
        Values::Scores { classes, values } => {
            if *classes == 0 || classes.checked_mul(pixels) != Some(values.len()) {
                return Err(format!("{} values for {classes} classes", values.len()));
            }
            let (numbers, confidence) = chosen(values, pixels, meaning);
            (numbers, Some(confidence), *classes)
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
    })
}

/// The best class of each pixel and its probability, 255 for one. NaN is never best.
fn chosen(values: &[f32], pixels: usize, meaning: Meaning) -> (Vec<u16>, Vec<u8>) {
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
    // Where nothing is known the cast makes it 0.
    let bytes = probabilities.iter().map(|p| (p * 255.0).round() as u8);
    (numbers, bytes.collect())
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
        labelled(&Header::default(), &Scores { size, values }, meaning, names).unwrap()
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
        );
        assert_eq!(found.unwrap_err(), "11 values for 3 classes");
    }
}
