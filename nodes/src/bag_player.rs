//! `bag_player`: a rosbag2 log on the topics that it was recorded from.

use std::path::PathBuf;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::rosgraph_msgs::Clock;
use serde::Serialize;

use crate::executables::{answers_help, start_runtime};
use crate::report;
use crate::start::{NodeError, warn_unused};
use lattice_bag::{BagQos, BagReader, Player, PlayerOptions, Step, TopicInfo};
use lattice_runtime::params::Params;
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Publisher, RawPublisher, Shutdown};

/// Name of the executable and of the node unless it is remapped.
pub const NAME: &str = "bag_player";

/// Time that what is queued at the end has to reach its readers.
const FLUSH_TIME: Duration = Duration::from_secs(20);
/// The same after a signal.
const HURRIED_FLUSH_TIME: Duration = Duration::from_secs(2);
/// A player that is later than this goes on from there: what it missed would come in one burst, too fast
/// for those who listen.
const MOST_LATE: Duration = Duration::from_secs(1);
/// Longest sleep between two looks at the shutdown flag.
const NAP: Duration = Duration::from_millis(100);
/// Largest depth of a publisher whose recorder kept all samples.
const MAX_DEPTH: u64 = 1000;

/// The end of a player.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PlayerReport {
    /// Messages given to the publishers.
    pub messages: u64,
    /// Messages that a publisher did not take.
    pub failed: u64,
    /// Latest that a message was after its time, in ms.
    pub latest_ms: u64,
    /// True if all reliable readers acknowledged everything in time.
    pub acknowledged: bool,
}

/// Plays the log that the parameters name and returns at its end or after a signal.
pub fn run(arguments: impl IntoIterator<Item = String>) -> Result<(), NodeError> {
    let args = RosArgs::parse(arguments)?;
    if answers_help(NAME, &args) {
        return Ok(());
    }
    let name = args.node_name(NAME);
    let runtime = start_runtime(&name, args)?;
    let node = runtime.node(&name)?;
    let params = node.params();
    let bag = params.string("bag", "")?;
    if bag.is_empty() {
        return Err("which log? Give it as `--ros-args -p bag:=DIRECTORY`".into());
    }
    let reader = BagReader::open(&PathBuf::from(&bag))?;
    let span_ns = (reader.start_ns().unwrap_or(0), reader.end_ns().unwrap_or(0));
    let player = Player::new(reader, options(params)?)?;
    let waited = params.string_array("wait_for_subscribers", &[])?;
    let wait = seconds(params, "wait_timeout_s", 30.0)?;
    let settle = seconds(params, "settle_s", 0.5)?;
    let report_file = report::file(params)?;
    let mut shell = Shell {
        topics: open_topics(&node, &player)?,
        clock: match params.f64("clock_hz", 0.0)? > 0.0 {
            true => Some(node.publisher("/clock", Qos::CLOCK_PLAYER)?),
            false => None,
        },
        player,
        span_ns,
        shutdown: runtime.shutdown_handle(),
        report: PlayerReport::default(),
    };
    warn_unused(params);
    shell.wait_for(&waited, wait);
    if !waited.is_empty() {
        // We know them; they may need a moment to know us.
        shell.shutdown.wait_timeout(settle);
    }
    log::info!("playing {bag}");
    let result = shell.play();
    shell.flush();
    report::write(&report_file, &shell.report)?;
    result
}

/// A time of up to a day.
fn seconds(params: &Params, name: &str, default: f64) -> Result<Duration, NodeError> {
    let seconds = params.f64_in(name, default, 0.0..=86_400.0)?;
    Ok(Duration::from_secs_f64(seconds))
}

fn options(params: &Params) -> Result<PlayerOptions, NodeError> {
    let duration_s = params.f64("duration_s", 0.0)?;
    let include = params.string_array("topics", &[])?;
    let clock_hz = params.f64("clock_hz", 0.0)?;
    Ok(PlayerOptions {
        rate: params.f64("rate", 1.0)?,
        start_offset_s: params.f64("start_offset_s", 0.0)?,
        duration_s: (duration_s > 0.0).then_some(duration_s),
        loop_: params.bool("loop", false)?,
        include: (!include.is_empty()).then_some(include),
        exclude: params.string_array("exclude_topics", &[])?,
        clock_hz: (clock_hz > 0.0).then_some(clock_hz),
    })
}

/// A publisher for each topic, with the QoS that was recorded unless a parameter says otherwise.
fn open_topics(node: &Node, player: &Player) -> Result<Vec<RawPublisher>, NodeError> {
    let mut publishers = Vec::new();
    for topic in player.topics() {
        let info = &topic.info;
        let resolved = node.resolve(&info.name)?;
        let qos = offered(info).with_overrides(node.params(), &resolved, &info.name)?;
        let hash = type_hash(info);
        publishers.push(node.raw_publisher(&resolved, &info.type_name, hash.as_deref(), qos)?);
    }
    Ok(publishers)
}

