//! Pixel classes: mapping of label numbers, and label images sampled at the pixels of another image.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::vision_msgs::LabelInfo;

use super::image::{ImageError, ImageView};
use super::palette;
use crate::convert::semantic::{Color, palette_from_params};
use lattice_runtime::params::{ParamError, Params};

/// Ignored classes and class groups.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClassRules {
    /// Classes treated as unlabelled.
    pub ignored: BTreeSet<u16>,
    /// Group of each class, if any.
    pub groups: BTreeMap<u16, u16>,
    /// Class of each colour, for colour masks.
    pub palette: BTreeMap<Color, u16>,
}

impl ClassRules {
    /// Reads `ignored_labels`, `group_labels` and `palette_rgb_class`.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let ignored = params.i64_array("ignored_labels", &[])?;
        let ignored: Result<_, _> = ignored.into_iter().map(u16::try_from).collect();
        Ok(Self {
            ignored: ignored.map_err(|_| {
                params.invalid("ignored_labels", "expected numbers from 0 to 65535")
            })?,
            groups: groups(params)?,
            palette: palette_from_params(params)?,
        })
    }

    /// Label image with class numbers; the palette converts a colour mask.
    pub fn numbered(&self, image: Arc<Image>, max_pixels: usize) -> Result<Arc<Image>, ImageError> {
        palette::numbered(image, &self.palette, max_pixels)
    }

    /// Class of a point from its label number.
    pub fn class_of(&self, number: u16) -> u16 {
        match self.ignored.contains(&number) {
            true => UNLABELED,
            false => self.groups.get(&number).copied().unwrap_or(number),
        }
    }

    /// Names of the classes that points may have.
    pub fn names(&self, info: &LabelInfo) -> LabelInfo {
        let mut info = info.clone();
        let from = info.class_map.iter();
        let from = from.map(|class| self.class_of(class.class_id));
        let used: BTreeSet<u16> = from.filter(|class| *class != UNLABELED).collect();
        info.class_map
            .retain(|class| used.contains(&class.class_id));
        info
    }
}

fn groups(params: &Params) -> Result<BTreeMap<u16, u16>, ParamError> {
    let numbers = params.i64_array("group_labels", &[])?;
    let (pairs, rest) = numbers.as_chunks::<2>();
    let class = |v: i64| u16::try_from(v).ok().filter(|class| *class != UNLABELED);
    let pairs = pairs
        .iter()
        .map(|&[from, to]| Some((class(from)?, class(to)?)));
    let groups: Option<BTreeMap<_, _>> = rest.is_empty().then(|| pairs.collect()).flatten();
    groups.ok_or_else(|| {
        let problem = "expected two numbers for each class, itself and its group, from 0 to 65534";
        params.invalid("group_labels", problem)
    })
}

/// Mapping of label numbers to classes.
#[derive(Clone, Debug)]
pub struct Classes {
    /// Class of each label number; all 65536.
    class_of: Vec<u16>,
    /// Labels of lower confidence are dropped.
    min_confidence: f32,
}

impl Classes {
    /// Mapping by rules, for any confidence.
    pub fn new(rules: &ClassRules) -> Self {
        Self {
            class_of: class_table(rules),
            min_confidence: 0.0,
        }
    }

    /// Replaces the rules.
    pub fn set_rules(&mut self, rules: &ClassRules) {
        self.class_of = class_table(rules);
    }

    /// Sets the threshold of a LabelInfo: labels of lower confidence are dropped.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.min_confidence = if threshold.is_nan() { 0.0 } else { threshold };
    }

    /// Class from label number and confidence; `None`: unlabelled.
    pub fn known(&self, number: u16, confidence: f32) -> Option<u16> {
        let class = self.class_of.get(usize::from(number)).copied();
        class.filter(|class| *class != UNLABELED && confidence >= self.min_confidence)
    }
}

fn class_table(rules: &ClassRules) -> Vec<u16> {
    (0..=u16::MAX).map(|class| rules.class_of(class)).collect()
}

/// Rows of an image, sampled at the columns of another by nearest neighbour.
pub struct Sampled<'a, T> {
    view: ImageView<'a>,
    read: fn(&ImageView<'a>, usize, &mut Vec<T>),
    columns: Vec<usize>,
    row: Option<usize>,
    numbers: Vec<T>,
}

/// Pixel of `to` under the centre of pixel `at` of `from`.
pub(super) fn nearest(at: usize, from: usize, to: usize) -> usize {
    (2 * at + 1) * to / (2 * from)
}

impl<'a, T: Copy> Sampled<'a, T> {
    /// Sampler of an image at the columns of another, `width` pixels wide.
    pub fn new(
        view: ImageView<'a>,
        width: usize,
        read: fn(&ImageView<'a>, usize, &mut Vec<T>),
    ) -> Self {
        Self {
            columns: (0..width)
                .map(|column| nearest(column, width, view.width))
                .collect(),
            view,
            read,
            row: None,
            numbers: Vec::new(),
        }
    }

    /// Selects the row for a row of the other image of `height` rows.
    pub fn seek(&mut self, row: usize, height: usize) {
        let row = nearest(row, height, self.view.height);
        if self.row != Some(row) {
            self.row = Some(row);
            self.numbers.clear();
            (self.read)(&self.view, row, &mut self.numbers);
        }
    }

    /// Value at a column of the other image.
    pub fn at(&self, column: usize) -> Option<T> {
        self.numbers.get(*self.columns.get(column)?).copied()
    }
}
