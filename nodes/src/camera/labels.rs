//! Classes of pixels: which numbers mean what, and images of labels read at the pixels of another.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::vision_msgs::LabelInfo;

use super::image::{ImageError, ImageView};
use super::palette;
use crate::convert::semantic::{Color, palette_from_params};
use lattice_runtime::params::{ParamError, Params};

/// Classes that say nothing, and those that count as others.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClassRules {
    /// Classes that say nothing.
    pub ignored: BTreeSet<u16>,
    /// Class that others count as.
    pub groups: BTreeMap<u16, u16>,
    /// Class of a colour, for masks of colours.
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

    /// A label image as numbers: a mask of colours becomes one by the palette.
    pub fn numbered(&self, image: Arc<Image>, max_pixels: usize) -> Result<Arc<Image>, ImageError> {
        palette::numbered(image, &self.palette, max_pixels)
    }

    /// Class of a point by the number of its pixel.
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

/// Meaning of the numbers in label images.
#[derive(Clone, Debug)]
pub struct Classes {
    /// Class of a point by the number of its pixel; all 65536.
    class_of: Vec<u16>,
    /// Labels of less confidence are none.
    min_confidence: f32,
}

impl Classes {
    /// Classes by rules, of any confidence.
    pub fn new(rules: &ClassRules) -> Self {
        Self {
            class_of: class_table(rules),
            min_confidence: 0.0,
        }
    }

    /// Goes on with other rules.
    pub fn set_rules(&mut self, rules: &ClassRules) {
        self.class_of = class_table(rules);
    }

    /// Takes the threshold of a LabelInfo: labels of less confidence are none.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.min_confidence = if threshold.is_nan() { 0.0 } else { threshold };
    }

    /// Class of a pixel by its number and confidence; `None`: it says nothing.
    pub fn known(&self, number: u16, confidence: f32) -> Option<u16> {
        let class = self.class_of.get(usize::from(number)).copied();
        class.filter(|class| *class != UNLABELED && confidence >= self.min_confidence)
    }
}

fn class_table(rules: &ClassRules) -> Vec<u16> {
    (0..=u16::MAX).map(|class| rules.class_of(class)).collect()
}

/// Rows of an image, read at the columns of another by nearest neighbour.
pub struct Sampled<'a, T> {
    view: ImageView<'a>,
    read: fn(&ImageView<'a>, usize, &mut Vec<T>),
    columns: Vec<usize>,
    row: Option<usize>,
    numbers: Vec<T>,
}

/// Place in `to` pixels under the centre of a pixel of `from`.
pub(super) fn nearest(at: usize, from: usize, to: usize) -> usize {
    (2 * at + 1) * to / (2 * from)
}

impl<'a, T: Copy> Sampled<'a, T> {
    /// An image to be read at the columns of another, `width` pixels wide.
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

    /// Goes to a row of the other image, which has `height` of them.
    pub fn seek(&mut self, row: usize, height: usize) {
        let row = nearest(row, height, self.view.height);
        if self.row != Some(row) {
            self.row = Some(row);
            self.numbers.clear();
            (self.read)(&self.view, row, &mut self.numbers);
        }
    }

    /// The number at a column of the other image.
    pub fn at(&self, column: usize) -> Option<T> {
        self.numbers.get(*self.columns.get(column)?).copied()
    }
}
