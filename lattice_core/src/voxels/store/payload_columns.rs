//! Further columns of voxels: stamps and labels.

use super::growth;

/// Further columns that a list keeps; each costs memory and time.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Payload {
    /// Stamps of the first and the last point: 16 bytes a voxel.
    pub stamps: bool,
    /// Number of points of each label: 24 bytes a voxel and 8 for each label.
    pub labels: bool,
}

impl Payload {
    /// True if count and sum are all that is kept.
    pub fn is_plain(&self) -> bool {
        *self == Payload::default()
    }
}

/// Points with one label.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct LabelCount {
    /// The label.
    pub label: u16,
    /// Number of points; stays at `u32::MAX` once there.
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

/// The further columns of a shard; those that are not kept are empty.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Columns {
    payload: Payload,
    pub(crate) stamps: Vec<Stamps>,
    pub(crate) labels: Vec<Vec<LabelCount>>,
}

/// Contribution of points to the further columns of a voxel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Details {
    pub(crate) stamps: Option<Stamps>,
    pub(crate) labels: Vec<LabelCount>,
}

impl Columns {
    pub(crate) fn new(payload: Payload) -> Columns {
        Columns {
            payload,
            stamps: Vec::new(),
            labels: Vec::new(),
        }
    }

    /// Columns that are kept.
    pub(crate) fn payload(&self) -> Payload {
        self.payload
    }

    /// Keeps these stamps, a row for each voxel.
    pub(crate) fn set_stamps(&mut self, stamps: Vec<Stamps>) {
        self.payload.stamps = true;
        self.stamps = stamps;
    }

    /// Keeps these labels, a row for each voxel.
    pub(crate) fn set_labels(&mut self, labels: Vec<Vec<LabelCount>>) {
        self.payload.labels = true;
        self.labels = labels;
    }

    /// Appends row `number` of columns of the same payload.
    pub(crate) fn push_row(&mut self, other: &Columns, number: usize) {
        self.stamps.extend(other.stamps.get(number));
        self.labels.extend(other.labels.get(number).cloned());
    }

    /// The rows with these numbers, in this order.
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
    }

    /// Adds to the columns of voxel `number` that are kept.
    pub(crate) fn add(&mut self, number: usize, details: &Details) {
        if let (Some(stamps), Some(more)) = (self.stamps.get_mut(number), details.stamps) {
            stamps.add(&more);
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
        }
    }

    pub(crate) fn swap_remove(&mut self, number: usize) {
        if self.payload.stamps {
            self.stamps.swap_remove(number);
        }
        if self.payload.labels {
            self.labels.swap_remove(number);
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
    }

    /// True if every column that is kept has `len` rows and no other has any.
    pub(crate) fn fits(&self, len: usize) -> bool {
        let expected = |kept: bool| if kept { len } else { 0 };
        self.stamps.len() == expected(self.payload.stamps)
            && self.labels.len() == expected(self.payload.labels)
    }
}
