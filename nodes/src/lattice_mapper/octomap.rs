//! Topics and services of octomap_server for its clients; `docs/octomap.md` lists further compatibility.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use lattice_msgs::lattice::ClearBoxRequest;
use lattice_msgs::octomap_msgs::{BoundingBoxQuery, GetOctomap, GetOctomapResponse, Octomap};
use lattice_msgs::std_srvs::{Empty, EmptyResponse};

use super::call::Call;
use super::state::LatticeMapper;
use crate::compute::Inbox;
use crate::octree::OctreeForm;
use crate::start::{LAST_EVENTS, LAST_FLUSH};
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher, RuntimeError, Server};

/// Topics and services of octrees.
const OCTOMAPS: [(&str, OctreeForm); 2] = [
    ("octomap_binary", OctreeForm::Binary),
    ("octomap_full", OctreeForm::Full),
];
/// Shortest time between two octrees, as a multiple of the time that one takes: mapping goes first.
const PAUSE: u32 = 10;

/// Publishers of octrees.
pub(super) struct Octomaps {
    topics: Vec<OctomapTopic>,
    problem: Option<String>,
}

struct OctomapTopic {
    form: OctreeForm,
    publisher: Publisher<Octomap>,
    /// True after a subscriber has joined.
    asked: Arc<AtomicBool>,
    /// State of the last published octree.
    published: Option<(u64, u64, u64)>,
    /// Time that the last one took.
    took: Duration,
    due: Instant,
}

impl Octomaps {
    /// Creates the topics.
    pub(super) fn open(node: &Node) -> Result<Self, RuntimeError> {
        let mut topics = Vec::new();
        for (name, form) in OCTOMAPS {
            let topic = OctomapTopic {
                form,
                publisher: node.publisher(name, Qos::LATCHED)?,
                asked: Arc::default(),
                published: None,
                took: Duration::ZERO,
                due: Instant::now(),
            };
            let asked = Arc::clone(&topic.asked);
            let ask = move || asked.store(true, Ordering::Relaxed);
            topic.publisher.on_subscriber_joined(ask);
            topics.push(topic);
        }
        Ok(Self {
            topics,
            problem: None,
        })
    }

    /// Publishes the octrees that somebody subscribes to, if the map has changed.
    pub(super) fn publish(&mut self, machine: &mut LatticeMapper, is_last: bool) {
        let state = machine.octomap_state();
        for topic in &mut self.topics {
            let is_new = topic.published != Some(state);
            let is_subscribed = topic.publisher.subscriber_count() > 0;
            if !is_subscribed || !(is_new || topic.asked.load(Ordering::Relaxed)) {
                continue;
            }
            let begin = Instant::now();
            if is_last && topic.took > LAST_EVENTS {
                let name = topic.publisher.topic();
                log::warn!("{name}: the last changes are not published, since the node has to end");
                continue;
            }
            if begin < topic.due && !is_last {
                continue;
            }
            topic.asked.store(false, Ordering::Relaxed);
            topic.published = Some(state);
            match machine.octomap(topic.form) {
                Ok(octomap) => {
                    self.problem = None;
                    if let Err(error) = topic.publisher.publish(octomap) {
                        log::debug!("octree not published: {error}");
                    }
                }
                Err(error) => self.problem = Some(error.to_string()),
            }
            topic.took = begin.elapsed();
            topic.due = Instant::now() + topic.took * PAUSE;
        }
    }

    /// Reason why the last octree was not made.
    pub(super) fn problem(&self) -> Option<String> {
        self.problem.clone()
    }

    /// Waits until the octrees are sent, at most [`LAST_FLUSH`].
    pub(super) fn flush(&self) {
        let begin = Instant::now();
        for topic in &self.topics {
            let left = LAST_FLUSH.saturating_sub(begin.elapsed());
            topic.publisher.flush(left);
        }
    }
}

/// Response with an octree; an empty one if it cannot be made, as the service has no error.
pub(super) fn response(machine: &mut LatticeMapper, form: OctreeForm) -> GetOctomapResponse {
    let made = machine.octomap(form);
    let made = made.inspect_err(|error| log::warn!("no octree for a client: {error}"));
    GetOctomapResponse {
        map: made.unwrap_or_default(),
    }
}

/// Serves `~/clear_bbox`, `~/reset` and octrees with their types. Their replies cannot report a full inbox, which
/// leaves the map unchanged: it is logged.
pub(super) fn serve<E: Send + 'static>(
    node: &Node,
    inbox: &Inbox<E>,
    wrap: fn(Call) -> E,
    reset: fn() -> E,
) -> Result<Vec<Server>, RuntimeError> {
    let clear = |name: &str| {
        let to = inbox.clone();
        node.service_later::<BoundingBoxQuery>(name, move |request, reply| {
            let (min, max) = (request.min, request.max);
            let busy = reply.clone();
            if !to.send(
                wrap(Call::ClearBoundingBox(ClearBoxRequest { min, max }, reply)),
                0,
            ) {
                log::warn!("the inbox is full: the box is not cleared");
                busy.send(Default::default());
            }
        })
    };
    let get = |(name, form): (&str, OctreeForm)| {
        let to = inbox.clone();
        node.service_later::<GetOctomap>(name, move |_, reply| {
            let busy = reply.clone();
            if !to.send(wrap(Call::Octomap(form, reply)), 0) {
                log::warn!("the inbox is full: no octree for a client");
                busy.send(Default::default());
            }
        })
    };
    let to = inbox.clone();
    let emptied = node.service::<Empty>("~/reset", move |_| {
        if !to.send(reset(), 0) {
            log::warn!("the inbox is full: the map is not reset");
        }
        EmptyResponse::default()
    })?;
    let mut servers = vec![clear("~/clear_bbox")?, clear("~/clear_bbx")?, emptied];
    for octomap in OCTOMAPS {
        servers.push(get(octomap)?);
    }
    Ok(servers)
}
