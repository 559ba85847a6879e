//! Plays a bag without I/O and without a clock: the caller owns both.
//!
//! All playback times are ns of the caller's own clock since it made the player. A live caller
//! asks [`Player::due_ns`], waits, and takes [`Player::next`]; a direct replay only takes.

mod latched;
mod options;
#[cfg(test)]
mod tests;
mod timeline;

use std::collections::VecDeque;

use super::{BagError, BagMessage, BagReader, Messages, ReadOptions, TopicInfo};
use latched::latched_before;
pub use options::{PlayedTopic, PlayerOptions};
use options::{check_rate, ns_from_s};
use timeline::Timeline;

/// The shortest time from one start to the next in a loop, ns; a bag may hold a single message.
const MIN_LOOP_NS: i64 = 100_000_000;

/// What to do next.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Step {
    /// Publish a message.
    Publish {
        /// Index into [`Player::topics`].
        topic: usize,
        /// CDR with encapsulation header.
        data: Vec<u8>,
        /// When it is due, playback time, ns.
        at_ns: i64,
    },
    /// Publish this time on `/clock`, ns since the Unix epoch.
    Clock(i64),
    /// The bag starts again: time jumps back.
    Looped,
    /// Nothing is left.
    End,
}

/// A bag being played.
pub struct Player {
    reader: BagReader,
    topics: Vec<PlayedTopic>,
    skipped: Vec<TopicInfo>,
    loops: bool,
    /// First log time played.
    start_ns: i64,
    /// First log time no longer played.
    end_ns: Option<i64>,
    timeline: Timeline,
    latched: VecDeque<BagMessage>,
    /// Where this pass began, bag time.
    pass_start_ns: i64,
    messages: Option<Messages>,
    head: Option<BagMessage>,
    /// What broke reading, told once all before it is played.
    failed: Option<BagError>,
    /// Log time of the last message taken in this pass.
    last_ns: Option<i64>,
    clock_period_ns: Option<i64>,
    /// When `/clock` is next due, playback time.
    clock_due_ns: i64,
    ended: bool,
}

impl Player {
    /// Prepares to play. Reads what latched topics published before the start.
    pub fn new(reader: BagReader, options: PlayerOptions) -> Result<Player, BagError> {
        options.check()?;
        let (topics, skipped) = options.topics(&reader)?;
        for topic in &skipped {
            let format = &topic.serialization_format;
            log::warn!(
                "{} is left out: its messages are {format:?}, not CDR of a known type",
                topic.name
            );
        }
        let first_ns = reader.start_ns().unwrap_or(0);
        let start_ns = first_ns.saturating_add(ns_from_s(options.start_offset_s));
        if let Some(last_ns) = reader.end_ns().filter(|last_ns| start_ns > *last_ns) {
            let length_s = last_ns.saturating_sub(first_ns) as f64 / 1e9;
            return Err(BagError::Invalid {
                name: "start_offset_s",
                reason: format!(
                    "{} s is beyond the end of the bag, which takes {length_s} s",
                    options.start_offset_s
                ),
            });
        }
        let mut player = Player {
            topics,
            skipped,
            loops: options.loop_,
            start_ns,
            end_ns: options
                .duration_s
                .map(|s| start_ns.saturating_add(ns_from_s(s))),
            timeline: Timeline::new(start_ns, options.rate),
            latched: VecDeque::new(),
            pass_start_ns: start_ns,
            messages: None,
            head: None,
            failed: None,
            last_ns: None,
            clock_period_ns: options
                .clock_hz
                .map(|hz| (1e9 / hz).round().max(1.0) as i64),
            clock_due_ns: 0,
            ended: reader.start_ns().is_none(),
            reader,
        };
        if !player.ended {
            player.start_pass(start_ns)?;
        }
        Ok(player)
    }

    /// The topics that are played.
    pub fn topics(&self) -> &[PlayedTopic] {
        &self.topics
    }

    /// The topics left out because their messages are not CDR of a known type.
    pub fn skipped(&self) -> &[TopicInfo] {
        &self.skipped
    }

    /// Bag seconds per second.
    pub fn rate(&self) -> f64 {
        self.timeline.rate()
    }

    /// Whether the bag's time stands still.
    pub fn is_paused(&self) -> bool {
        self.timeline.is_paused()
    }

    /// The bag's time at playback time `now_ns`, ns since the Unix epoch.
    pub fn bag_time_ns(&self, now_ns: i64) -> i64 {
        self.timeline.bag_at(now_ns)
    }

    /// When the next step is due, playback time; nothing while paused.
    pub fn due_ns(&self) -> Option<i64> {
        match (self.is_paused(), self.clock_due(), self.message_due_ns()) {
            (true, ..) => None,
            (_, Some(clock_ns), _) => Some(clock_ns),
            (_, None, Some(message_ns)) => Some(message_ns),
            (_, None, None) => Some(self.pass_end_ns()),
        }
    }

