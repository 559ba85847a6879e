//! `bag_player`: a rosbag2 log on the topics that it was recorded from.

mod controls;
mod keyboard;
mod playback;

use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;

use crate::executables::{answers_help, start_runtime};
use crate::report;
use crate::start::{NodeError, warn_unused};
use controls::Controls;
use keyboard::Keyboard;
use lattice_bag::{BagQos, BagReader, Player, PlayerOptions, TopicInfo};
use lattice_runtime::params::Params;
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, RawPublisher};
use playback::{Playback, Playhead};

/// Name of the executable and of the node unless it is remapped.
pub const NAME: &str = "bag_player";

/// Largest depth of a publisher whose recorder kept all samples.
const MAX_DEPTH: u64 = 1000;

/// The end of a player.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PlayerReport {
    /// Messages given to the publishers.
    pub messages: u64,
    /// Messages that a publisher did not take: a subscriber has not acknowledged those before.
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
    let mut playback = Playback {
        topics: open_topics(&node, &player)?,
        clock: match params.f64("clock_hz", 0.0)? > 0.0 {
            true => Some(node.publisher("/clock", Qos::CLOCK_PLAYER)?),
            false => None,
        },
        most_wait: seconds(params, "max_wait_s", 2.0)?,
        stuck: vec![false; player.topics().len()],
        head: Playhead::new(params.bool("start_paused", false)?),
        stopped: false,
        player,
        span_ns,
        shutdown: runtime.shutdown_handle(),
        report: PlayerReport::default(),
    };
    let controls = Controls::serve(&node)?;
    let _keyboard = match params.bool("keyboard", true)? {
        true => Keyboard::start(controls.sender()),
        false => None,
    };
    warn_unused(params);
    playback.wait_for(&waited, wait);
    if !waited.is_empty() {
        // We know them; they may need a moment to know us.
        playback.shutdown.wait_timeout(settle);
    }
    log::info!("playing {bag}");
    let result = playback.play(&controls);
    controls.obey_all(&mut playback);
    playback.flush();
    report::write(&report_file, &playback.report)?;
    // Sends the last answers, for which the servers must still be there.
    drop(runtime);
    drop(controls);
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
        kept: None,
    }
}
