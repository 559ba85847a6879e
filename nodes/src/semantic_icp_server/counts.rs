//! Counters of a server: clouds, requests, searches.

use serde::{Deserialize, Serialize};

/// Counters of one server.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ServerCounts {
    /// Clouds received.
    pub clouds_in: u64,
    /// Clouds refused: not in the headset's frame.
    pub clouds_wrong_frame: u64,
    /// Clouds refused: without points.
    pub clouds_empty: u64,
    /// Clouds refused: no point is finite and near enough.
    pub clouds_no_place: u64,
    /// Clouds refused: without labels, where those are required.
    pub clouds_unlabelled: u64,
    /// Clouds refused: more points than `max_cloud_points`.
    pub clouds_too_large: u64,
    /// Clouds refused: the bytes are not what the header says.
    pub clouds_malformed: u64,
    /// Clouds that came before the map.
    pub clouds_no_map: u64,
    /// Clouds with which a search began.
    pub clouds_searched: u64,
    /// Clouds that the known pose was refined by.
    pub clouds_tracked: u64,
    /// Clouds kept for the next search.
    pub clouds_kept: u64,
    /// Points left out: NaN or infinite.
    pub points_not_finite: u64,
    /// Points left out: farther than `max_range_m`.
    pub points_too_far: u64,
    /// Sessions begun.
    pub sessions: u64,
    /// Requests received.
    pub requests_in: u64,
    /// Requests refused: another is at work.
    pub requests_busy: u64,
    /// Requests refused: no map, no cloud, another session or no pose as a guess.
    pub requests_refused: u64,
    /// Searches ended: the headset was found.
    pub searches_ok: u64,
    /// Searches ended: several places fit.
    pub searches_ambiguous: u64,
    /// Searches ended: a direction is open.
    pub searches_degenerate: u64,
    /// Searches ended: nothing fits.
    pub searches_no_overlap: u64,
    /// Searches ended: the clouds or the map cannot be used, mirrored ones among them.
    pub searches_rejected: u64,
    /// Searches ended early: canceled, superseded, or of a session that has ended.
    pub searches_ended_early: u64,
    /// Clouds that did not fit the known pose.
    pub tracking_misses: u64,
    /// Clouds that fitted the known pose less than they should.
    pub tracking_doubts: u64,
    /// Searches with more looks than the known pose was found with.
    pub confirmations: u64,
    /// Of these those that fitted best elsewhere: what was known is not known any more.
    pub poses_withdrawn: u64,
    /// Times that the known pose was given up.
    pub tracking_lost: u64,
    /// Parts of the map refused.
    pub map_refused: u64,
}

impl ServerCounts {
    /// Clouds refused for any reason.
    pub fn clouds_refused(&self) -> u64 {
        self.clouds_wrong_frame
            + self.clouds_empty
            + self.clouds_no_place
            + self.clouds_unlabelled
            + self.clouds_too_large
            + self.clouds_malformed
    }
}

/// The end of a server.
#[derive(Clone, Debug, Serialize)]
pub struct ServerReport<'a> {
    /// Everything counted by the state machine.
    pub counts: &'a ServerCounts,
    /// Messages that found the inbox, or the queue before it, full.
    pub inbox_full: u64,
    /// Messages that were sent and did not come.
    pub lost_on_network: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Voxels of the map that it followed.
    pub map_voxels: usize,
    /// Times that the map was found to be another than its mapper's.
    pub map_differences: u64,
}
