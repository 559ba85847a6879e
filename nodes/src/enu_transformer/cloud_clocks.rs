//! Clock steps of cloud topics relative to the poses.

/// Limit of tracked topics.
const MAX_TOPICS: usize = 256;

/// State of a cloud topic's clock when the cloud arrived.
#[derive(Clone, Copy, Debug, Default)]
pub struct CloudClock {
    /// Forward steps of the poses until then.
    steps: u64,
    /// True if the stamps of its topic have stepped back since the last step.
    is_set: bool,
}

/// Stamps of one topic.
#[derive(Clone, Debug)]
struct TopicClock {
    topic: String,
    last_ns: i64,
    /// Forward steps of the poses at the last backward step of the stamps.
    set_at: Option<u64>,
    /// Newest pose of the previous clock, while this topic may still use it.
    before_ns: Option<i64>,
}

/// Stamps of all cloud topics, and the number of forward steps of the poses.
#[derive(Clone, Debug, Default)]
pub(super) struct CloudClocks {
    steps: u64,
    topics: Vec<TopicClock>,
}

impl CloudClocks {
    /// Counts a pose newer than all before.
    pub fn on_step(&mut self) {
        self.steps = self.steps.wrapping_add(1);
    }

    /// Handles the stamp of a cloud; `newest_ns` is that of the poses. `None` for a cloud of a previous clock
    /// whose poses are gone.
    pub fn on_cloud(
        &mut self,
        topic: &str,
        stamp_ns: i64,
        newest_ns: Option<i64>,
    ) -> Option<CloudClock> {
        let steps = self.steps;
        let clock = |is_set| Some(CloudClock { steps, is_set });
        let Some(known) = self.topics.iter_mut().find(|known| known.topic == topic) else {
            if self.topics.len() < MAX_TOPICS {
                self.topics.push(TopicClock {
                    topic: topic.to_owned(),
                    last_ns: stamp_ns,
                    set_at: None,
                    before_ns: None,
                });
            }
            return clock(false);
        };
        if stamp_ns < known.last_ns {
            known.set_at = Some(steps);
            known.before_ns = None;
        }
        known.last_ns = stamp_ns;
        if let Some(before_ns) = known.before_ns {
            if newest_ns.is_some_and(|newest_ns| newest_ns < before_ns) {
                return None;
            }
            known.before_ns = None;
        }
        clock(known.set_at == Some(steps))
    }

    /// True if a cloud may be of a new clock that the poses have not reached: the next pose decides.
    pub fn is_open(&self, clock: &CloudClock) -> bool {
        clock.is_set && clock.steps == self.steps
    }

    /// Handles a backward step of the poses' clock from `before_ns`.
    pub fn on_set_back(&mut self, before_ns: i64) {
        for topic in &mut self.topics {
            if topic.set_at != Some(self.steps) {
                topic.before_ns = Some(before_ns);
            }
        }
        self.on_step();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_of_the_clock_before_are_told_from_those_of_the_new_one() {
        let mut clocks = CloudClocks::default();
        clocks.on_step();
        let first = clocks.on_cloud("left", 100, Some(100)).unwrap();
        clocks.on_cloud("right", 100, Some(100)).unwrap();
        assert!(!clocks.is_open(&first));
        // The clock is set back by 50; the poses show it later.
        let back = clocks.on_cloud("left", 51, Some(100)).unwrap();
        assert!(clocks.is_open(&back));
        clocks.on_set_back(101);
        assert!(!clocks.is_open(&back));
        assert!(clocks.on_cloud("left", 52, Some(52)).is_some());
        // A cloud that was on its way.
        assert!(clocks.on_cloud("right", 101, Some(52)).is_none());
        assert!(clocks.on_cloud("right", 53, Some(53)).is_some());
    }

    #[test]
    fn a_topic_of_another_clock_is_taken_once_the_poses_are_where_they_were() {
        let mut clocks = CloudClocks::default();
        for stamp in [100, 101] {
            clocks.on_cloud("left", stamp, Some(stamp));
            clocks.on_step();
        }
        clocks.on_set_back(101);
        assert!(clocks.on_cloud("left", 102, Some(60)).is_none());
        assert!(clocks.on_cloud("left", 150, Some(101)).is_some());
    }

    #[test]
    fn one_cloud_out_of_order_waits_for_one_pose() {
        let mut clocks = CloudClocks::default();
        clocks.on_cloud("left", 100, Some(100));
        let late = clocks.on_cloud("left", 90, Some(100)).unwrap();
        assert!(clocks.is_open(&late));
        clocks.on_step();
        assert!(!clocks.is_open(&late));
    }
}
