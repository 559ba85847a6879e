//! Playback against the clock: what is due is published, and controls are obeyed between two messages.

use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use lattice_bag::{Player, Step};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::rosbag2_interfaces::PlayRequest;
use lattice_msgs::rosgraph_msgs::Clock;
use lattice_runtime::logging::Throttle;
use lattice_runtime::params::{ParamValue, Params};
use lattice_runtime::{Diagnostics, Level, Node, Publisher, RawPublisher, Shutdown};

use super::PlayerReport;
use super::controls::Controls;
use super::lockstep::Lockstep;
use super::playhead::Playhead;
use crate::start::NodeError;

/// Time that what is queued at the end has to reach its readers.
const FLUSH_TIME: Duration = Duration::from_secs(20);
/// The same after a signal.
const HURRIED_FLUSH_TIME: Duration = Duration::from_secs(2);
/// A player that is later than this goes on from there: what it missed would come in one burst, too fast
/// for those who listen.
const MOST_LATE: Duration = Duration::from_secs(1);
/// Time between two statements of the place in the log.
pub(super) const STATE_PERIOD: Duration = Duration::from_millis(500);
/// Longest sleep between two looks at the shutdown flag, and between two times on `/clock` while held.
pub(super) const NAP: Duration = Duration::from_millis(100);

/// The part of a delay by which all that follows is late too.
fn not_made_up(late: Duration) -> Duration {
    if late <= MOST_LATE {
        return Duration::ZERO;
    }
    log::warn!("{late:.1?} late; so is all that follows");
    late
}

/// A log being played.
pub(super) struct Playback {
    pub player: Player,
    /// First and last time of the log.
    pub span_ns: (i64, i64),
    pub topics: Vec<RawPublisher>,
    /// Topics whose queue a subscriber holds up.
    pub stuck: Vec<bool>,
    /// Topics each message of which waits for an answer to the one before.
    pub lockstep: Lockstep,
    /// Time that such a subscriber is waited for.
    pub most_wait: Duration,
    pub clock: Option<Publisher<Clock>>,
    pub head: Playhead,
    /// True after a call of `stop`.
    pub stopped: bool,
    pub shutdown: Shutdown,
    /// Those of the node, for its rate to be read.
    pub params: Arc<Params>,
    pub diagnostics: Diagnostics,
    /// Pace at which the state is stated.
    pub pace: Throttle,
    pub report: PlayerReport,
}

