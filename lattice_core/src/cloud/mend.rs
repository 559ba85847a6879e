//! Repair of layouts that drivers declare wrongly.

use std::fmt;

use super::layout::{MAX_FIELDS, shown};
use super::{CloudError, CloudLayout, Datatype, PointField};

/// Repair of a layout: what was ignored or changed.
#[derive(Clone, Debug, PartialEq)]
pub enum LayoutNote {
    /// Unreadable field, ignored.
    FieldIgnored(CloudError),
    /// Scalar of count 0, as PCL declares padding; read as one element.
    CountZero {
        /// Name of the field.
        field: String,
    },
    /// Rows without padding, although `row_step` declares some.
    RowStep {
        /// Declared value.
        row_step: u32,
        /// Value used.
        used: u32,
    },
    /// Height 0, read as 1.
    HeightZero {
        /// Points of the row.
        points: u32,
    },
    /// Data in a cloud that declares no points.
    DataWithoutPoints {
        /// Points of a row, as declared.
        width: u32,
        /// Rows, as declared.
        height: u32,
        /// Bytes of the data.
        bytes: usize,
    },
}

impl fmt::Display for LayoutNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FieldIgnored(problem) => write!(f, "{problem}: the field is ignored"),
            Self::CountZero { field } => write!(f, "field '{field}' has count 0, read as 1"),
            Self::RowStep { row_step, used } => write!(
                f,
                "row_step is {row_step}, read as width * point_step = {used} as the data allow"
            ),
            Self::HeightZero { points } => {
                write!(f, "height is 0, read as 1: data has {points} points")
            }
            Self::DataWithoutPoints {
                width,
                height,
                bytes,
            } => write!(
                f,
                "width {width} * height {height} is 0 points, but data has {bytes} bytes: nothing is read"
            ),
        }
    }
}

impl CloudLayout {
    /// Repairs the layout as far as `bytes` bytes of data determine it, and returns the changes.
    ///
    /// Coordinates are never ignored: if they are unreadable, [`CloudLayout::view`] fails.
    pub fn mend(&mut self, bytes: usize) -> Vec<LayoutNote> {
        let mut notes = Vec::new();
        if self.fields.len() <= MAX_FIELDS {
            self.mend_fields(&mut notes);
        }
        self.mend_extent(bytes as u64, &mut notes);
        if self.width == 0 || self.height == 0 {
            let (width, height) = (self.width, self.height);
            if bytes > 0 {
                notes.push(LayoutNote::DataWithoutPoints {
                    width,
                    height,
                    bytes,
                });
            }
        }
        notes
    }

    fn mend_fields(&mut self, notes: &mut Vec<LayoutNote>) {
        for field in &mut self.fields {
            if field.count == 0 {
                field.count = 1;
                notes.push(LayoutNote::CountZero {
                    field: shown(&field.name),
                });
            }
        }
        let mut kept: Vec<PointField> = Vec::with_capacity(self.fields.len());
        for field in self.fields.drain(..) {
            let is_second = kept.iter().any(|other| other.name == field.name);
            let is_coordinate = matches!(&*field.name, "x" | "y" | "z");
            let problem = match is_second {
                true => Some(CloudError::Duplicate {
                    field: shown(&field.name),
                }),
                false => field.problem(self.point_step),
            };
            match problem {
                Some(problem) if is_second || !is_coordinate => {
                    notes.push(LayoutNote::FieldIgnored(problem));
                }
                _ => kept.push(field),
            }
        }
        self.fields = kept;
    }

    fn mend_extent(&mut self, bytes: u64, notes: &mut Vec<LayoutNote>) {
        let row_needs = u64::from(self.width) * u64::from(self.point_step);
        if row_needs == 0 {
            return;
        }
        if self.height == 0 && bytes == row_needs {
            self.height = 1;
            notes.push(LayoutNote::HeightZero { points: self.width });
        }
        let rows = u64::from(self.height);
        if rows == 0 {
            return;
        }
        let is_sound = u64::from(self.row_step) >= row_needs
            && (rows.saturating_sub(1) * u64::from(self.row_step)).saturating_add(row_needs)
                <= bytes;
        let is_tight =
            rows.checked_mul(row_needs) == Some(bytes) || (rows == 1 && row_needs <= bytes);
        if let (false, true, Ok(used)) = (is_sound, is_tight, u32::try_from(row_needs)) {
            notes.push(LayoutNote::RowStep {
                row_step: self.row_step,
                used,
            });
            self.row_step = used;
        }
    }
}

impl PointField {
    /// Reason that the field cannot be read from a point of `point_step` bytes.
    pub(super) fn problem(&self, point_step: u32) -> Option<CloudError> {
        let field = || shown(&self.name);
        let Some(datatype) = Datatype::from_code(self.datatype) else {
            return Some(CloudError::UnknownDatatype {
                field: field(),
                datatype: self.datatype,
            });
        };
        if self.count == 0 {
            return Some(CloudError::CountZero { field: field() });
        }
        let end = u64::from(self.offset) + u64::from(self.count) * u64::from(datatype.bytes());
        (end > u64::from(point_step)).then(|| CloudError::BeyondPoint {
            field: field(),
            end,
            point_step,
        })
    }
}
