//! `bag_player`: publishes a rosbag2 log on its recorded topics.

mod commands;
mod controls;
mod keyboard;
mod lockstep;
mod parameters;
mod playback;
mod player_report;
mod playhead;
mod steps;
mod waiting;

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

use crate::executables::{Files, answers_help, start_runtime};
use crate::report;
use crate::start::{Declare, NodeError, check_topics, open_params};
use commands::Commands;
use controls::serve_controls;
use keyboard::Keyboard;
use lattice_bag::{BagQos, BagReader, Player, STATIC_DEPTH, TopicInfo};
use lattice_runtime::logging::Throttle;
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, RawPublisher, renamed_topic};
use lockstep::Lockstep;
use parameters::Settings;
use playback::{Playback, STATE_PERIOD};
use playhead::Playhead;

pub use parameters::declare;
pub use player_report::PlayerReport;

/// Default name of the node, and name of the executable.
pub const NAME: &str = "bag_player";

/// Largest history depth of a publisher, as for parameters. A reliable publisher keeps unacknowledged samples up to
/// 64 MiB, whatever its depth.
const MAX_DEPTH: u64 = 10_000;
/// Limit of messages kept in memory for late joiners: the depth of `/rosout`, the largest in ROS.
const MAX_KEPT: u64 = 1000;

/// Plays the log given by the parameters and returns at its end or after a signal.
pub fn run(arguments: impl IntoIterator<Item = String>) -> Result<(), NodeError> {
    let args = RosArgs::parse(arguments)?;
    if answers_help(NAME, Some(parameters::declare), &args) {
        return Ok(());
    }
    let nodes = [(NAME, Some(parameters::declare as Declare))];
    let runtime = start_runtime(NAME, args, &nodes, Files::Shared)?;
    let node = runtime.node(NAME)?;
    let params = node.params();
    let Settings {
        bag,
        player,
        waited,
        lockstep,
        wait,
        settle,
        max_wait,
        start_paused,
        keyboard,
        strict,
        report_file,
    } = Settings::from_params(params)?;
    if bag.is_empty() {
        return Err("no log is given: set `--ros-args -p bag:=DIRECTORY`".into());
    }
    let reader = BagReader::open(&PathBuf::from(&bag))?.past_cut();
    let span_ns = (reader.start_ns().unwrap_or(0), reader.end_ns().unwrap_or(0));
    let has_clock = player.clock_hz.is_some();
    let player = Player::new(reader, player)?;
    let commands = Rc::new(Commands::new());
    // Kept to the end: the last replies need them.
    let _servers = serve_controls(&node, &commands.sender())?;
    let mut playback = Playback {
        commands: Rc::clone(&commands),
        steps: None,
        ended: false,
        topics: open_topics(&node, &player)?,
        clock: match has_clock {
            true => Some(node.publisher("/clock", Qos::CLOCK_PLAYER)?),
            false => None,
        },
        most_wait: max_wait,
        stuck: vec![false; player.topics().len()],
        lockstep: Lockstep::default(),
        head: Playhead::new(start_paused),
        stopped: false,
        player,
        span_ns,
        shutdown: runtime.shutdown_handle(),
        params: Arc::clone(params),
        diagnostics: node.diagnostics(),
        pace: Throttle::new(STATE_PERIOD),
        report: PlayerReport::default(),
    };
    check_topics(params, |_| false)?;
    let _keyboard = match keyboard {
        true => Keyboard::start(commands.sender()),
        false => None,
    };
    let changes = commands.sender();
    let now = Arc::clone(params);
    open_params(params, move |params| {
        let read = |params| Settings::from_params(params).map_err(|error| error.to_string());
        let (
            Settings {
                player, max_wait, ..
            },
            now,
        ) = (read(params)?, read(&now)?);
        // Changing another parameter must not undo a rate set by a key or service.
        let (rate, changed) = (player.rate, player.rate != now.player.rate);
        let sent = changes.send(Box::new(move |playback| {
            playback.most_wait = max_wait;
            if changed {
                playback.set_rate(rate);
            }
        }));
        sent.map_err(|_| "the log has ended".to_owned())
    });
    playback.wait_for(&waited, wait);
    playback.start_lockstep(&lockstep, &node, wait)?;
    if !(waited.is_empty() && lockstep.is_empty()) {
        // Discovery is done on this side; peers may need more time.
        playback.settle(settle);
    }
    log::info!("playing {bag}");
    let result = playback.play();
    playback.flush();
    report::write(&report_file, &playback.report, &node.diagnostics())?;
    // Sends the last replies.
    drop(runtime);
    result?;
    match playback.report.losses() {
        Some(losses) if strict => Err(format!("{losses} (`strict`)").into()),
        _ => Ok(()),
    }
}

