//! Static transforms recorded after the first cloud, which apply from the beginning of a replay.

use std::collections::BTreeMap;

use lattice_bag::{BagReader, ReadOptions};
use lattice_msgs::cdr;
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::Isometry3;

use super::survey::{MAX_TF_MESSAGES, bare};
use super::topic_plan::TopicPlan;
use super::topics::{Role, TopicError};
use crate::convert::geometry;

/// Limit of frames with a static transform.
const MAX_FRAMES: usize = 2000;
/// Limit of lines for the user.
const MAX_LINES: usize = 10;
/// Rounding difference of equal transforms, m and rad.
const SAME: f64 = 1e-6;

/// Static transforms to apply before the first message.
#[derive(Debug, Default)]
pub(super) struct LateStatics {
    /// First transform of each child frame that is recorded after the first cloud.
    pub message: TFMessage,
    /// Log lines: one per late transform, and one per change of a transform.
    pub lines: Vec<String>,
    untold: u64,
}

impl LateStatics {
    /// Reads the static transforms of a log with a plan of its topics.
    ///
    /// A transform with two values has the first one until the time of the second, as in the log.
    pub fn read(bag: &BagReader, plan: &TopicPlan) -> Result<Self, TopicError> {
        let mut found = Self::default();
        let messages = |wanted: fn(Role) -> bool| {
            bag.messages(&ReadOptions {
                topics: Some(plan.names(bag, wanted)),
                ..ReadOptions::default()
            })
        };
        let Some(first) = messages(Role::is_cloud)?.next() else {
            return Ok(found);
        };
        let cloud_ns = first?.log_time_ns;
        let is_static = |role| role == Role::Transforms(true);
        let counts = plan.topics(bag, is_static).map(|topic| topic.message_count);
        let count = usize::try_from(counts.fold(0, u64::saturating_add)).unwrap_or(usize::MAX);
        let mut values: BTreeMap<String, Isometry3<f64>> = BTreeMap::new();
        for message in messages(is_static)?.take(count.min(MAX_TF_MESSAGES)) {
            let message = message?;
            let Ok(transforms) = cdr::from_slice::<TFMessage>(&message.data) else {
                continue;
            };
            let after_s = message.log_time_ns.saturating_sub(cloud_ns) as f64 * 1e-9;
            for transform in transforms.transforms {
                // An invalid transform is rejected during the replay.
                if let Some(value) = geometry::isometry_from_transform(&transform.transform) {
                    found.take(&mut values, transform, value, after_s);
                }
            }
        }
        if found.untold > 0 {
            let line = format!("static transforms: {} more such lines", found.untold);
            found.lines.push(line);
        }
        Ok(found)
    }

    fn take(
        &mut self,
        values: &mut BTreeMap<String, Isometry3<f64>>,
        transform: TransformStamped,
        value: Isometry3<f64>,
        after_s: f64,
    ) {
        let child = bare(&transform.child_frame_id);
        let name = format!("{} -> {child}", bare(&transform.header.frame_id));
        match values.get(&child) {
            Some(known) => {
                let apart = known.inverse() * value;
                if apart.translation.vector.norm().max(apart.rotation.angle()) > SAME {
                    self.tell(format!(
                        "static transform {name} changes {after_s:.1} s after the first cloud: the new value applies \
                         from there on"
                    ));
                    values.insert(child, value);
                }
            }
            None if values.len() < MAX_FRAMES => {
                values.insert(child, value);
                if after_s > 0.0 {
                    self.tell(format!(
                        "static transform {name} is recorded {after_s:.1} s after the first cloud: it applies from the \
                         beginning"
                    ));
                    self.message.transforms.push(transform);
                }
            }
            None => {}
        }
    }

    fn tell(&mut self, line: String) {
        match self.lines.len() < MAX_LINES {
            true => self.lines.push(line),
            false => self.untold += 1,
        }
    }
}
