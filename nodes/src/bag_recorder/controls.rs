//! Services of rosbag2's recorder.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use lattice_msgs::rosbag2_interfaces::{
    IsPaused, IsPausedResponse, Pause, PauseResponse, Resume, ResumeResponse, Snapshot,
    SnapshotResponse, SplitBagfile, SplitBagfileResponse, TogglePaused, TogglePausedResponse,
};
use lattice_runtime::{RuntimeError, Server};

use super::cache::Item;
use super::session::Session;

/// Serves the controls of a recording until it is dropped.
pub(super) fn serve(session: &Session) -> Result<Vec<Server>, RuntimeError> {
    let node = &session.node;
    let hold = |paused: &Arc<AtomicBool>, hold: bool| {
        let paused = Arc::clone(paused);
        move || {
            if paused.swap(hold, Relaxed) != hold {
                log::info!("{}", if hold { "paused" } else { "resumed" });
            }
        }
    };
    let (pause, resume) = (hold(&session.paused, true), hold(&session.paused, false));
    let (toggled, asked) = (session.paused.clone(), session.paused.clone());
    let cache = session.cache.clone();
    Ok(vec![
        node.service::<Pause>("~/pause", move |_| {
            pause();
            PauseResponse::default()
        })?,
        node.service::<Resume>("~/resume", move |_| {
            resume();
            ResumeResponse::default()
        })?,
        node.service::<TogglePaused>("~/toggle_paused", move |_| {
            toggled.fetch_not(Relaxed);
            TogglePausedResponse::default()
        })?,
        node.service::<IsPaused>("~/is_paused", move |_| IsPausedResponse {
            paused: asked.load(Relaxed),
        })?,
        node.service::<SplitBagfile>("~/split_bagfile", move |_| {
            cache.push(Item::Split);
            SplitBagfileResponse::default()
        })?,
        // Snapshot mode is not supported.
        node.service::<Snapshot>("~/snapshot", |_| SnapshotResponse { success: false })?,
    ])
}