    /// The next step, whether due or not. While paused this plays single steps.
    #[expect(
        clippy::should_implement_trait,
        reason = "it can fail, and goes on after the end"
    )]
    pub fn next(&mut self) -> Result<Step, BagError> {
        if self.ended {
            return Ok(Step::End);
        }
        if !self.is_paused()
            && let (Some(due_ns), Some(period_ns)) = (self.clock_due(), self.clock_period_ns)
        {
            self.clock_due_ns = due_ns.saturating_add(period_ns);
            return Ok(Step::Clock(self.timeline.bag_at(due_ns)));
        }
        let at_ns = self.message_due_ns();
        let message = match self.latched.pop_front() {
            Some(latched) => Some(latched),
            None => {
                let head = self.head.take();
                self.last_ns = head.as_ref().map_or(self.last_ns, |m| Some(m.log_time_ns));
                head
            }
        };
        let (
            Some(BagMessage {
                topic,
                log_time_ns,
                data,
            }),
            Some(at_ns),
        ) = (message, at_ns)
        else {
            return self.end_pass();
        };
        if self.head.is_none() && self.last_ns.is_some() {
            self.read_head();
        }
        if self.is_paused() {
            // A single step moves the time that stands still.
            let bag_ns = log_time_ns.max(self.timeline.bag_at(at_ns));
            self.timeline.anchor(at_ns, bag_ns);
        }
        let topic = self
            .topics
            .iter()
            .position(|t| t.bag_topic == topic)
            .unwrap_or(0);
        Ok(Step::Publish { topic, data, at_ns })
    }

    /// Stops the bag's time at playback time `now_ns`.
    pub fn pause(&mut self, now_ns: i64) {
        self.timeline.pause(now_ns);
    }

    /// Lets the bag's time go on from where it stands.
    pub fn resume(&mut self, now_ns: i64) {
        self.timeline.resume(now_ns);
        self.clock_due_ns = self.clock_due_ns.max(now_ns);
    }

    /// Changes the rate from playback time `now_ns` on, 0.001 to 1000.
    pub fn set_rate(&mut self, rate: f64, now_ns: i64) -> Result<(), BagError> {
        check_rate(rate)?;
        self.timeline.set_rate(now_ns, rate);
        Ok(())
    }

    /// Goes to a log time, within the bag, at playback time `now_ns`; latched messages before it
    /// are published again, and the clock at once.
    pub fn seek(&mut self, log_time_ns: i64, now_ns: i64) -> Result<(), BagError> {
        let (Some(first_ns), Some(last_ns)) = (self.reader.start_ns(), self.reader.end_ns()) else {
            return Ok(());
        };
        let target_ns = log_time_ns.clamp(first_ns, last_ns.max(first_ns));
        self.timeline.anchor(now_ns, target_ns);
        self.clock_due_ns = now_ns;
        self.start_pass(target_ns)
    }

    fn start_pass(&mut self, from_ns: i64) -> Result<(), BagError> {
        self.ended = false;
        self.last_ns = None;
        self.pass_start_ns = from_ns;
        self.latched = latched_before(&self.reader, &self.topics, from_ns)?;
        let options = ReadOptions {
            topics: Some(
                self.topics
                    .iter()
                    .map(|topic| topic.info.name.clone())
                    .collect(),
            ),
            start_ns: Some(from_ns),
            end_ns: self.end_ns,
        };
        self.messages = Some(self.reader.messages(&options)?);
        self.failed = None;
        self.read_head();
        Ok(())
    }

    fn read_head(&mut self) {
        // A name may belong to several topics of the bag, of which not all are played.
        let topics = &self.topics;
        let is_played = |m: &BagMessage| topics.iter().any(|t| t.bag_topic == m.topic);
        let next = self
            .messages
            .iter_mut()
            .flatten()
            .find(|m| m.as_ref().map_or(true, is_played));
        match next.transpose() {
            Ok(head) => self.head = head,
            Err(error) => (self.head, self.failed) = (None, Some(error)),
        }
    }

    fn message_due_ns(&self) -> Option<i64> {
        match (self.latched.front(), &self.head) {
            (Some(_), _) => Some(self.timeline.playback_at(self.pass_start_ns)),
            (None, Some(head)) => Some(self.timeline.playback_at(head.log_time_ns)),
            (None, None) => None,
        }
    }

    /// When the clock is due, if that is before the next message.
    fn clock_due(&self) -> Option<i64> {
        let message_ns = self.message_due_ns()?;
        (self.clock_period_ns.is_some() && self.clock_due_ns <= message_ns)
            .then_some(self.clock_due_ns)
    }

    /// When the pass is over, playback time.
    fn pass_end_ns(&self) -> i64 {
        self.timeline
            .playback_at(self.last_ns.unwrap_or(self.pass_start_ns))
    }

    fn end_pass(&mut self) -> Result<Step, BagError> {
        if let Some(error) = self.failed.take() {
            self.ended = true;
            return Err(error);
        }
        // A pass without messages would loop for ever without a step of time.
        if !self.loops || self.last_ns.is_none() {
            self.ended = true;
            return Ok(Step::End);
        }
        let began_ns = self.timeline.playback_at(self.pass_start_ns);
        let next_ns = self.pass_end_ns().max(began_ns.saturating_add(MIN_LOOP_NS));
        self.timeline.anchor(next_ns, self.start_ns);
        self.clock_due_ns = next_ns;
        self.start_pass(self.start_ns)?;
        Ok(Step::Looped)
    }
}
