//! Services of rosbag2's player, applied to the playback.

use std::sync::mpsc::Sender;

use lattice_msgs::RosService;
use lattice_msgs::rosbag2_interfaces::{
    Burst, BurstResponse, GetRate, GetRateResponse, IsPaused, IsPausedResponse, Pause, Play,
    PlayNext, PlayNextResponse, PlayResponse, Resume, Seek, SeekResponse, SetRate, SetRateResponse,
    Stop, TogglePaused,
};
use lattice_runtime::{Node, Reply, RuntimeError, Server};

use super::commands::Command;
use super::playback::Playback;
use super::steps::Steps;

/// Limit of pending calls per service: one `~/burst` in progress, and one that is rejected meanwhile.
const MAX_PENDING: usize = 2;

/// Serves the controls until the servers are dropped.
pub(super) fn serve_controls(
    node: &Node,
    sender: &Sender<Command<Playback>>,
) -> Result<Vec<Server>, RuntimeError> {
    let to = (node, sender);
    Ok(vec![
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
        serve_later::<PlayNext>(to, "~/play_next", |playback, _, reply| {
            playback.play_steps(Steps::new(Some(1), |played| {
                let success = played > 0;
                reply.send(PlayNextResponse { success });
            }));
        })?,
        serve_later::<Burst>(to, "~/burst", |playback, request, reply| {
            let wanted = Some(request.num_messages).filter(|wanted| *wanted > 0);
            playback.play_steps(Steps::new(wanted, |actually_burst| {
                reply.send(BurstResponse { actually_burst });
            }));
        })?,
        serve::<Play>(to, "~/play", |playback, request| PlayResponse {
            success: playback.play_part(&request),
        })?,
        serve::<Seek>(to, "~/seek", |playback, request| SeekResponse {
            success: playback.seek(request.time.to_ns()),
        })?,
    ])
}

fn serve<S: RosService + 'static>(
    (node, sender): (&Node, &Sender<Command<Playback>>),
    name: &str,
    obey: impl Fn(&mut Playback, S::Request) -> S::Response + Copy + Send + 'static,
) -> Result<Server, RuntimeError> {
    let obey = move |playback: &mut Playback, request, reply: Reply<S::Response>| {
        reply.send(obey(playback, request));
    };
    serve_later::<S>((node, sender), name, obey)
}

/// Serves requests whose reply is sent by the executed command, at once or later.
fn serve_later<S: RosService + 'static>(
    (node, sender): (&Node, &Sender<Command<Playback>>),
    name: &str,
    obey: impl Fn(&mut Playback, S::Request, Reply<S::Response>) + Copy + Send + 'static,
) -> Result<Server, RuntimeError> {
    let sender = sender.clone();
    node.service_concurrent::<S>(name, MAX_PENDING, move |request, reply| {
        let _ = sender.send(Box::new(move |playback| obey(playback, request, reply)));
    })
}

/// Serves requests with an empty reply.
fn answer<S: RosService + 'static>(
    to: (&Node, &Sender<Command<Playback>>),
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
