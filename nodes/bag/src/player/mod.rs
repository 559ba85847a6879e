//! Playback of a bag as a state machine without I/O and without a clock: the caller owns both.
//!
//! All playback times are ns of the caller's clock since the creation of the player. The caller queries
//! [`Player::due_ns`], waits, and takes [`Player::next`].

mod latched;
mod options;
#[cfg(test)]
mod tests;
mod timeline;

use std::collections::VecDeque;

use super::{BagError, BagMessage, BagReader, Messages, storage::Filter};
use latched::{given_at, static_transforms, wanted};
pub use options::{PlayedTopic, PlayerOptions};
use options::{RATES, ns_from_s};
use timeline::Timeline;

/// Shortest period of a loop, ns; a bag may contain a single message.
const MIN_LOOP_NS: i64 = 100_000_000;

/// A playback step.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Step {
    /// Publish a message.
    Publish {
        /// Index into [`Player::topics`].
        topic: usize,
        /// CDR with encapsulation header.
        data: Vec<u8>,
    },
    /// Publish this time on `/clock`, ns since the Unix epoch.
    Clock(i64),
    /// The bag restarts: time jumps back.
    Looped,
    /// End of the playback.
    End,
}

/// A bag being played.
///
/// ```no_run
/// use lattice_bag::{BagReader, Player, PlayerOptions, Step};
///
/// let bag = BagReader::open("my_bag".as_ref())?;
/// let mut player = Player::new(bag, PlayerOptions::default())?;
/// loop {
///     println!("wait until {} ns", player.due_ns());
///     match player.next()? {
///         Step::Publish { topic, data } => println!("{topic}: {} bytes", data.len()),
///         Step::End => break,
///         Step::Clock(_) | Step::Looped => {}
///     }
/// }
/// # Ok::<(), lattice_bag::BagError>(())
/// ```
pub struct Player {
    reader: BagReader,
    topics: Vec<PlayedTopic>,
    loops: bool,
    /// First log time played.
    start_ns: i64,
    /// End of the played log time, exclusive.
    end_ns: Option<i64>,
    timeline: Timeline,
    /// Static transforms of the whole log.
    statics: Vec<BagMessage>,
    latched: VecDeque<BagMessage>,
    /// Bag time at the start of this pass.
    pass_start_ns: i64,
    messages: Option<Messages>,
    head: Option<BagMessage>,
    /// The error that ended reading, reported after the messages before it.
    failed: Option<BagError>,
    /// Log time of the last message of this pass.
    last_ns: Option<i64>,
    clock_period_ns: Option<i64>,
    /// Playback time of the next `/clock` message.
    clock_due_ns: i64,
    ended: bool,
}

impl Player {
    /// Prepares the playback. Reads static transforms, and latched messages from before the start.
    pub fn new(reader: BagReader, options: PlayerOptions) -> Result<Player, BagError> {
        options.check()?;
        let topics = options.topics(&reader)?;
        let first_ns = reader.start_ns().unwrap_or(0);
        let start_ns = first_ns.saturating_add(ns_from_s(options.start_offset_s));
        if let Some(last_ns) = reader.end_ns().filter(|last_ns| start_ns > *last_ns) {
            let length_s = last_ns.saturating_sub(first_ns) as f64 / 1e9;
            let reason = format!(
                "{} s is beyond the duration of the bag, {length_s} s",
                options.start_offset_s
            );
            return Err(BagError::invalid("start_offset_s", reason));
        }
        let mut player = Player {
            statics: static_transforms(&reader, &topics),
            topics,
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
            player.start_pass(start_ns);
        }
        Ok(player)
    }

    /// Played topics.
    pub fn topics(&self) -> &[PlayedTopic] {
        &self.topics
    }

    /// Bag time at playback time `now_ns`, ns since the Unix epoch.
    pub fn bag_time_ns(&self, now_ns: i64) -> i64 {
        self.timeline.bag_at(now_ns)
    }

    /// Playback time of the next step.
    pub fn due_ns(&self) -> i64 {
        self.clock_due()
            .or_else(|| self.message_due_ns())
            .unwrap_or_else(|| self.pass_end_ns())
    }

