//! Services of rosbag2's player and recorder.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::{Duration, Time};
use crate::interface::services;

services! {
    "rosbag2_interfaces" in "../definitions/rosbag2_interfaces/";
    Pause: PauseRequest [], PauseResponse [];
    Resume: ResumeRequest [], ResumeResponse [];
    TogglePaused: TogglePausedRequest [], TogglePausedResponse [];
    Stop: StopRequest [], StopResponse [];
    IsPaused: IsPausedRequest [], IsPausedResponse [];
    GetRate: GetRateRequest [], GetRateResponse [];
    SetRate: SetRateRequest [], SetRateResponse [];
    PlayNext: PlayNextRequest [], PlayNextResponse [];
    Burst: BurstRequest [], BurstResponse [];
    Seek: SeekRequest [Time], SeekResponse [];
    Play: PlayRequest [Time, Duration], PlayResponse [];
    SplitBagfile: SplitBagfileRequest [], SplitBagfileResponse [];
    Snapshot: SnapshotRequest [], SnapshotResponse [];
}

/// Declares requests and responses without a field.
macro_rules! empty {
    ($($of:literal $name:ident),*) => {$(
        #[doc = $of]
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct $name {
            /// Padding: a structure on the wire has at least one byte.
            pub structure_needs_at_least_one_member: u8,
        }
    )*};
}

empty! {
    "Request of [`Pause`]." PauseRequest,
    "Response of [`Pause`]." PauseResponse,
    "Request of [`Resume`]." ResumeRequest,
    "Response of [`Resume`]." ResumeResponse,
    "Request of [`TogglePaused`]." TogglePausedRequest,
    "Response of [`TogglePaused`]." TogglePausedResponse,
    "Request of [`Stop`]." StopRequest,
    "Response of [`Stop`]." StopResponse,
    "Request of [`IsPaused`]." IsPausedRequest,
    "Request of [`GetRate`]." GetRateRequest,
    "Request of [`PlayNext`]." PlayNextRequest,
    "Request of [`SplitBagfile`]." SplitBagfileRequest,
    "Response of [`SplitBagfile`]." SplitBagfileResponse,
    "Request of [`Snapshot`]." SnapshotRequest
}

/// Pauses the playback.
#[derive(Clone, Copy, Debug)]
pub struct Pause;

/// Resumes the playback.
#[derive(Clone, Copy, Debug)]
pub struct Resume;

/// Pauses or resumes the playback.
#[derive(Clone, Copy, Debug)]
pub struct TogglePaused;

/// Ends the playback.
#[derive(Clone, Copy, Debug)]
pub struct Stop;

/// Queries whether the playback is paused.
#[derive(Clone, Copy, Debug)]
pub struct IsPaused;

/// Response of [`IsPaused`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IsPausedResponse {
    /// True: nothing is played until it is resumed.
    pub paused: bool,
}

/// Queries the rate.
#[derive(Clone, Copy, Debug)]
pub struct GetRate;

/// Response of [`GetRate`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetRateResponse {
    /// Log seconds per second.
    pub rate: f64,
}

/// Sets the rate.
#[derive(Clone, Copy, Debug)]
pub struct SetRate;

/// Request of [`SetRate`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetRateRequest {
    /// Log seconds per second.
    pub rate: f64,
}

/// Response of [`SetRate`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetRateResponse {
    /// False: rate out of range.
    pub success: bool,
}

/// Plays one message while paused.
#[derive(Clone, Copy, Debug)]
pub struct PlayNext;

/// Response of [`PlayNext`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlayNextResponse {
    /// False: not paused, or at the end.
    pub success: bool,
}

/// Plays several messages while paused, at once.
#[derive(Clone, Copy, Debug)]
pub struct Burst;

/// Request of [`Burst`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BurstRequest {
    /// Number of messages; 0: all.
    pub num_messages: u64,
}

/// Response of [`Burst`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BurstResponse {
    /// Messages that were played.
    pub actually_burst: u64,
}

/// Continues at another time of the log.
#[derive(Clone, Copy, Debug)]
pub struct Seek;

/// Request of [`Seek`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeekRequest {
    /// Time of the log.
    pub time: Time,
}

/// Response of [`Seek`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeekResponse {
    /// False: outside the log.
    pub success: bool,
}

/// Plays a paused log.
#[derive(Clone, Copy, Debug)]
pub struct Play;

/// Request of [`Play`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlayRequest {
    /// Begin, from that of the log.
    pub start_offset: Time,
    /// Length; not above 0: to the end.
    pub playback_duration: Duration,
    /// Time of the log at which it ends; not above 0: at its end.
    pub playback_until_timestamp: Time,
}

/// Response of [`Play`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlayResponse {
    /// False: it is being played already.
    pub success: bool,
}

/// Continues the recording in a new storage file.
#[derive(Clone, Copy, Debug)]
pub struct SplitBagfile;

/// Writes the buffer of a snapshot recorder.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot;

/// Response of [`Snapshot`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SnapshotResponse {
    /// False: snapshots are not supported.
    pub success: bool,
}
