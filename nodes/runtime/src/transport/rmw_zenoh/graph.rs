//! Endpoints of other sessions, from their liveliness tokens, and their matches with local endpoints.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::Mutex;
use std::time::Duration;

use smol::channel::Sender;

use super::keys::{ANY_HASH, Channel, Kind, Token, gid, read_token};
use crate::logging::Throttle;
use crate::sync::lock;
use crate::transport::port::{EndpointId, PortEvent};
use crate::transport::remote::{Announced, GraphRole, RemotePublisher};

/// Limit of stored endpoints of other sessions.
const MAX_TOKENS: usize = 8192;

/// Period of warnings about rejected tokens.
const WARNING_PERIOD: Duration = Duration::from_secs(5);

/// All known endpoints.
pub(super) struct Graph {
    zid: String,
    events: Sender<PortEvent>,
    state: Mutex<State>,
    warning: Throttle,
}

#[derive(Default)]
struct State {
    ours: BTreeMap<EndpointId, (Kind, Channel)>,
    others: BTreeMap<EndpointId, Token>,
    refused: u64,
}

/// Graph entry of a local endpoint; dropping it removes the entry.
pub(super) struct Place {
    graph: Arc<Graph>,
    id: EndpointId,
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = lock(&self.graph.state).ours.remove(&self.id);
    }
}

impl Graph {
    pub(super) fn new(zid: &str, events: Sender<PortEvent>) -> Arc<Self> {
        Arc::new(Self {
            zid: zid.to_owned(),
            events,
            state: Mutex::default(),
            warning: Throttle::new(WARNING_PERIOD),
        })
    }

    /// True for an endpoint of this session.
    pub(super) fn is_ours(&self, id: &EndpointId) -> bool {
        lock(&self.state).ours.contains_key(id)
    }

    /// Adds a local endpoint and matches it with present and future endpoints.
    pub(super) fn add(self: &Arc<Self>, id: EndpointId, kind: Kind, channel: &Channel) -> Place {
        let mut state = lock(&self.state);
        for (peer, token) in &state.others {
            self.compare((id, kind, channel), *peer, token);
        }
        let _ = state.ours.insert(id, (kind, channel.clone()));
        Place {
            graph: Arc::clone(self),
            id,
        }
    }

    /// Handles a new liveliness token.
    pub(super) fn declared(&self, key: &str) {
        let token = match read_token(key) {
            Ok(Some(token)) if token.zid != self.zid => token,
            Ok(_) => return,
            Err(why) => return self.refuse(key, why),
        };
        let peer = gid(key);
        let mut state = lock(&self.state);
        if state.others.contains_key(&peer) {
            return;
        }
        if state.others.len() >= MAX_TOKENS {
            drop(state);
            return self.refuse(key, "more than 8192 endpoints are known");
        }
        self.found(peer, &token);
        for (id, (kind, channel)) in &state.ours {
            self.compare((*id, *kind, channel), peer, &token);
        }
        let _ = state.others.insert(peer, token);
    }

    /// Handles the end of a liveliness token.
    pub(super) fn undeclared(&self, key: &str) {
        let peer = gid(key);
        if lock(&self.state).others.remove(&peer).is_some() {
            self.send(PortEvent::Lost { peer });
        }
    }

    fn refuse(&self, key: &str, why: &str) {
        let mut state = lock(&self.state);
        state.refused = state.refused.saturating_add(1);
        let refused = state.refused;
        drop(state);
        if self.warning.check().is_some() {
            let key: String = key.chars().take(200).collect();
            log::warn!("liveliness token rejected ({refused} so far): {why}: {key:?}");
        }
    }

    fn found(&self, peer: EndpointId, token: &Token) {
        let (node, name) = (Some(token.node.clone()), token.channel.name.clone());
        let role = match token.kind {
            Kind::Publisher => return self.found_publisher(peer, token),
            Kind::Subscription => GraphRole::Subscriber,
            Kind::Server => GraphRole::Server,
            Kind::Client => return,
        };
        let announced = match role {
            GraphRole::Subscriber => {
                let (of, qos) = (&token.channel, (token.reliability, token.durability));
                Announced::of(&of.dds_type, of.hash.as_deref(), qos)
            }
            _ => None,
        };
        self.send(PortEvent::FoundOther {
            peer,
            role,
            name,
            announced: announced.map(Box::new),
            node,
        });
    }

    fn found_publisher(&self, peer: EndpointId, token: &Token) {
        let Channel {
            name,
            dds_type,
            hash,
        } = &token.channel;
        let offered = (token.reliability, token.durability);
        let publisher = RemotePublisher::on(name, dds_type, hash.as_deref(), offered);
        if let Some(publisher) = publisher {
            self.send(PortEvent::Found {
                peer,
                publisher: Box::new(publisher),
                node: Some(token.node.clone()),
            });
        }
    }

    fn compare(&self, ours: (EndpointId, Kind, &Channel), peer: EndpointId, token: &Token) {
        let (endpoint, kind, channel) = ours;
        if token.kind != kind.counterpart() || token.channel.name != channel.name {
            return;
        }
        self.send(match conflict(channel, &token.channel) {
            None => PortEvent::Matched { endpoint, peer },
            Some(policy) => PortEvent::Incompatible {
                endpoint,
                peer,
                policy: policy.into(),
            },
        });
    }

