//! Counters of a server: clouds, requests, searches.

use serde::{Deserialize, Serialize};

/// Counters of one server.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ServerCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Clouds rejected: not in the headset's frame.
    pub clouds_wrong_frame: u64,
    /// Clouds rejected: without points.
    pub clouds_empty: u64,
    /// Clouds rejected: no point is finite and within range.
    pub clouds_no_place: u64,
    /// Clouds rejected: without labels, where those are required.
    pub clouds_unlabelled: u64,
    /// Clouds rejected: more points than `max_cloud_points`.
    pub clouds_too_large: u64,
    /// Clouds rejected: the data do not match the header.
    pub clouds_malformed: u64,
    /// Clouds received before the map.
    pub clouds_no_map: u64,
    /// Clouds that started a search.
    pub clouds_searched: u64,
    /// Clouds used for tracking the current pose.
    pub clouds_tracked: u64,
    /// Clouds kept for the next search.
    pub clouds_kept: u64,
    /// Points rejected: NaN or infinite.
    pub points_not_finite: u64,
    /// Points rejected: farther than `max_range_m`.
    pub points_too_far: u64,
    /// Headset sessions.
    pub sessions: u64,
    /// Requests received.
    pub requests_in: u64,
    /// Requests rejected: another one is in progress.
    pub requests_busy: u64,
    /// Requests rejected: no map, no cloud, another session or an invalid guess.
    pub requests_refused: u64,
    /// Searches with verdict `OK`.
    pub searches_ok: u64,
    /// Searches with verdict `AMBIGUOUS`.
    pub searches_ambiguous: u64,
    /// Searches with verdict `DEGENERATE`.
    pub searches_degenerate: u64,
    /// Searches with verdict `NO_OVERLAP`.
    pub searches_no_overlap: u64,
    /// Searches with verdict `REJECTED_INPUT`: unusable clouds or map, or mirrored clouds.
    pub searches_rejected: u64,
    /// Searches ended early: canceled, superseded, or of an ended session.
    pub searches_ended_early: u64,
    /// Clouds that did not fit the current pose.
    pub tracking_misses: u64,
    /// Clouds whose fit to the current pose was below `doubt_below`.
    pub tracking_doubts: u64,
    /// Searches with more scans than the current pose was found with.
    pub confirmations: u64,
    /// Confirmations that fitted best elsewhere, which withdrew the current pose.
    pub poses_withdrawn: u64,
    /// Losses of the current pose.
    pub tracking_lost: u64,
    /// Map messages rejected.
    pub map_refused: u64,
}

impl ServerCounts {
    /// Clouds rejected for any reason.
    pub fn clouds_refused(&self) -> u64 {
        self.clouds_wrong_frame
            + self.clouds_empty
            + self.clouds_no_place
            + self.clouds_unlabelled
            + self.clouds_too_large
            + self.clouds_malformed
    }
}

/// Report of a server.
#[derive(Clone, Debug, Serialize)]
pub struct ServerReport<'a> {
    /// Counters of the state machine.
    pub counts: &'a ServerCounts,
    /// Messages rejected by a full inbox or overrun before it.
    pub inbox_full: u64,
    /// Messages lost on the network.
    pub lost_on_network: u64,
    /// Undecodable samples.
    pub undecodable: u64,
    /// Voxels of the followed map.
    pub map_voxels: usize,
    /// Number of detected differences from the mapper's map.
    pub map_differences: u64,
}
