//! Point clouds: field access for any layout, per-point time, deskewing.
//!
//! A [`CloudLayout`] describes the memory layout. [`CloudLayout::view`] validates it against the data once; the
//! resulting [`CloudView`] reads points safely. [`transform_records`] transforms them to the map frame, each with the
//! pose at its own time.

mod coordinates;
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
