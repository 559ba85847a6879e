//! Playback in real time: publishes due messages, and executes commands between messages and during waits.

use std::mem;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lattice_bag::{Player, Step};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::rosbag2_interfaces::PlayRequest;
use lattice_msgs::rosgraph_msgs::Clock;
use lattice_runtime::logging::Throttle;
use lattice_runtime::params::{ParamValue, Params};
use lattice_runtime::{Diagnostics, Level, Publisher, RawPublisher, Shutdown};

use super::commands::{Commands, SLICE};
use super::lockstep::Lockstep;
use super::player_report::PlayerReport;
use super::playhead::Playhead;
use super::steps::Steps;
use crate::start::NodeError;

/// Largest delay that is caught up. A later playback shifts its time base: a burst of delayed messages would
/// overrun the subscribers.
const MOST_LATE: Duration = Duration::from_secs(1);
/// Period of the diagnostic status.
pub(super) const STATE_PERIOD: Duration = Duration::from_millis(500);
/// Longest sleep between checks of the shutdown flag, and period of `/clock` while paused.
pub(super) const NAP: Duration = Duration::from_millis(100);

/// Part of a delay that shifts the time base.
fn not_made_up(late: Duration) -> Duration {
    if late <= MOST_LATE {
        return Duration::ZERO;
    }
    log::warn!("{late:.1?} late; the time base is shifted");
    late
}

/// Playback of a log.
pub(super) struct Playback {
    pub player: Player,
    pub commands: Rc<Commands<Self>>,
    /// Messages requested by a call while paused.
    pub steps: Option<Steps>,
    /// First and last time of the log.
    pub span_ns: (i64, i64),
    pub topics: Vec<RawPublisher>,
    /// For each topic, true while its messages are skipped because a subscriber does not acknowledge.
    pub stuck: Vec<bool>,
    /// Topics in lockstep.
    pub lockstep: Lockstep,
    /// Longest wait for a blocking subscriber.
    pub most_wait: Duration,
    pub clock: Option<Publisher<Clock>>,
    pub head: Playhead,
    /// True after a call of `stop`.
    pub stopped: bool,
    /// True after the last message.
    pub ended: bool,
    pub shutdown: Shutdown,
    /// Parameters of the node, which include its rate.
    pub params: Arc<Params>,
    pub diagnostics: Diagnostics,
    /// Rate limit of the diagnostic status.
    pub pace: Throttle,
    pub report: PlayerReport,
}