/// Creates a publisher per topic, with the recorded QoS unless a parameter overrides it. Topics under former names
/// of ours are published under the present ones.
fn open_topics(node: &Node, player: &Player) -> Result<Vec<RawPublisher>, NodeError> {
    let mut publishers = Vec::new();
    for topic in player.topics() {
        let info = &topic.info;
        let renamed = renamed_topic(&info.name, &info.type_name);
        if let Some(new) = &renamed {
            let (old, of) = (&info.name, &info.type_name);
            log::info!("{old} ({of}) of this log is published as {new}, the present name");
        }
        let resolved = node.resolve(renamed.as_ref().unwrap_or(&info.name))?;
        let qos = offered(info).with_overrides(node.params(), &resolved, &info.name)?;
        let hash = type_hash(info);
        publishers.push(node.raw_publisher(&resolved, &info.type_name, hash.as_deref(), qos)?);
    }
    Ok(publishers)
}

/// Type hash recorded in the bag, or computed from the recorded definition.
fn type_hash(topic: &TopicInfo) -> Option<String> {
    let text = topic.definition.as_deref();
    match topic.type_hash.as_str() {
        "" => text.and_then(|text| lattice_msgs::type_hash(&topic.type_name, text)),
        noted => Some(noted.to_owned()),
    }
}

/// QoS of one publisher that replaces all recorded ones: the weakest value of each policy, so that every
/// recorded reader matches, and depth for the last samples of all. Static transforms use the QoS of tf2,
/// regardless of the bag.
fn offered(topic: &TopicInfo) -> Qos {
    let recorded = topic.offered_qos.as_slice();
    let is_static = topic.has_static_transforms();
    let depth = |qos: &BagQos| match qos.keep_all {
        true => MAX_DEPTH,
        false => qos.depth.max(1),
    };
    let all_latched = !recorded.is_empty() && recorded.iter().all(|qos| qos.latched);
    if is_static && !recorded.is_empty() && !all_latched {
        let name = &topic.name;
        log::info!("{name}: recorded as volatile, published as transient local");
    }
    let latched = is_static || all_latched;
    let depths = recorded.iter().map(depth);
    let depth = match latched {
        true => depths.fold(0, u64::saturating_add),
        false => depths.max().unwrap_or(10),
    };
    let least = if is_static { STATIC_DEPTH } else { 1 };
    let most = if latched { MAX_KEPT } else { MAX_DEPTH };
    if depth > most {
        let name = &topic.name;
        log::info!("{name}: recorded with a depth of {depth}, published with {most}");
    }
    Qos {
        reliability: match is_static || recorded.iter().all(|qos| qos.reliable) {
            true => Reliability::Reliable,
            false => Reliability::BestEffort,
        },
        durability: match latched {
            true => Durability::TransientLocal,
            false => Durability::Volatile,
        },
        depth: depth.clamp(least, most) as usize,
        kept: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth_of(recorded: &[BagQos]) -> usize {
        let topic = TopicInfo {
            name: "/points".to_owned(),
            offered_qos: recorded.to_vec(),
            ..TopicInfo::default()
        };
        offered(&topic).depth
    }

    #[test]
    fn a_publisher_has_the_depth_that_was_recorded_within_its_bound() {
        let volatile = |depth| BagQos {
            depth,
            ..BagQos::default()
        };
        for (recorded, expected) in [
            (0, 1),
            (1, 1),
            (1000, 1000),
            (1001, 1001),
            (10_000, 10_000),
            (10_001, 10_000),
            (u64::MAX, 10_000),
        ] {
            assert_eq!(depth_of(&[volatile(recorded)]), expected, "{recorded}");
        }
        assert_eq!(depth_of(&[]), 10);
        assert_eq!(depth_of(&[volatile(7), volatile(5000)]), 5000);
        let all = BagQos {
            keep_all: true,
            ..volatile(0)
        };
        assert_eq!(depth_of(&[all]), 10_000);
        // Kept for late joiners: the last ones of all publishers.
        let latched = |depth| BagQos {
            latched: true,
            ..volatile(depth)
        };
        assert_eq!(depth_of(&[latched(300), latched(400)]), 700);
        assert_eq!(depth_of(&[latched(u64::MAX), latched(1)]), 1000);
    }
}
