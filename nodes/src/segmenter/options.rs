//! Options of a [`super::Segmenter`].

use super::colors::Normalisation;
use super::labels::Meaning;
use super::network::{MAX_CLASSES, Size};
use crate::options::one_of;
use lattice_runtime::params::{ParamError, Params};

/// Largest settable side of a network input, pixels.
const MAX_SIDE: i64 = 1 << 14;

/// Options of a [`super::Segmenter`].
#[derive(Clone, Debug, PartialEq)]
pub struct SegmenterOptions {
    /// Limit of pixels per image; larger images are rejected.
    pub max_image_pixels: usize,
    /// Normalisation of the colours.
    pub normalisation: Normalisation,
    /// Interpretation of the scores.
    pub meaning: Meaning,
    /// Class names; empty: those of the model.
    pub names: Vec<String>,
    /// True to output the probabilities of several classes.
    pub with_soft: bool,
}

impl Default for SegmenterOptions {
    fn default() -> Self {
        Self {
            max_image_pixels: 16_000_000,
            normalisation: Normalisation {
                mean: [0.485, 0.456, 0.406],
                deviation: [0.229, 0.224, 0.225],
            },
            meaning: Meaning::Logits,
            names: Vec::new(),
            with_soft: false,
        }
    }
}

impl SegmenterOptions {
    /// Reads the parameters of the node `segmenter`.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let max_image_pixels = Self::default().max_image_pixels;
        let max_image_pixels = params.positive("max_image_pixels", max_image_pixels)?;
        Self::of_network(params, max_image_pixels, false)
    }

    /// Reads the parameters of the network.
    pub(crate) fn of_network(
        params: &Params,
        max_image_pixels: usize,
        with_soft: bool,
    ) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let Normalisation { mean, deviation } = defaults.normalisation;
        let names = params.string_array("names", &[])?;
        if names.len() > MAX_CLASSES {
            return Err(params.invalid("names", format!("expected at most {MAX_CLASSES}")));
        }
        let deviation = channels(params, "std", deviation)?;
        if deviation.iter().any(|deviation| *deviation <= 0.0) {
            return Err(params.invalid("std", "expected numbers above 0"));
        }
        let meanings = [
            ("logits", Meaning::Logits),
            ("probabilities", Meaning::Probabilities),
        ];
        Ok(Self {
            max_image_pixels,
            normalisation: Normalisation {
                mean: channels(params, "mean", mean)?,
                deviation,
            },
            meaning: one_of(params, "scores", &meanings)?,
            names,
            with_soft,
        })
    }
}

/// Reads three numbers: red, green and blue.
fn channels(params: &Params, name: &str, default: [f32; 3]) -> Result<[f32; 3], ParamError> {
    let default = default.map(|v| (f64::from(v) * 1e6).round() / 1e6);
    let given = params.f64_array(name, &default)?;
    let numbers = <[f64; 3]>::try_from(given).ok();
    let finite = numbers.filter(|numbers| numbers.iter().all(|v| v.is_finite() && v.abs() < 1e6));
    let problem = "expected three numbers: of red, green and blue, for colours from 0 to 1";
    let numbers = finite.ok_or_else(|| params.invalid(name, problem))?;
    Ok(numbers.map(|v| v as f32))
}

/// `input_size`: size of the input if the model's is dynamic.
pub(super) fn input_size(params: &Params) -> Result<Option<Size>, ParamError> {
    let side = |v: i64| {
        usize::try_from(v)
            .ok()
            .filter(|_| (1..=MAX_SIDE).contains(&v))
    };
    match *params.i64_array("input_size", &[])? {
        [] => return Ok(None),
        [width, height] => {
            if let (Some(width), Some(height)) = (side(width), side(height)) {
                return Ok(Some(Size { width, height }));
            }
        }
        _ => {}
    }
    let problem = format!("expected width and height in pixels, each from 1 to {MAX_SIDE}");
    Err(params.invalid("input_size", problem))
}
