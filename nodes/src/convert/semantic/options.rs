//! Options for labelled clouds.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::pose::Axes;

use lattice_runtime::params::{ParamError, Params};

/// Red, green and blue.
pub type Color = [u8; 3];

/// Mapping of labels and colours to classes.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelOptions {
    /// True if the class is the low 16 bits of a 32-bit label (SemanticKITTI, whose high bits
    /// are the instance).
    pub low_16_bits: bool,
    /// Classes treated as unlabelled, such as 0 in SemanticKITTI.
    pub ignored: BTreeSet<u16>,
    /// Class of each colour, for coloured labels.
    pub palette: BTreeMap<Color, u16>,
}

impl Default for LabelOptions {
    fn default() -> Self {
        Self {
            low_16_bits: true,
            ignored: BTreeSet::new(),
            palette: BTreeMap::new(),
        }
    }
}

impl LabelOptions {
    /// Reads `label_low_16_bits`, `ignored_labels` and `palette_rgb_class`.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let ignored = params.i64_array("ignored_labels", &[])?;
        let ignored: Result<_, _> = ignored.into_iter().map(u16::try_from).collect();
        Ok(Self {
            low_16_bits: params.bool("label_low_16_bits", defaults.low_16_bits)?,
            ignored: ignored.map_err(|_| {
                params.invalid("ignored_labels", "expected numbers from 0 to 65535")
            })?,
            palette: palette_from_params(params)?,
        })
    }
}

/// Reads `palette_rgb_class`: classes of colours.
pub fn palette_from_params(params: &Params) -> Result<BTreeMap<Color, u16>, ParamError> {
    let palette = params.i64_array("palette_rgb_class", &[])?;
    palette_from(&palette).ok_or_else(|| {
        let problem = "expected four numbers for each class: red, green, blue from 0 to 255 and the class from 0 \
                       to 65534";
        params.invalid("palette_rgb_class", problem)
    })
}

fn palette_from(numbers: &[i64]) -> Option<BTreeMap<Color, u16>> {
    let (entries, rest) = numbers.as_chunks::<4>();
    let entries = entries.iter().map(|&[r, g, b, class]| {
        let byte = |v: i64| u8::try_from(v).ok();
        let class = u16::try_from(class).ok().filter(|class| *class < u16::MAX);
        Some(([byte(r)?, byte(g)?, byte(b)?], class?))
    });
    rest.is_empty().then(|| entries.collect()).flatten()
}

/// Options for headset clouds.
#[derive(Clone, Debug, PartialEq)]
pub struct SemanticOptions {
    /// Limit of points per cloud.
    pub max_points: usize,
    /// Points farther from the origin are rejected, m.
    pub max_range_m: f64,
    /// Axis convention of the sender.
    pub axes: Axes,
    /// True to reject clouds without labels.
    pub require_labels: bool,
    /// Meaning of labels.
    pub labels: LabelOptions,
}

impl Default for SemanticOptions {
    fn default() -> Self {
        Self {
            max_points: 500_000,
            max_range_m: 200.0,
            axes: Axes::RosFlu,
            require_labels: false,
            labels: LabelOptions::default(),
        }
    }
}

impl SemanticOptions {
    /// Reads `max_cloud_points`, `max_range_m`, `headset_axes`, `require_labels` and the
    /// parameters of [`LabelOptions`].
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let axes = params.string("headset_axes", defaults.axes.name())?;
        Ok(Self {
            max_points: params.positive("max_cloud_points", defaults.max_points)?,
            max_range_m: params.f64_in("max_range_m", defaults.max_range_m, 1e-3..=1e9)?,
            axes: axes
                .parse()
                .map_err(|e| params.invalid("headset_axes", format!("{e}")))?,
            require_labels: params.bool("require_labels", defaults.require_labels)?,
            labels: LabelOptions::from_params(params)?,
        })
    }
}
