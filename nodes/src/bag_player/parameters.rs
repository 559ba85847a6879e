//! Parameters of the player.

use std::ops::RangeInclusive;
use std::time::Duration;

use crate::{options, report};
use lattice_bag::PlayerOptions;
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "bag" fixed(START): "rosbag2 directory, one mcap or db3 file, or a ROS 1 bag.";
    "rate": "Log seconds per second.";
    "start_offset_s" fixed(START): "Start offset after the first message; latched messages before it are published first.";
    "duration_s" fixed(START): "Duration to play of the log; 0: to its end.";
    "loop" fixed(START): "Whether to start again at the end.";
    "topics" fixed(START): "Topics to play; empty: all.";
    "exclude_topics" fixed(START): "Topics not to play.";
    "clock_hz" fixed(START): "Rate of /clock; 0: never.";
    "wait_for_subscribers" fixed(START): "Topics that must have a subscriber before the log starts.";
    "lockstep" fixed(START): "Pairs of topics, a played one and a reply topic: each message waits for a reply with the stamp of the message before.";
    "wait_timeout_s" fixed(START): "Timeout of the wait for these subscribers and publishers.";
    "settle_s" fixed(START): "Extra time for them to discover the player.";
    "start_paused" fixed(START): "Whether the playback starts paused, until a call of ~/resume or the space bar.";
    "keyboard" fixed(START): "Whether terminal keys are read: space pauses, arrows step and change the rate.";
    "strict" fixed(START): "Whether the exit status is 1 if messages were skipped or not acknowledged.";
    "max_wait_s": "Longest wait for a subscriber that does not acknowledge; after it, messages of the topic are skipped and counted until it does. Also the timeout of a lockstep reply.";
};

const START: &str = "the log is opened with it";

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub bag: String,
    pub player: PlayerOptions,
    pub waited: Vec<String>,
    pub lockstep: Vec<String>,
    pub wait: Duration,
    pub settle: Duration,
    pub max_wait: Duration,
    pub start_paused: bool,
    pub keyboard: bool,
    pub strict: bool,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        Ok(Self {
            bag: params.string("bag", "")?,
            player: player_options(params)?,
            waited: params.string_array("wait_for_subscribers", &[])?,
            lockstep: params.string_array("lockstep", &[])?,
            wait: seconds(params, "wait_timeout_s", 30.0)?,
            settle: seconds(params, "settle_s", 0.5)?,
            max_wait: seconds(params, "max_wait_s", 10.0)?,
            start_paused: params.bool("start_paused", false)?,
            keyboard: params.bool("keyboard", true)?,
            strict: params.bool("strict", false)?,
            report_file: report::file(params)?,
        })
    }
}

/// Allowed times in a log, seconds.
const SECONDS: RangeInclusive<f64> = 0.0..=1e9;

fn player_options(params: &Params) -> Result<PlayerOptions, ParamError> {
    let duration_s = params.f64_in("duration_s", 0.0, SECONDS)?;
    let include = params.string_array("topics", &[])?;
    let clock_hz = params.f64_in("clock_hz", 0.0, 0.0..=1e4)?;
    Ok(PlayerOptions {
        rate: params.f64_in("rate", 1.0, 1e-3..=1e3)?,
        start_offset_s: params.f64_in("start_offset_s", 0.0, SECONDS)?,
        duration_s: (duration_s > 0.0).then_some(duration_s),
        loop_: params.bool("loop", false)?,
        include: (!include.is_empty()).then_some(include),
        exclude: params.string_array("exclude_topics", &[])?,
        clock_hz: (clock_hz > 0.0).then_some(clock_hz),
    })
}

/// Reads a duration of up to a day.
fn seconds(params: &Params, name: &str, default: f64) -> Result<Duration, ParamError> {
    let seconds = params.f64_in(name, default, 0.0..=86_400.0)?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