    /// Next step, whether due or not.
    #[expect(
        clippy::should_implement_trait,
        reason = "it is fallible, and continues after the end"
    )]
    pub fn next(&mut self) -> Result<Step, BagError> {
        if self.ended {
            return Ok(Step::End);
        }
        if let (Some(due_ns), Some(period_ns)) = (self.clock_due(), self.clock_period_ns) {
            self.clock_due_ns = due_ns.saturating_add(period_ns);
            return Ok(Step::Clock(self.timeline.bag_at(due_ns)));
        }
        let message = match self.latched.pop_front() {
            Some(latched) => Some(latched),
            None => {
                let head = self.head.take();
                self.last_ns = head.as_ref().map_or(self.last_ns, |m| Some(m.log_time_ns));
                head
            }
        };
        let Some(BagMessage { topic, data, .. }) = message else {
            return self.end_pass();
        };
        if self.head.is_none() && self.last_ns.is_some() {
            self.read_head();
        }
        let topic = self
            .topics
            .iter()
            .position(|t| t.bag_topic == topic)
            .unwrap_or(0);
        Ok(Step::Publish { topic, data })
    }

    /// Bag seconds per second.
    pub fn rate(&self) -> f64 {
        self.timeline.rate()
    }

    /// Changes the rate from playback time `now_ns`. False: outside 0.001..=1000.
    pub fn set_rate(&mut self, now_ns: i64, rate: f64) -> bool {
        let possible = RATES.contains(&rate);
        if possible {
            self.timeline.set_rate(now_ns, rate);
        }
        possible
    }

    /// Continues at another time of the bag, with latched messages from before it, and later static
    /// transforms. False: outside the played range.
    pub fn seek(&mut self, now_ns: i64, bag_ns: i64) -> Result<bool, BagError> {
        let (first_ns, last_ns) = (self.reader.start_ns(), self.reader.end_ns());
        let last_ns = last_ns.into_iter().chain(self.end_ns).min();
        let is_played = first_ns.is_some_and(|first_ns| first_ns <= bag_ns)
            && last_ns.is_some_and(|last_ns| bag_ns <= last_ns);
        if is_played {
            self.failed = None;
            self.start_pass(bag_ns);
            self.timeline.anchor(now_ns, bag_ns);
            self.clock_due_ns = now_ns;
            self.ended = false;
        }
        Ok(is_played)
    }

    /// Sets or removes the end of the playback, from the next seek on. Returns the previous
    /// end.
    pub fn end_at(&mut self, end_ns: Option<i64>) -> Option<i64> {
        std::mem::replace(&mut self.end_ns, end_ns)
    }

    /// Next message, with the index of its topic, ahead of its time: the bag time jumps to it.
    /// `None`: no message is left.
    pub fn skip_to_next(&mut self, now_ns: i64) -> Result<Option<(usize, Vec<u8>)>, BagError> {
        loop {
            let latched_ns = self.latched.front().map(|_| self.pass_start_ns);
            let next_ns = latched_ns.or(self.head.as_ref().map(|head| head.log_time_ns));
            if let Some(next_ns) = next_ns {
                self.timeline.anchor(now_ns, next_ns);
                // The clock is due after the message.
                self.clock_due_ns = now_ns.saturating_add(1);
            }
            match self.next()? {
                Step::Publish { topic, data } => return Ok(Some((topic, data))),
                Step::Clock(_) | Step::Looped => {}
                Step::End => return Ok(None),
            }
        }
    }

    fn start_pass(&mut self, from_ns: i64) {
        self.last_ns = None;
        self.pass_start_ns = from_ns;
        self.latched = given_at(&self.reader, &self.topics, &self.statics, from_ns);
        self.messages = Some(self.reader.filtered(Filter {
            topics: wanted(&self.reader, &self.topics),
            start_ns: from_ns,
            end_ns: self.end_ns,
            past_damage: false,
        }));
        self.read_head();
    }

    fn read_head(&mut self) {
        match self.messages.iter_mut().flatten().next().transpose() {
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

    /// Playback time of the next clock message, if it precedes the next message.
    fn clock_due(&self) -> Option<i64> {
        let message_ns = self.message_due_ns()?;
        (self.clock_period_ns.is_some() && self.clock_due_ns <= message_ns)
            .then_some(self.clock_due_ns)
    }

    /// Playback time of the end of the pass.
    fn pass_end_ns(&self) -> i64 {
        self.timeline
            .playback_at(self.last_ns.unwrap_or(self.pass_start_ns))
    }

    fn end_pass(&mut self) -> Result<Step, BagError> {
        if let Some(error) = self.failed.take() {
            self.ended = true;
            return Err(error);
        }
        // A whole pass without messages would loop without a step of time.
        if !self.loops || self.last_ns.is_none() && self.pass_start_ns == self.start_ns {
            self.ended = true;
            return Ok(Step::End);
        }
        let began_ns = self.timeline.playback_at(self.pass_start_ns);
        let next_ns = self.pass_end_ns().max(began_ns.saturating_add(MIN_LOOP_NS));
        self.timeline.anchor(next_ns, self.start_ns);
        self.clock_due_ns = next_ns;
        self.start_pass(self.start_ns);
        Ok(Step::Looped)
    }
}
