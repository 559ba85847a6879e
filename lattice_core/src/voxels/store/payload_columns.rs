//! Optional columns of voxels: stamps, labels and colours.

use super::color_sum::{ColorSum, PackedColor};
use super::growth;

/// Optional columns of a list; each costs memory and time.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Payload {
    /// Stamps of the first and the last point: 16 bytes per voxel.
    pub stamps: bool,
    /// Number of points per label: 24 bytes per voxel and 8 per label.
    pub labels: bool,
    /// Sums of the colours of the points: 20 bytes per voxel.
    pub color: bool,
}

impl Payload {
    /// Tests whether there are no optional columns.
    pub fn is_plain(&self) -> bool {
        *self == Payload::default()
    }
}

/// Number of points with one label.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct LabelCount {
    /// Label.
    pub label: u16,
    /// Number of points; saturates at `u32::MAX`.
    pub count: u32,
}

/// Stamps of the first and last point in a voxel, ns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stamps {
    /// Stamp of the first point.
    pub first_ns: i64,
    /// Stamp of the last point.
    pub last_ns: i64,
}

impl Stamps {
    /// Stamps of no points.
    pub const NONE: Stamps = Stamps {
        first_ns: i64::MAX,
        last_ns: i64::MIN,
    };

    fn add(&mut self, other: &Stamps) {
        self.first_ns = self.first_ns.min(other.first_ns);
        self.last_ns = self.last_ns.max(other.last_ns);
    }
}

/// Optional columns of a shard; empty if not kept.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Columns {
    payload: Payload,
    pub(crate) stamps: Vec<Stamps>,
    pub(crate) labels: Vec<Vec<LabelCount>>,
    pub(crate) colors: Vec<PackedColor>,
}

/// Contribution of points to the optional columns of a voxel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Details {
    pub(crate) stamps: Option<Stamps>,
    pub(crate) labels: Vec<LabelCount>,
    pub(crate) color: ColorSum,
}

impl Columns {
    pub(crate) fn new(payload: Payload) -> Columns {
        Columns {
            payload,
            stamps: Vec::new(),
            labels: Vec::new(),
            colors: Vec::new(),
        }
    }

    /// Kept columns.
    pub(crate) fn payload(&self) -> Payload {
        self.payload
    }

    /// Sets the stamps, one row per voxel.
    pub(crate) fn set_stamps(&mut self, stamps: Vec<Stamps>) {
        self.payload.stamps = true;
        self.stamps = stamps;
    }

    /// Sets the labels, one row per voxel.
    pub(crate) fn set_labels(&mut self, labels: Vec<Vec<LabelCount>>) {
        self.payload.labels = true;
        self.labels = labels;
    }

    /// Sets the colours, one row per voxel.
    pub(crate) fn set_colors(&mut self, colors: impl Iterator<Item = ColorSum>) {
        self.payload.color = true;
        self.colors = colors.map(PackedColor::from).collect();
    }

    /// Colours of all rows.
    pub(crate) fn colors(&self) -> impl Iterator<Item = ColorSum> {
        self.colors.iter().map(|packed| ColorSum::from(*packed))
    }

    /// Appends row `number` of columns of the same payload.
    pub(crate) fn push_row(&mut self, other: &Columns, number: usize) {
        self.stamps.extend(other.stamps.get(number));
        self.labels.extend(other.labels.get(number).cloned());
        self.colors.extend(other.colors.get(number));
    }

    /// Rows of these indices, in this order.
    pub(crate) fn gather(&self, numbers: impl Iterator<Item = usize>) -> Columns {
        let mut gathered = Columns::new(self.payload);
        if !self.payload.is_plain() {
            numbers.for_each(|number| gathered.push_row(self, number));
        }
        gathered
    }

    pub(crate) fn push(&mut self) {
        if self.payload.stamps {
            growth::push(&mut self.stamps, Stamps::NONE);
        }
        if self.payload.labels {
            growth::push(&mut self.labels, Vec::new());
        }
        if self.payload.color {
            growth::push(&mut self.colors, PackedColor::default());
        }
    }

    /// Adds to the kept columns of voxel `number`.
    pub(crate) fn add(&mut self, number: usize, details: &Details) {
        if let (Some(stamps), Some(more)) = (self.stamps.get_mut(number), details.stamps) {
            stamps.add(&more);
        }
        if let Some(color) = self.colors.get_mut(number) {
            color.add(&details.color);
        }
        if let Some(labels) = self.labels.get_mut(number) {
            for more in &details.labels {
                match labels.binary_search_by_key(&more.label, |known| known.label) {
                    Ok(at) => {
                        if let Some(known) = labels.get_mut(at) {
                            known.count = known.count.saturating_add(more.count);
                        }
                    }
                    Err(at) => labels.insert(at, *more),
                }
            }
        }
    }

    /// Row of voxel `number`.
    pub(crate) fn get(&self, number: usize) -> Details {
        Details {
            stamps: self.stamps.get(number).copied(),
            labels: self.labels.get(number).cloned().unwrap_or_default(),
            color: self.colors.get(number).copied().unwrap_or_default().into(),
        }
    }

    pub(crate) fn swap_remove(&mut self, number: usize) {
        if self.payload.stamps {
            self.stamps.swap_remove(number);
        }
        if self.payload.labels {
            self.labels.swap_remove(number);
        }
        if self.payload.color {
            self.colors.swap_remove(number);
        }
    }

    pub(crate) fn clear(&mut self) {
        *self = Columns::new(self.payload);
    }

    pub(crate) fn bytes(&self) -> usize {
        let labels = self
            .labels
            .iter()
            .map(|l| l.capacity() * size_of::<LabelCount>());
        self.stamps.capacity() * size_of::<Stamps>()
            + self.labels.capacity() * size_of::<Vec<LabelCount>>()
            + labels.sum::<usize>()
            + self.colors.capacity() * size_of::<PackedColor>()
    }

    /// Tests whether every kept column has `len` rows and every other none.
    pub(crate) fn fits(&self, len: usize) -> bool {
        let expected = |kept: bool| if kept { len } else { 0 };
        self.stamps.len() == expected(self.payload.stamps)
            && self.labels.len() == expected(self.payload.labels)
            && self.colors.len() == expected(self.payload.color)
    }
}
