//! Layout of the points of a cloud, and its validation.

use super::CloudError;
use super::coordinates::Coordinates;

pub(super) const MAX_FIELDS: usize = 256;
/// Maximum length of a name repeated in an error.
const SHOWN_CHARS: usize = 48;
/// Maximum number of names repeated in an error.
const SHOWN_FIELDS: usize = 24;

/// Field of a point, as `sensor_msgs/PointField`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PointField {
    /// Name.
    pub name: String,
    /// Offset of the field in its point, bytes.
    pub offset: u32,
    /// Type code, 1 to 11.
    pub datatype: u8,
    /// Elements.
    pub count: u32,
}

/// Memory layout of a cloud, as `sensor_msgs/PointCloud2`.
///
/// ```
/// use lattice_core::cloud::{CloudLayout, CloudLimits, Datatype, PointField};
///
/// let field = |(name, offset): (&str, u32)| PointField {
///     name: name.into(),
///     offset,
///     datatype: Datatype::Float32 as u8,
///     count: 1,
/// };
/// let layout = CloudLayout {
///     width: 1,
///     height: 1,
///     point_step: 12,
///     row_step: 12,
///     is_bigendian: false,
///     fields: [("x", 0), ("y", 4), ("z", 8)].map(field).into(),
/// };
/// let data = [1.0_f32, 2.0, 3.0].map(f32::to_le_bytes).concat();
/// let view = layout.view(&data, &CloudLimits::default())?;
/// assert_eq!(view.xyz(0).as_slice(), [1.0, 2.0, 3.0]);
/// assert!(layout.view(&data[..11], &CloudLimits::default()).is_err());
/// # Ok::<(), lattice_core::cloud::CloudError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CloudLayout {
    /// Points per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Bytes per point.
    pub point_step: u32,
    /// Bytes per row.
    pub row_step: u32,
    /// True for big-endian data.
    pub is_bigendian: bool,
    /// Fields of a point.
    pub fields: Vec<PointField>,
}

/// Limits of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CloudLimits {
    /// Maximum number of points.
    pub max_points: usize,
}

impl Default for CloudLimits {
    fn default() -> CloudLimits {
        CloudLimits {
            max_points: 4_000_000,
        }
    }
}

/// Types of `sensor_msgs/PointField`, 1 to 8, and of `pcl::PCLPointField`, 9 to 11.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[expect(missing_docs, reason = "the names say the types")]
pub enum Datatype {
    Int8 = 1,
    Uint8 = 2,
    Int16 = 3,
    Uint16 = 4,
    Int32 = 5,
    Uint32 = 6,
    Float32 = 7,
    Float64 = 8,
    Int64 = 9,
    Uint64 = 10,
    Bool = 11,
}

impl Datatype {
    /// Type of a code; `None` if there is none.
    pub fn from_code(code: u8) -> Option<Datatype> {
        Some(match code {
            1 => Datatype::Int8,
            2 => Datatype::Uint8,
            3 => Datatype::Int16,
            4 => Datatype::Uint16,
            5 => Datatype::Int32,
            6 => Datatype::Uint32,
            7 => Datatype::Float32,
            8 => Datatype::Float64,
            9 => Datatype::Int64,
            10 => Datatype::Uint64,
            11 => Datatype::Bool,
            _ => return None,
        })
    }

    /// Bytes of an element.
    pub fn bytes(self) -> u32 {
        match self {
            Datatype::Int8 | Datatype::Uint8 | Datatype::Bool => 1,
            Datatype::Int16 | Datatype::Uint16 => 2,
            Datatype::Int32 | Datatype::Uint32 | Datatype::Float32 => 4,
            Datatype::Float64 | Datatype::Int64 | Datatype::Uint64 => 8,
        }
    }

