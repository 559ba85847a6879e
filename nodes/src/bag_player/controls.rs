//! The services of rosbag2's player, and what they do to the playback.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use lattice_msgs::RosService;
use lattice_msgs::rosbag2_interfaces::{
    Burst, BurstResponse, GetRate, GetRateResponse, IsPaused, IsPausedResponse, Pause, Play,
    PlayNext, PlayNextResponse, PlayResponse, Resume, Seek, SeekResponse, SetRate, SetRateResponse,
    Stop, TogglePaused,
};
use lattice_runtime::{Node, RuntimeError, Server};

use super::playback::Playback;
use crate::start::NodeError;

/// A change of the playback, or a question; obeyed between two messages.
pub(super) type Control = Box<dyn FnOnce(&mut Playback) + Send>;

/// Servers of the controls, and what was asked of them.
pub(super) struct Controls {
    _servers: Vec<Server>,
    // Kept, so that to wait without any is no error.
    sender: Sender<Control>,
    waiting: Receiver<Control>,
}

impl Controls {
    pub(super) fn serve(node: &Node) -> Result<Self, NodeError> {
        let (sender, waiting) = channel();
        let to = (node, &sender);
        let servers = vec![
            answer::<Pause>(to, "~/pause", |playback, _| playback.hold(true))?,
            answer::<Resume>(to, "~/resume", |playback, _| playback.hold(false))?,
            answer::<TogglePaused>(to, "~/toggle_paused", |playback, _| playback.toggle())?,
            answer::<Stop>(to, "~/stop", |playback, _| playback.stop())?,
            serve::<IsPaused>(to, "~/is_paused", |playback, _| IsPausedResponse {
                paused: playback.head.is_held(),
            })?,
            serve::<GetRate>(to, "~/get_rate", |playback, _| GetRateResponse {
                rate: playback.player.rate(),
            })?,
            serve::<SetRate>(to, "~/set_rate", |playback, request| SetRateResponse {
                success: playback.set_rate(request.rate),
            })?,
            serve::<PlayNext>(to, "~/play_next", |playback, _| PlayNextResponse {
                success: playback.play_next(),
            })?,
            serve::<Burst>(to, "~/burst", |playback, request| BurstResponse {
                actually_burst: playback.burst(request.num_messages),
            })?,
            serve::<Play>(to, "~/play", |playback, request| PlayResponse {
                success: playback.play_part(&request),
            })?,
            serve::<Seek>(to, "~/seek", |playback, request| SeekResponse {
                success: playback.seek(request.time.to_ns()),
            })?,
        ];
        Ok(Self {
            _servers: servers,
            sender,
            waiting,
        })
    }

    /// For controls from elsewhere.
    pub(super) fn sender(&self) -> Sender<Control> {
        self.sender.clone()
    }

    /// Answers what waits at the end.
    pub(super) fn obey_all(&self, playback: &mut Playback) {
        while let Some(control) = self.next(Duration::ZERO) {
            control(playback);
        }
    }

    /// The next one, waited for at most so long.
    pub(super) fn next(&self, patience: Duration) -> Option<Control> {
        self.waiting.recv_timeout(patience).ok()
    }
}

fn serve<S: RosService + 'static>(
    (node, sender): (&Node, &Sender<Control>),
    name: &str,
    obey: impl Fn(&mut Playback, S::Request) -> S::Response + Copy + Send + 'static,
) -> Result<Server, RuntimeError> {
    let sender = sender.clone();
    node.service_later::<S>(name, move |request, reply| {
        // No more than one of each service waits.
        let _ = sender.send(Box::new(move |playback| {
            reply.send(obey(playback, request))
        }));
    })
}

/// Serves what has nothing to answer.
fn answer<S: RosService + 'static>(
    to: (&Node, &Sender<Control>),
    name: &str,
    obey: fn(&mut Playback, S::Request),
) -> Result<Server, RuntimeError>
where
    S::Response: Default,
{
    serve::<S>(to, name, move |playback, request| {
        obey(playback, request);
        S::Response::default()
    })
}
