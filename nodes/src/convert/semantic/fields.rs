//! Labels in cloud fields, in all supported conventions.

use lattice_core::cloud::{CloudView, Datatype, PointField};
use lattice_core::registration::{LabelDistribution, UNLABELED};

use super::LabelOptions;

/// Limit of fields `p_0`, `p_1`, ...
const MAX_PROBABILITY_FIELDS: usize = 256;
/// Colour and confidence fields of semantic_slam.
const COLORS: [[&str; 2]; 3] = [
    ["semantic_color1", "confidence1"],
    ["semantic_color2", "confidence2"],
    ["semantic_color3", "confidence3"],
];

/// Label field of a cloud.
///
/// The first present of: `label_probs` (one element per class), `p_0`, `p_1`, ... (one field per class),
/// `label` with optional `confidence`; with a palette also `semantic_color1` to `3` with `confidence1` to
/// `3`, `semantic_color` with `confidence`, `rgb` or `rgba`.
#[derive(Clone, Debug)]
pub struct LabelReader<'a> {
    form: Form<'a>,
    options: &'a LabelOptions,
}

#[derive(Clone, Debug)]
enum Form<'a> {
    Probabilities(&'a PointField),
    ProbabilityFields(Vec<&'a PointField>),
    Label(&'a PointField, Option<&'a PointField>),
    Colors(Vec<(&'a PointField, Option<&'a PointField>)>),
}

impl<'a> LabelReader<'a> {
    /// Finds the label field; `None` if there is none.
    pub fn find(fields: &'a [PointField], options: &'a LabelOptions) -> Option<Self> {
        let form = form_of(fields, !options.palette.is_empty())?;
        Some(Self { form, options })
    }

    /// Label or distribution of labels of point `i`.
    pub fn read(&self, view: &CloudView<'_>, i: usize) -> LabelDistribution {
        match &self.form {
            Form::Probabilities(field) => {
                let classes = 0..field.count.min(UNLABELED.into());
                self.distribution(classes.map(|k| (k as u16, view.element(field, i, k))))
            }
            Form::ProbabilityFields(fields) => {
                let classes = (0_u16..).zip(fields);
                self.distribution(classes.map(|(k, field)| (k, view.scalar(field, i))))
            }
            Form::Label(field, confidence) => {
                let confidence = confidence_at(view, *confidence, i);
                self.distribution([(self.class_at(view, field, i), confidence)])
            }
            Form::Colors(fields) => self.distribution(fields.iter().map(|(color, confidence)| {
                let class = self.class_of_color(view.packed(color, i));
                (class, confidence_at(view, *confidence, i))
            })),
        }
    }

    /// Distribution of weights; a class may occur several times, for colours of the same class.
    fn distribution(&self, weights: impl IntoIterator<Item = (u16, f64)>) -> LabelDistribution {
        let weights = weights.into_iter().map(|(class, weight)| {
            let known = !self.options.ignored.contains(&class);
            (if known { class } else { UNLABELED }, weight as f32)
        });
        if let Form::Colors(fields) = &self.form
            && fields.len() > 1
        {
            let mut sums: Vec<(u16, f32)> = Vec::with_capacity(fields.len());
            for (class, weight) in weights.filter(|(_, weight)| *weight > 0.0) {
                match sums.iter_mut().find(|(known, _)| *known == class) {
                    Some((_, sum)) => *sum += weight,
                    None => sums.push((class, weight)),
                }
            }
            return LabelDistribution::from_weights(sums);
        }
        LabelDistribution::from_weights(weights)
    }

    fn class_at(&self, view: &CloudView<'_>, field: &PointField, i: usize) -> u16 {
        let value = view.scalar(field, i);
        // 255 in a byte corresponds to 65535.
        let is_byte = Datatype::from_code(field.datatype) == Some(Datatype::Uint8);
        if !(value >= 0.0 && value.fract() == 0.0) || (is_byte && value == 255.0) {
            return UNLABELED;
        }
        let class = value as u64;
        let wide = matches!(
            Datatype::from_code(field.datatype),
            Some(Datatype::Uint32 | Datatype::Int32)
        );
        let class = match wide && self.options.low_16_bits {
            true => class & 0xffff,
            false => class,
        };
        u16::try_from(class).unwrap_or(UNLABELED)
    }

    fn class_of_color(&self, packed: Option<u32>) -> u16 {
        let class = packed.and_then(|packed| {
            let [_, r, g, b] = packed.to_be_bytes();
            self.options.palette.get(&[r, g, b])
        });
        class.copied().unwrap_or(UNLABELED)
    }
}

fn form_of(fields: &[PointField], has_palette: bool) -> Option<Form<'_>> {
    let named = |name: &str| fields.iter().find(|field| field.name == name);
    if let Some(field) = named("label_probs") {
        return Some(Form::Probabilities(field));
    }
    let classes = (0..MAX_PROBABILITY_FIELDS).map_while(|k| named(&format!("p_{k}")));
    let classes: Vec<_> = classes.collect();
    if !classes.is_empty() {
        return Some(Form::ProbabilityFields(classes));
    }
    if let Some(label) = named("label") {
        return Some(Form::Label(label, named("confidence")));
    }
    if !has_palette {
        return None;
    }
    let colors = COLORS.iter();
    let colors = colors.filter_map(|[color, confidence]| Some((named(color)?, named(confidence))));
    let colors: Vec<_> = colors.collect();
    if !colors.is_empty() {
        return Some(Form::Colors(colors));
    }
    if let Some(color) = named("semantic_color") {
        return Some(Form::Colors(vec![(color, named("confidence"))]));
    }
    let color = named("rgb").or_else(|| named("rgba"))?;
    Some(Form::Colors(vec![(color, None)]))
}

/// Confidence of a point, 1 without a confidence field.
fn confidence_at(view: &CloudView<'_>, field: Option<&PointField>, i: usize) -> f64 {
    field.map_or(1.0, |field| view.scalar(field, i))
}