/// Type hash that the bag notes, or that of its definition.
fn type_hash(topic: &TopicInfo) -> Option<String> {
    let text = topic.definition.as_deref();
    match topic.type_hash.as_str() {
        "" => text.and_then(|text| lattice_msgs::type_hash(&topic.type_name, text)),
        noted => Some(noted.to_owned()),
    }
}

/// One publisher in place of all that were recorded: the weakest of each policy, so that every
/// reader of then finds it, and room for the last samples of all of them.
fn offered(topic: &TopicInfo) -> Qos {
    let recorded = topic.offered_qos.as_slice();
    let depth = |qos: &BagQos| match qos.keep_all {
        true => MAX_DEPTH,
        false => qos.depth.max(1),
    };
    let latched = match recorded {
        [] => topic.is_latched(),
        recorded => recorded.iter().all(|qos| qos.latched),
    };
    let depths = recorded.iter().map(depth);
    let depth = match (recorded, latched) {
        ([], true) => 100,
        ([], false) => 10,
        (_, true) => depths.fold(0, u64::saturating_add),
        (_, false) => depths.max().unwrap_or(10),
    };
    Qos {
        reliability: match recorded.iter().all(|qos| qos.reliable) {
            true => Reliability::Reliable,
            false => Reliability::BestEffort,
        },
        durability: match latched {
            true => Durability::TransientLocal,
            false => Durability::Volatile,
        },
        depth: depth.clamp(1, MAX_DEPTH) as usize,
    }
}

/// The part of a delay by which all that follows is late too.
fn not_made_up(late: Duration) -> Duration {
    if late <= MOST_LATE {
        return Duration::ZERO;
    }
    log::warn!("{late:.1?} late; so is all that follows");
    late
}

struct Shell {
    player: Player,
    /// First and last time of the log.
    span_ns: (i64, i64),
    topics: Vec<RawPublisher>,
    clock: Option<Publisher<Clock>>,
    shutdown: Shutdown,
    report: PlayerReport,
}

impl Shell {
    /// Waits until each of these topics has a subscriber, or goes on without after the time.
    fn wait_for(&self, names: &[String], timeout: Duration) {
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

    fn play(&mut self) -> Result<(), NodeError> {
        let mut begin = Instant::now();
        let (first_ns, last_ns) = self.span_ns;
        let span_ns = last_ns.saturating_sub(first_ns).max(1);
        let mut percent = 0;
        while !self.shutdown.is_requested() {
            let due_ns = u64::try_from(self.player.due_ns()).unwrap_or(0);
            let due = begin + Duration::from_nanos(due_ns);
            let now = Instant::now();
            if due > now {
                std::thread::sleep((due - now).min(NAP));
                continue;
            }
            let late = now - due;
            begin += not_made_up(late);
            match self.player.next()? {
                Step::Publish { topic, data } => {
                    let late_ms = late.as_millis() as u64;
                    self.report.latest_ms = self.report.latest_ms.max(late_ms);
                    self.publish(topic, data);
                }
                Step::Clock(now_ns) => {
                    if let Some(clock) = &self.clock {
                        let clock_message = Clock {
                            clock: Time::from_ns(now_ns),
                        };
                        if let Err(error) = clock.publish(clock_message) {
                            log::debug!("/clock: {error}");
                        }
                    }
                }
                Step::Looped => log::info!("the log starts again"),
                Step::End => break,
            }
            let now_ns = i64::try_from(begin.elapsed().as_nanos()).unwrap_or(i64::MAX);
            let played_ns = self.player.bag_time_ns(now_ns).saturating_sub(first_ns);
            let share = (100.0 * played_ns as f64 / span_ns as f64) as i64;
            if share > percent && share <= 100 {
                percent = share;
                log::info!("played {percent} %");
            }
        }
        Ok(())
    }

    fn publish(&mut self, topic: usize, data: Vec<u8>) {
        let Some(publisher) = self.topics.get(topic) else {
            return;
        };
        self.report.messages += 1;
        if let Err(error) = publisher.publish_blocking(data) {
            self.report.failed += 1;
            log::warn!("{}: {error}", publisher.topic());
        }
    }

    /// Gives readers time to have everything.
    fn flush(&mut self) {
        let patience = match self.shutdown.is_requested() {
            true => HURRIED_FLUSH_TIME,
            false => FLUSH_TIME,
        };
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
}
