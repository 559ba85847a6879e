//! Point clouds: field access for any layout, per-point time, deskew.
//!
//! A [`CloudLayout`] says how a sensor packs its points; [`CloudLayout::view`] checks every
//! one of its numbers against the data once, after which a [`CloudView`] reads points
//! without trusting anything. [`transform_records`] brings them into the map, each with the
//! pose of its own time.

mod error;
mod layout;
mod mend;
mod points;
mod record;
mod time;
mod time_field;
mod time_options;
mod transform;
mod view;

pub use error::{CloudError, FittingUnit};
pub use layout::{CloudLayout, CloudLimits, Datatype, PointField};
pub use mend::LayoutNote;
pub use points::Cloud;
pub use record::{Precision, RecordFormat, VIEWPOINT_FIELDS};
pub use time::{NO_TIME_NS, PointTimes, TimeSource};
pub use time_options::{TimeOptions, TimeReference, TimeUnit};
pub use transform::{RangeLimits, Records, transform_records};
pub use view::CloudView;

#[cfg(test)]
mod tests;
