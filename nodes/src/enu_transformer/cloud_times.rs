//! Times of the points of a cloud.

use lattice_core::cloud::{CloudError, CloudLimits, NO_TIME_NS, TimeOptions};
use lattice_msgs::sensor_msgs::PointCloud2;

use super::cloud_notes::CloudNotes;
use crate::cloud_input;
use crate::convert::cloud;

/// Times of the points of a cloud whose layout has been checked.
pub(crate) struct CloudTimes {
    pub stamp_ns: i64,
    /// Time of each point; `None`: all at the stamp.
    pub times_ns: Option<Vec<i64>>,
    /// Times of the earliest and latest point.
    pub first_ns: i64,
    pub last_ns: i64,
}

impl CloudTimes {
    /// Checks the layout of a cloud and reads its times, unless `time` is `None`; notes what was read otherwise than
    /// declared. `offset_ns` is added to all times.
    pub fn read(
        topic: &str,
        message: &PointCloud2,
        max_points: usize,
        time: Option<&TimeOptions>,
        offset_ns: i64,
        notes: &mut CloudNotes,
    ) -> Result<Self, CloudError> {
        let stamp_ns = message.header.stamp.to_ns();
        let (layout, mended) = cloud::mended_layout_of(message);
        notes.on_layout(topic, &mended);
        let view = layout.view(&message.data, &CloudLimits { max_points })?;
        let mut times_ns = match time {
            Some(time) => {
                let time = cloud_input::time_options(message, time);
                let found = view.point_times(stamp_ns, &time)?;
                notes.on_times(topic, stamp_ns, &found.source);
                found.times_ns
            }
            None => None,
        };
        let stamp_ns = stamp_ns.saturating_add(offset_ns);
        if offset_ns != 0 {
            let all = times_ns.iter_mut().flatten();
            all.filter(|t| **t != NO_TIME_NS)
                .for_each(|t| *t = t.saturating_add(offset_ns));
        }
        let known = times_ns.iter().flatten().filter(|t| **t != NO_TIME_NS);
        let span = known.fold(None, |span, &t| {
            let (first, last) = span.unwrap_or((t, t));
            Some((t.min(first), t.max(last)))
        });
        let (first_ns, last_ns) = span.unwrap_or((stamp_ns, stamp_ns));
        Ok(Self {
            stamp_ns,
            times_ns,
            first_ns,
            last_ns,
        })
    }
}