impl Playback {
    /// Waits until each of these topics has a subscriber, or goes on without after the time.
    pub(super) fn wait_for(&self, names: &[String], timeout: Duration) {
        let deadline = Instant::now() + timeout;
        for (publisher, topic) in self.topics.iter().zip(self.player.topics()) {
            if !names.contains(&topic.info.name) {
                continue;
            }
            let (joined, join) = mpsc::channel();
            publisher.on_subscriber_joined(move || {
                let _ = joined.send(());
            });
            while publisher.subscriber_count() == 0 && !self.shutdown.is_requested() {
                let left = deadline.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    log::warn!("{}: nobody listens, playing all the same", topic.info.name);
                    break;
                }
                let _ = join.recv_timeout(left.min(NAP));
            }
        }
    }

    /// Begins with the lockstep of pairs of topics.
    pub(super) fn start_lockstep(
        &mut self,
        pairs: &[String],
        node: &Node,
        timeout: Duration,
    ) -> Result<(), NodeError> {
        let topics = self.player.topics().iter();
        let played: Vec<String> = topics.map(|topic| topic.info.name.clone()).collect();
        self.lockstep = Lockstep::start(pairs, &played, node, timeout, &self.shutdown)?;
        Ok(())
    }

    /// Plays to the end, a call of `stop` or a signal.
    pub(super) fn play(&mut self, controls: &Controls) -> Result<(), NodeError> {
        self.head.restart();
        let mut percent = 0;
        while !self.shutdown.is_requested() && !self.stopped {
            if self.pace.check().is_some() {
                self.diagnose();
            }
            let due_ns = self.player.due_ns();
            let left_ns = due_ns.saturating_sub(self.head.now_ns());
            let left = Duration::from_nanos(u64::try_from(left_ns).unwrap_or(0));
            let is_held = self.head.is_held();
            if let Some(control) = controls.next(if is_held { NAP } else { left.min(NAP) }) {
                control(self);
                self.diagnose();
                continue;
            }
            if is_held {
                // Time stands, and those who have just come hear of it.
                self.publish_clock(self.player.bag_time_ns(self.head.now_ns()));
                continue;
            }
            let late_ns = self.head.now_ns().saturating_sub(due_ns);
            let Ok(late_ns) = u64::try_from(late_ns) else {
                continue;
            };
            let late = Duration::from_nanos(late_ns);
            self.head.begin += not_made_up(late);
            if !self.step(late)? {
                break;
            }
            self.tell_progress(&mut percent);
        }
        Ok(())
    }

    /// Takes one step; false at the end.
    fn step(&mut self, late: Duration) -> Result<bool, NodeError> {
        match self.player.next()? {
            Step::Publish { topic, data } => {
                let late_ms = late.as_millis() as u64;
                self.report.latest_ms = self.report.latest_ms.max(late_ms);
                self.publish(topic, data);
            }
            Step::Clock(now_ns) => self.publish_clock(now_ns),
            Step::Looped => log::info!("the log starts again"),
            Step::End => return Ok(false),
        }
        Ok(true)
    }

    /// Holds the log, or goes on with it.
    pub(super) fn hold(&mut self, held: bool) {
        if self.head.is_held() == held {
            return;
        }
        match held {
            true => self.head.hold(),
            false => self.head.go_on(),
        }
        log::info!("{}", if held { "paused" } else { "goes on" });
    }

    pub(super) fn toggle(&mut self) {
        self.hold(!self.head.is_held());
    }

    pub(super) fn stop(&mut self) {
        self.stopped = true;
    }

    /// Goes on at another rate, which the parameter then shows; false if that cannot be played.
    pub(super) fn set_rate(&mut self, rate: f64) -> bool {
        let possible = self.change_rate(rate);
        if possible {
            self.params.note("rate", ParamValue::F64(rate));
        }
        possible
    }

    /// Goes on at another rate; false if that cannot be played.
    pub(super) fn change_rate(&mut self, rate: f64) -> bool {
        let possible = self.player.set_rate(self.head.now_ns(), rate);
        match possible {
            true => log::info!("rate {rate}"),
            false => log::warn!("rate {rate} is refused; 0.001 to 1000 can be played"),
        }
        possible
    }

    /// Goes on at another time of the log; false if it has none such.
    pub(super) fn seek(&mut self, bag_ns: i64) -> bool {
        let sought = self.player.seek(self.head.now_ns(), bag_ns);
        sought.unwrap_or_else(|error| {
            log::error!("{error}");
            false
        })
    }

    /// Plays a log that is held from an offset on, for a time or until one; false where it is not held, and
    /// for an offset behind its end.
    pub(super) fn play_part(&mut self, part: &PlayRequest) -> bool {
        if !self.head.is_held() {
            return false;
        }
        let from_ns = self.span_ns.0.saturating_add(part.start_offset.to_ns());
        let length_ns = part.playback_duration.to_ns();
        let ends = [
            (length_ns > 0).then(|| from_ns.saturating_add(length_ns)),
            Some(part.playback_until_timestamp.to_ns()).filter(|until_ns| *until_ns > 0),
        ];
        let before_ns = self.player.end_at(ends.into_iter().flatten().min());
        let found = self.seek(from_ns);
        match found {
            true => self.hold(false),
            false => drop(self.player.end_at(before_ns)),
        }
        found
    }

    /// Plays the next messages of a log that is held, all for 0; how many there were.
    pub(super) fn burst(&mut self, messages: u64) -> u64 {
        let mut played = 0;
        while (messages == 0 || played < messages)
            && !self.shutdown.is_requested()
            && self.play_next()
        {
            played += 1;
        }
        played
    }

    /// Plays the next message at once, if the log is held; false where it is not, and at the end.
    pub(super) fn play_next(&mut self) -> bool {
        if !self.head.is_held() {
            return false;
        }
        match self.player.skip_to_next(self.head.now_ns()) {
            Ok(Some((topic, data))) => {
                self.publish(topic, data);
                true
            }
            Ok(None) => false,
            Err(error) => {
                log::error!("{error}");
                false
            }
        }
    }

    fn tell_progress(&self, percent: &mut i64) {
        let (first_ns, last_ns) = self.span_ns;
        let span_ns = last_ns.saturating_sub(first_ns).max(1);
        let played_ns = self.player.bag_time_ns(self.head.now_ns());
        let played_ns = played_ns.saturating_sub(first_ns);
        let share = (100.0 * played_ns as f64 / span_ns as f64) as i64;
        if share != *percent && (0..=100).contains(&share) {
            *percent = share;
            log::info!("played {share} %");
        }
    }

    /// States the place in the log, for those who show it.
    fn diagnose(&self) {
        let (begin_ns, end_ns) = self.span_ns;
        let now_ns = self.player.bag_time_ns(self.head.now_ns());
        let paused = self.head.is_held();
        let message = if paused { "paused" } else { "playing" };
        let values = [
            ("begin_ns", begin_ns.to_string()),
            ("end_ns", end_ns.to_string()),
            ("now_ns", now_ns.to_string()),
            ("rate", self.player.rate().to_string()),
            ("paused", paused.to_string()),
        ];
        self.diagnostics.set("log", Level::Ok, message, values);
    }

    fn publish_clock(&self, now_ns: i64) {
        let message = Clock {
            clock: Time::from_ns(now_ns),
        };
        let publish = |clock: &Publisher<Clock>| clock.publish(message);
        if let Some(Err(error)) = self.clock.as_ref().map(publish) {
            log::debug!("/clock: {error}");
        }
    }

    /// Publishes a message, in lockstep when the one before is answered; a subscriber that does not acknowledge is
    /// waited for once.
    fn publish(&mut self, topic: usize, data: Vec<u8>) {
        let begin = Instant::now();
        let shutdown = &self.shutdown;
        self.lockstep.before(topic, &data, self.most_wait, shutdown);
        self.head.stand(begin.elapsed());
        let (Some(publisher), Some(stuck)) = (self.topics.get(topic), self.stuck.get_mut(topic))
        else {
            return;
        };
        self.report.messages += 1;
        let patience = if *stuck {
            Duration::ZERO
        } else {
            self.most_wait
        };
        let published = publisher.publish_within(data, patience);
        if let Err(error) = &published {
            self.report.failed += 1;
            if !*stuck {
                log::warn!("{error}; skipped until its subscribers acknowledge");
            }
        } else if *stuck {
            log::info!("{}: goes on", publisher.topic());
        }
        *stuck = published.is_err();
    }

    /// Gives readers time to have everything.
    pub(super) fn flush(&mut self) {
        let patience = match self.shutdown.is_requested() {
            true => HURRIED_FLUSH_TIME,
            false => FLUSH_TIME,
        };
        self.lockstep.finish(patience, &self.shutdown);
        let deadline = Instant::now() + patience;
        self.report.acknowledged = true;
        for publisher in &self.topics {
            let left = deadline.saturating_duration_since(Instant::now());
            if !publisher.flush(left) {
                self.report.acknowledged = false;
                log::warn!("{}: not everything was acknowledged", publisher.topic());
            }
        }
        log::info!(
            "{} messages played, at most {} ms late",
            self.report.messages,
            self.report.latest_ms
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_delay_is_not_made_up_in_a_burst() {
        let long = Duration::from_secs(39);
        assert_eq!(not_made_up(long), long);
        assert_eq!(not_made_up(MOST_LATE), Duration::ZERO);
    }

    #[test]
    fn time_stands_while_the_log_is_held() {
        let mut head = Playhead::new(true);
        assert_eq!(head.now_ns(), 0);
        head.go_on();
        let begin_ns = head.now_ns();
        head.hold();
        let held_ns = head.now_ns();
        head.hold();
        assert!(begin_ns <= held_ns && head.now_ns() == held_ns);
        head.go_on();
        assert!(!head.is_held() && head.now_ns() >= held_ns);
    }
}
