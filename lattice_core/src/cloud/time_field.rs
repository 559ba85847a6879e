//! Detection of the time field of a cloud and of its unit.

use super::layout::{names, shown};
use super::{CloudError, CloudView, Datatype, PointField, TimeOptions, TimeReference, TimeUnit};

/// Field names of times, with an optional unit suffix; the first present one wins.
const NAMES: [&str; 9] = [
    "time",
    "t",
    "time_stamp",
    "timestamp",
    "offset_time",
    "time_offset",
    "ts",
    "stamp",
    "stamps",
];
/// Name suffixes that state a unit.
const UNITS: [(&str, TimeUnit); 4] = [
    ("_ns", TimeUnit::Nanoseconds),
    ("_us", TimeUnit::Microseconds),
    ("_ms", TimeUnit::Milliseconds),
    ("_s", TimeUnit::Seconds),
];
/// Field names that are not times.
const NOT_TIMES: [&str; 34] = [
    "x",
    "y",
    "z",
    "i",
    "intensity",
    "intensities",
    "reflectivity",
    "reflectance",
    "ambient",
    "near_ir",
    "noise",
    "signal",
    "range",
    "distance",
    "ring",
    "line",
    "channel",
    "column",
    "row",
    "tag",
    "echo",
    "return_type",
    "azimuth",
    "elevation",
    "rgb",
    "rgba",
    "r",
    "g",
    "b",
    "a",
    "label",
    "label_probs",
    "confidence",
    "id",
];
/// Minimum 64-bit values taken as absolute: the year 1973 in seconds, milli-, micro- and nanoseconds.
const LEAST_ABSOLUTE: [(f64, TimeUnit); 4] = [
    (1.0e17, TimeUnit::Nanoseconds),
    (1.0e14, TimeUnit::Microseconds),
    (1.0e11, TimeUnit::Milliseconds),
    (1.0e8, TimeUnit::Seconds),
];

/// Time field with the unit stated by its name or an option.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeField<'a> {
    pub field: &'a PointField,
    datatype: Datatype,
    unit: Option<TimeUnit>,
}

impl<'a> TimeField<'a> {
    /// Selects the field named by the options, else the first one of a known name and type; `None` if there is none.
    pub fn of(view: &CloudView<'a>, options: &TimeOptions) -> Result<Option<Self>, CloudError> {
        let fields = view.fields();
        match options.field.as_deref() {
            Some(name) => {
                let field = fields.iter().find(|f| f.name == name);
                let field = field.ok_or_else(|| CloudError::MissingTimeField {
                    field: shown(name),
                    present: names(fields),
                })?;
                let found = Self::scalar(field, options);
                found.map(Some).ok_or_else(|| unit_unknown(field))
            }
            None => {
                let of_name = |name: &&str| {
                    let mut named = fields.iter().filter(|f| base_name(&f.name) == *name);
                    named.find_map(|field| {
                        let found = Self::scalar(field, options)?;
                        (found.unit.is_some() || found.has_usual_type()).then_some(found)
                    })
                };
                Ok(NAMES.iter().find_map(of_name))
            }
        }
    }

    /// Unit and reference as stated, else inferred from type and magnitude. `value` is one of the field's.
    pub fn guess(
        &self,
        value: f64,
        options: &TimeOptions,
    ) -> Result<(TimeUnit, TimeReference), CloudError> {
        let is_wide = matches!(
            self.datatype,
            Datatype::Float64 | Datatype::Int64 | Datatype::Uint64
        );
        let is_least = |(least, unit): &&(f64, TimeUnit)| {
            is_wide && value >= *least && self.unit.is_none_or(|stated| stated == *unit)
        };
        let absolute = LEAST_ABSOLUTE.iter().find(is_least);
        let by_type = match self.datatype {
            Datatype::Float32 | Datatype::Float64 => Some(TimeUnit::Seconds),
            _ if self.has_usual_type() => Some(TimeUnit::Nanoseconds),
            _ => None,
        };
        let unit = self.unit.or(absolute.map(|(_, unit)| *unit)).or(by_type);
        let guessed = match absolute {
            Some(_) => TimeReference::Absolute,
            None => TimeReference::StampStart,
        };
        let unit = unit.ok_or_else(|| unit_unknown(self.field))?;
        Ok((unit, options.reference.unwrap_or(guessed)))
    }

    fn scalar(field: &'a PointField, options: &TimeOptions) -> Option<Self> {
        let stated = UNITS
            .iter()
            .find(|(ending, _)| field.name.ends_with(ending));
        let datatype = Datatype::from_code(field.datatype)?;
        (field.count == 1).then_some(Self {
            field,
            datatype,
            unit: options.unit.or(stated.map(|(_, unit)| *unit)),
        })
    }

    /// Tests whether the type has the range of times of a sweep or of an epoch.
    fn has_usual_type(&self) -> bool {
        matches!(
            self.datatype,
            Datatype::Float32
                | Datatype::Float64
                | Datatype::Int32
                | Datatype::Uint32
                | Datatype::Int64
                | Datatype::Uint64
        )
    }
}

/// Names of possible time fields, for a log; empty if there are none.
pub(super) fn candidates(fields: &[PointField]) -> String {
    let may_be = |field: &&PointField| {
        let name = field.name.to_ascii_lowercase();
        !(NOT_TIMES.contains(&&*name) || name.starts_with("normal") || name.is_empty())
    };
    let left: Vec<PointField> = fields.iter().filter(may_be).cloned().collect();
    match left.is_empty() {
        true => String::new(),
        false => names(&left),
    }
}

fn base_name(name: &str) -> &str {
    let mut endings = UNITS.iter().map(|(ending, _)| *ending);
    endings
        .find_map(|ending| name.strip_suffix(ending))
        .unwrap_or(name)
}

fn unit_unknown(field: &PointField) -> CloudError {
    CloudError::TimeType {
        field: shown(&field.name),
        datatype: Datatype::from_code(field.datatype).map_or("unknown", Datatype::name),
        count: field.count,
    }
}