    /// Name as in `sensor_msgs/PointField` and PCL.
    pub fn name(self) -> &'static str {
        match self {
            Datatype::Int8 => "INT8",
            Datatype::Uint8 => "UINT8",
            Datatype::Int16 => "INT16",
            Datatype::Uint16 => "UINT16",
            Datatype::Int32 => "INT32",
            Datatype::Uint32 => "UINT32",
            Datatype::Float32 => "FLOAT32",
            Datatype::Float64 => "FLOAT64",
            Datatype::Int64 => "INT64",
            Datatype::Uint64 => "UINT64",
            Datatype::Bool => "BOOL",
        }
    }
}

impl CloudLayout {
    pub(super) fn check_extent(&self, bytes: usize) -> Result<(), CloudError> {
        if self.point_step == 0 {
            return Err(CloudError::PointStep {
                points: u64::from(self.width) * u64::from(self.height),
            });
        }
        let row_needs = u64::from(self.width) * u64::from(self.point_step);
        if u64::from(self.row_step) < row_needs {
            return Err(CloudError::RowStep {
                row_step: self.row_step,
                width: self.width,
                point_step: self.point_step,
                needed: row_needs,
            });
        }
        // The last row need not be padded.
        let rows_before = u64::from(self.height).saturating_sub(1);
        let needed = (rows_before * u64::from(self.row_step)).saturating_add(row_needs);
        if (bytes as u64) < needed {
            return Err(CloudError::ShortData {
                bytes,
                height: self.height,
                row_step: self.row_step,
                needed,
            });
        }
        Ok(())
    }

    pub(super) fn check_fields(&self) -> Result<(), CloudError> {
        if self.fields.len() > MAX_FIELDS {
            return Err(CloudError::TooManyFields {
                fields: self.fields.len(),
                max_fields: MAX_FIELDS,
            });
        }
        for (i, field) in self.fields.iter().enumerate() {
            if let Some(problem) = field.problem(self.point_step) {
                return Err(problem);
            }
            if self.fields.iter().take(i).any(|f| f.name == field.name) {
                return Err(CloudError::Duplicate {
                    field: shown(&field.name),
                });
            }
        }
        Ok(())
    }

    pub(super) fn coordinates(&self) -> Result<Coordinates, CloudError> {
        let [x, y, z] = [
            self.coordinate("x")?,
            self.coordinate("y")?,
            self.coordinate("z")?,
        ];
        let wide = match (x.1, y.1, z.1) {
            (Datatype::Float32, Datatype::Float32, Datatype::Float32) => false,
            (Datatype::Float64, Datatype::Float64, Datatype::Float64) => true,
            _ => {
                return Err(CloudError::CoordinateTypes {
                    x: x.1.name(),
                    y: y.1.name(),
                    z: z.1.name(),
                });
            }
        };
        Ok(Coordinates {
            offsets: [x.0, y.0, z.0],
            wide,
        })
    }

    fn coordinate(&self, name: &'static str) -> Result<(usize, Datatype), CloudError> {
        let field = self.fields.iter().find(|f| f.name == name).ok_or_else(|| {
            CloudError::MissingField {
                field: name,
                present: names(&self.fields),
            }
        })?;
        if field.count != 1 {
            return Err(CloudError::CoordinateCount {
                field: name,
                count: field.count,
            });
        }
        let datatype =
            Datatype::from_code(field.datatype).ok_or_else(|| CloudError::UnknownDatatype {
                field: name.to_owned(),
                datatype: field.datatype,
            })?;
        Ok((field.offset as usize, datatype))
    }
}

/// Name from outside, truncated for a log.
pub(super) fn shown(name: &str) -> String {
    name.chars().take(SHOWN_CHARS).collect()
}

/// Names of the fields, truncated for a log.
pub(super) fn names(fields: &[PointField]) -> String {
    let mut names: Vec<String> = fields
        .iter()
        .take(SHOWN_FIELDS)
        .map(|f| shown(&f.name))
        .collect();
    if fields.len() > SHOWN_FIELDS {
        names.push(format!("and {} more", fields.len() - SHOWN_FIELDS));
    }
    if names.is_empty() {
        return "none".to_owned();
    }
    names.join(", ")
}