impl Playback {
    /// Plays until the end, a call of `stop` or a signal.
    pub(super) fn play(&mut self) -> Result<(), NodeError> {
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
            let patience = match (is_held, self.steps.is_some()) {
                (true, true) => Duration::ZERO,
                (true, false) => NAP,
                (false, _) => left.min(NAP),
            };
            if let Some(control) = self.commands.next(patience) {
                control(self);
                self.diagnose();
                continue;
            }
            if let Some(steps) = self.steps.take() {
                self.take_step(steps);
                continue;
            }
            if is_held {
                // The time is constant while paused; late joiners need it.
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

    /// Executes pending commands; false once the playback is to end.
    pub(super) fn obey(&mut self) -> bool {
        let commands = Rc::clone(&self.commands);
        while let Some(control) = commands.next(Duration::ZERO) {
            control(self);
        }
        !self.shutdown.is_requested() && !self.stopped
    }

    /// Performs one step; false at the end.
    fn step(&mut self, late: Duration) -> Result<bool, NodeError> {
        match self.player.next()? {
            Step::Publish { topic, data } => {
                let late_ms = late.as_millis() as u64;
                self.report.latest_ms = self.report.latest_ms.max(late_ms);
                self.publish(topic, data);
            }
            Step::Clock(now_ns) => self.publish_clock(now_ns),
            Step::Looped => log::info!("the log restarts"),
            Step::End => return Ok(false),
        }
        Ok(true)
    }

    /// Pauses or resumes; resuming ends a call that plays messages while paused.
    pub(super) fn hold(&mut self, held: bool) {
        if self.head.is_held() == held {
            return;
        }
        match held {
            true => self.head.hold(),
            false => {
                self.head.go_on();
                // At once: the playback may be paused again before the next message.
                if let Some(steps) = self.steps.take() {
                    steps.end();
                }
            }
        }
        log::info!("{}", if held { "paused" } else { "resumed" });
    }

    pub(super) fn toggle(&mut self) {
        self.hold(!self.head.is_held());
    }

    pub(super) fn stop(&mut self) {
        self.stopped = true;
    }

    /// Changes the rate and the parameter that shows it; false if the rate is out of range.
    pub(super) fn set_rate(&mut self, rate: f64) -> bool {
        let possible = self.change_rate(rate);
        if possible {
            self.params.note("rate", ParamValue::F64(rate));
        }
        possible
    }

    /// Changes the rate; false if it is out of range.
    pub(super) fn change_rate(&mut self, rate: f64) -> bool {
        let possible = self.player.set_rate(self.head.now_ns(), rate);
        match possible {
            true => log::info!("rate {rate}"),
            false => log::warn!("rate {rate} is outside 0.001..=1000"),
        }
        possible
    }

    /// Continues at another time of the log; false if it is outside the log.
    pub(super) fn seek(&mut self, bag_ns: i64) -> bool {
        let sought = self.player.seek(self.head.now_ns(), bag_ns);
        sought.unwrap_or_else(|error| {
            log::error!("{error}");
            false
        })
    }

    /// Plays a paused log from an offset, for a duration or until a time; false if it is not paused, or
    /// if the offset is behind the end.
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

    /// Plays the next messages of a paused log. The call returns at once if the log is not paused, at its end,
    /// and while another such call is executed.
    pub(super) fn play_steps(&mut self, steps: Steps) {
        if !self.head.is_held() || self.ended || self.steps.is_some() {
            steps.end();
        } else {
            self.steps = Some(steps);
        }
    }

    /// Plays the next message at once.
    fn take_step(&mut self, steps: Steps) {
        match self.player.skip_to_next(self.head.now_ns()) {
            Ok(Some((topic, data))) => {
                self.steps = steps.played();
                self.publish(topic, data);
            }
            Ok(None) => steps.end(),
            Err(error) => {
                log::error!("{error}");
                steps.end();
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

    /// Publishes the playback position as a diagnostic status.
    fn diagnose(&self) {
        let (begin_ns, end_ns) = self.span_ns;
        let now_ns = self.player.bag_time_ns(self.head.now_ns());
        let paused = self.head.is_held();
        let state = if paused { "paused" } else { "playing" };
        let failed = self.report.failed;
        let (level, message) = match failed {
            0 => (Level::Ok, state.to_owned()),
            _ => (Level::Warn, format!("{state}, {failed} messages skipped")),
        };
        let values = [
            ("begin_ns", begin_ns.to_string()),
            ("end_ns", end_ns.to_string()),
            ("now_ns", now_ns.to_string()),
            ("rate", self.player.rate().to_string()),
            ("paused", paused.to_string()),
            ("failed", failed.to_string()),
            ("unacknowledged", self.unacknowledged().to_string()),
        ];
        self.diagnostics.set("log", level, message, values);
    }

    /// Messages not acknowledged by reliable subscribers, including subscribers that have left.
    pub(super) fn unacknowledged(&self) -> u64 {
        let each = self.topics.iter().map(RawPublisher::unacknowledged);
        each.fold(0, u64::saturating_add)
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

    /// Waits until a topic has room for a message; once per subscriber that does not acknowledge.
    fn wait_for_room(&mut self, topic: usize, bytes: usize) {
        if self.stuck.get(topic).is_none_or(|stuck| *stuck) {
            return;
        }
        let begin = Instant::now();
        while let Some(publisher) = self.topics.get(topic) {
            let left = self.most_wait.saturating_sub(begin.elapsed());
            if publisher.has_room_within(bytes, left.min(SLICE)) || left.is_zero() {
                return;
            }
            if !self.obey() {
                return;
            }
        }
    }

    /// Publishes a message, in lockstep after the reply to the one before; waits once for a subscriber that
    /// does not acknowledge.
    fn publish(&mut self, topic: usize, data: Vec<u8>) {
        let begin = Instant::now();
        let (mut lockstep, patience) = (mem::take(&mut self.lockstep), self.most_wait);
        lockstep.before(topic, &data, patience, &mut || self.obey());
        self.lockstep = lockstep;
        self.head.stand(begin.elapsed());
        self.wait_for_room(topic, data.len());
        let (Some(publisher), Some(stuck)) = (self.topics.get(topic), self.stuck.get_mut(topic))
        else {
            return;
        };
        self.report.messages += 1;
        let published = publisher.publish_within(data, Duration::ZERO);
        if let Err(error) = &published {
            self.report.failed += 1;
            if !*stuck {
                log::warn!("{error}; skipped until its subscribers acknowledge");
            }
        } else if *stuck {
            log::info!("{}: continues", publisher.topic());
        }
        *stuck = published.is_err();
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