    fn send(&self, event: PortEvent) {
        // The receiver may be gone at shutdown.
        let _ = self.events.try_send(event);
    }
}

/// Type mismatch of two endpoints, which then have different keys.
fn conflict(ours: &Channel, other: &Channel) -> Option<String> {
    let shown = |text: &str| text.chars().take(200).collect::<String>();
    if ours.dds_type != other.dds_type {
        let (other, ours) = (shown(&other.dds_type), &ours.dds_type);
        return Some(format!("type {other}, not {ours}"));
    }
    let ours = ours.hash.as_deref()?;
    let hash = other.hash.as_deref().unwrap_or_default();
    match hash {
        _ if hash == ours => None,
        // Any hash matches.
        ANY_HASH => None,
        _ => Some(format!(
            "type of the same name in another version, {}, not {ours}",
            shown(hash)
        )),
    }
}

#[cfg(test)]
mod tests {
    use smol::channel::{Receiver, unbounded};

    use super::*;
    use crate::transport::port::PortNode;
    use crate::transport::qos::Qos;
    use crate::transport::rmw_zenoh::keys::Session;

    fn channel(dds_type: &str, hash: Option<&str>) -> Channel {
        Channel {
            name: "/a".to_owned(),
            dds_type: dds_type.to_owned(),
            hash: hash.map(str::to_owned),
        }
    }

    fn token(zid: &str, kind: Kind, channel: &Channel) -> String {
        let session = Session {
            domain: 0,
            zid: zid.to_owned(),
            enclave: "/".to_owned(),
        };
        let node = PortNode {
            number: 0,
            namespace: "/".to_owned(),
            name: "other".to_owned(),
        };
        session.endpoint_token(&node, 1, kind, channel, &Qos::DEFAULT)
    }

    fn graph() -> (Arc<Graph>, Receiver<PortEvent>) {
        let (sender, events) = unbounded();
        (Graph::new("1", sender), events)
    }

    fn texts(events: &Receiver<PortEvent>) -> Vec<String> {
        std::iter::from_fn(|| events.try_recv().ok())
            .map(|event| match event {
                PortEvent::Matched { .. } => "matched".to_owned(),
                PortEvent::Incompatible { policy, .. } => policy.into_owned(),
                PortEvent::Found {
                    publisher, node, ..
                } => {
                    format!("{} of {}", publisher.type_name, node.unwrap())
                }
                PortEvent::FoundOther { name, .. } => name,
                PortEvent::Lost { .. } => "lost".to_owned(),
            })
            .collect()
    }

    #[test]
    fn endpoints_match_whoever_comes_first_and_until_one_goes() {
        let hash = format!("RIHS01_{}", "a".repeat(64));
        let of = channel("p::msg::dds_::A_", Some(&hash));
        let (graph, events) = graph();
        let theirs = token("2", Kind::Publisher, &of);
        graph.declared(&theirs);
        let ours = EndpointId([1; 16]);
        let place = graph.add(ours, Kind::Subscription, &of);
        assert!(graph.is_ours(&ours));
        graph.declared(&theirs);
        let publisher = "p/msg/A of /other";
        assert_eq!(texts(&events), [publisher, "matched"]);
        graph.undeclared(&theirs);
        graph.declared(&theirs);
        assert_eq!(texts(&events), ["lost", publisher, "matched"]);
        drop(place);
        graph.undeclared(&theirs);
        graph.declared(&theirs);
        assert_eq!(texts(&events), ["lost", publisher]);
        graph.declared(&token("1", Kind::Publisher, &of));
        assert!(texts(&events).is_empty(), "our own");
    }

    #[test]
    fn other_types_and_versions_are_told() {
        let (graph, events) = graph();
        let of = channel("p::msg::dds_::A_", Some("x"));
        let _place = graph.add(EndpointId([1; 16]), Kind::Publisher, &of);
        for (other, expected) in [
            (
                channel("p::msg::dds_::B_", Some("x")),
                "type p::msg::dds_::B_, not",
            ),
            (
                channel("p::msg::dds_::A_", Some("y")),
                "another version, y, not x",
            ),
            (channel("p::msg::dds_::A_", None), "matched"),
        ] {
            graph.declared(&token("2", Kind::Subscription, &other));
            let found = texts(&events);
            assert!(found[1].contains(expected), "{found:?}");
        }
        graph.declared(&token("2", Kind::Server, &of));
        assert_eq!(texts(&events), ["/a"], "a service of the same name");
    }

    #[test]
    fn a_flood_of_tokens_ends_in_refusals() {
        let (graph, _events) = graph();
        for i in 0..=MAX_TOKENS {
            let of = channel(&format!("p::msg::dds_::A{i}_"), Some("x"));
            graph.declared(&token("2", Kind::Subscription, &of));
        }
        graph.declared("@ros2_lv/0/rubbish");
        let state = lock(&graph.state);
        assert_eq!((state.others.len(), state.refused), (MAX_TOKENS, 2));
    }
}
