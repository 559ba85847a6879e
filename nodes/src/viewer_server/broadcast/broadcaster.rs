//! Distribution of messages from the node's thread to all clients.

use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};
use std::time::{SystemTime, UNIX_EPOCH};

use lattice_msgs::RosMessage;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_runtime::{Activity, lock};
use smol::channel::{Receiver, bounded};

use super::bridge::Bridge;
use super::client::Client;
use super::counts::BroadcasterCounts;
use super::graph::ConnectionGraph;
use super::map_stream::{Entry, MapStream, entry};
use super::outbox::{Class, Outbox, Outgoing};
use crate::viewer_server::protocol::{self, Advertised, Value};
use crate::viewer_server::session::{InputRefusal, Offer};

/// Limit of map update bytes kept for slow clients.
const MAX_UPDATE_BYTES: usize = 8 << 20;

/// Channels, map stream and clients of a server.
pub struct Broadcaster {
    max_clients: usize,
    session: String,
    source: &'static str,
    bridge: OnceLock<Box<dyn Bridge>>,
    /// Offer without a bridge.
    nothing: Offer,
    /// Noted when a client connects.
    activity: Activity,
    inner: Mutex<Inner>,
}

struct Inner {
    channels: Vec<Channel>,
    stream: MapStream,
    clients: BTreeMap<u64, Client>,
    next_client: u64,
    counts: BroadcasterCounts,
    /// Graph as last sent to its followers.
    graph: ConnectionGraph,
}

struct Channel {
    advertised: Advertised,
    class: Class,
    /// True if late joiners receive the last message.
    kept: bool,
    last: Option<Entry>,
    /// Number of subscriptions so far.
    joined: u64,
}

/// Demand for a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Demand {
    /// Current subscribers.
    pub clients: usize,
    /// Number of subscriptions so far.
    pub joined: u64,
}

impl Broadcaster {
    /// Creates a broadcaster without channels, for up to `max_clients`, each of which is noted as activity.
    pub fn new(max_clients: usize, activity: Activity) -> Self {
        Self::of("live", max_clients, activity)
    }

    /// Creates a broadcaster for the constant map of a file.
    pub fn of_file(max_clients: usize) -> Self {
        Self::of("file", max_clients, Activity::default())
    }

    fn of(source: &'static str, max_clients: usize, activity: Activity) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        Self {
            max_clients,
            source,
            activity,
            session: since.map_or(0, |since| since.as_nanos()).to_string(),
            bridge: OnceLock::new(),
            nothing: Offer::default(),
            inner: Mutex::new(Inner {
                channels: Vec::new(),
                stream: MapStream::new(MAX_UPDATE_BYTES),
                clients: BTreeMap::new(),
                next_client: 0,
                counts: BroadcasterCounts::default(),
                graph: ConnectionGraph::default(),
            }),
        }
    }

    /// Sets the bridge; to be called once, before the first client connects. Later calls have no effect.
    pub fn set_bridge(&self, bridge: Box<dyn Bridge>) {
        if self.bridge.set(bridge).is_err() {
            log::debug!("the bridge is set already");
        }
    }

    /// Bridge to nodes, if set.
    pub fn bridge(&self) -> Option<&dyn Bridge> {
        self.bridge.get().map(AsRef::as_ref)
    }

    /// Capabilities offered to clients.
    pub fn offer_of_bridge(&self) -> &Offer {
        self.bridge().map_or(&self.nothing, Bridge::offer)
    }

    /// Adds the map channels of a node's topics, in full and thin form.
    pub fn map_channels(&self, map: &str, updates: &str) {
        self.channel::<LatticeMap>(map, Class::Map, false);
        self.channel::<LatticeMapUpdate>(updates, Class::Updates, false);
        self.channel::<LatticeMap>(&format!("{map}_thin"), Class::ThinMap, false);
        self.channel::<LatticeMapUpdate>(&format!("{updates}_thin"), Class::ThinUpdates, false);
    }

    /// Adds a channel before the first client connects; returns its id.
    pub fn channel<M: RosMessage>(&self, topic: &str, class: Class, kept: bool) -> u32 {
        let mut inner = lock(&self.inner);
        let id = inner.channels.len() as u32;
        inner.channels.push(Channel {
            advertised: Advertised {
                id,
                topic: topic.to_owned(),
                encoding: "cdr",
                schema_name: M::TYPE,
                schema_encoding: "ros2msg",
                schema: M::definition(),
            },
            class,
            kept,
            last: None,
            joined: 0,
        });
        id
    }

    /// Queues a message for all subscribers of a channel.
    pub fn offer(&self, channel: u32, cdr: Vec<u8>) {
        let message = entry(cdr);
        let mut inner = lock(&self.inner);
        for client in inner.clients.values_mut() {
            if client.outbox.offer(channel, &message) {
                client.wake();
            }
        }
        if let Some(channel) = inner.channels.get_mut(channel as usize)
            && channel.kept
        {
            channel.last = Some(message);
        }
    }

    /// Changes the map stream, and wakes all clients.
    pub fn change_map(&self, change: impl FnOnce(&mut MapStream)) {
        let mut inner = lock(&self.inner);
        change(&mut inner.stream);
        inner.clients.values_mut().for_each(Client::wake);
    }

    /// True if a client waits for a keyframe.
    pub fn keyframe_wanted(&self) -> bool {
        let inner = lock(&self.inner);
        let mut clients = inner.clients.values();
        clients.any(|client| client.outbox.waits_for_keyframe())
    }

    /// Demand for a channel.
    pub fn demand(&self, channel: u32) -> Demand {
        let inner = lock(&self.inner);
        let has = |client: &&Client| client.outbox.channels().any(|id| id == channel);
        Demand {
            clients: inner.clients.values().filter(has).count(),
            joined: inner
                .channels
                .get(channel as usize)
                .map_or(0, |channel| channel.joined),
        }
    }

    /// Number of clients.
    pub fn clients(&self) -> usize {
        lock(&self.inner).clients.len()
    }

    /// True if every client has taken all messages.
    pub fn is_drained(&self) -> bool {
        lock(&self.inner).clients.values().all(|client| client.idle)
    }

    /// Counters.
    pub fn counts(&self) -> BroadcasterCounts {
        let inner = lock(&self.inner);
        let boxes = inner.clients.values().map(|client| &client.outbox);
        let waiting: u64 = boxes.map(Outbox::dropped).sum();
        BroadcasterCounts {
            maps_restarted: inner.stream.fallen_behind(),
            messages_dropped: inner.counts.messages_dropped + waiting,
            ..inner.counts
        }
    }

    /// Counts a client that was closed because it did not read.
    pub fn count_stalled(&self) {
        lock(&self.inner).counts.clients_stalled += 1;
    }

    /// Counts connections displaced by newer ones.
    pub fn count_displaced(&self, connections: u64) {
        lock(&self.inner).counts.connections_displaced += connections;
    }

    /// Counts a failed TLS handshake.
    pub fn count_tls_failed(&self) {
        lock(&self.inner).counts.tls_failed += 1;
    }

    /// Counts a connection without TLS to a server with TLS.
    pub fn count_tls_plain(&self) {
        lock(&self.inner).counts.tls_plain += 1;
    }

    /// Adds a client; `None` if `max_clients` is reached. The receiver wakes the client's task.
    pub fn enter(&self) -> Option<(u64, Receiver<()>)> {
        let mut inner = lock(&self.inner);
        if inner.clients.len() >= self.max_clients {
            inner.counts.clients_refused += 1;
            return None;
        }
        let (wake, woken) = bounded(1);
        let mut outbox = Outbox::default();
        let offer = self.offer_of_bridge();
        let capabilities = offer.capabilities();
        outbox.control(protocol::server_info(
            &self.session,
            &capabilities,
            self.source,
        ));
        let channels = inner.channels.iter().map(|channel| &channel.advertised);
        outbox.control(protocol::advertise(&channels.collect::<Vec<_>>()));
        if !offer.services.is_empty() {
            outbox.control(protocol::advertise_services(&offer.services));
        }
        let id = inner.next_client;
        inner.next_client += 1;
        inner.counts.clients_in += 1;
        inner.clients.insert(id, Client::new(outbox, wake));
        drop(inner);
        self.activity.note();
        Some((id, woken))
    }

    /// Removes a client.
    pub fn leave(&self, id: u64) {
        let mut inner = lock(&self.inner);
        if let Some(client) = inner.clients.remove(&id) {
            inner.counts.messages_dropped += client.outbox.dropped();
        }
    }

    /// Removes the next message from the queue of a client; `None` if there is none, or no such client.
    pub fn next(&self, id: u64) -> Option<Outgoing> {
        let mut inner = lock(&self.inner);
        let Inner {
            stream,
            clients,
            counts,
            ..
        } = &mut *inner;
        let client = clients.get_mut(&id)?;
        let next = client.outbox.next(stream);
        client.idle = next.is_none();
        let next = next?;
        counts.messages_out += 1;
        if let Outgoing::Data(_, message) = &next {
            counts.bytes_out += message.cdr.len() as u64;
        }
        Some(next)
    }

    /// Ends subscriptions of a client.
    pub fn unsubscribe(&self, id: u64, subscriptions: &[u32]) {
        if let Some(client) = lock(&self.inner).clients.get_mut(&id) {
            for subscription in subscriptions {
                client.outbox.unsubscribe(*subscription);
            }
        }
    }

    /// Queues a protocol message ahead of data.
    pub fn enqueue(&self, id: u64, message: Outgoing) {
        if let Some(client) = lock(&self.inner).clients.get_mut(&id) {
            client.enqueue(message);
        }
    }

    /// Notifies a client of a rejected message, at most once a second.
    pub fn refuse(&self, id: u64, refusal: InputRefusal) {
        if let Some(client) = lock(&self.inner).clients.get_mut(&id) {
            client.refuse(refusal);
        }
    }

    /// Starts or stops notifications of these parameters (none: all) for a client.
    pub fn watch(&self, id: u64, names: Vec<String>, watch: bool) {
        if let Some(client) = lock(&self.inner).clients.get_mut(&id)
            && !client.watched.change(names, watch)
        {
            let problem = "parameter names exceed 64 KiB; no parameter is watched";
            client.outbox.control(protocol::status(problem));
        }
    }

    /// Sends changed parameters to the clients that watch them.
    pub fn parameters_changed(&self, values: &[Value]) {
        for client in lock(&self.inner).clients.values_mut() {
            let wanted = values.iter().filter(|of| client.watched.wants(&of.name));
            let wanted: Vec<&Value> = wanted.collect();
            if !wanted.is_empty() {
                let told = protocol::parameter_values(&wanted, None);
                client.outbox.control(told);
                client.wake();
            }
        }
    }

    /// Starts or stops graph updates for a client; the first message is the whole graph.
    pub fn follow_graph(&self, id: u64, follow: bool) {
        let mut inner = lock(&self.inner);
        let Inner { clients, graph, .. } = &mut *inner;
        let followed = clients.values().any(|client| client.follows_graph);
        if let Some(client) = clients.get_mut(&id) {
            if follow && !client.follows_graph {
                if !followed {
                    // The graph was not updated without followers.
                    *graph = ConnectionGraph::default();
                }
                client.outbox.control(graph.whole());
            }
            client.follows_graph = follow;
        }
    }

    /// True if a client follows the graph of nodes.
    pub fn graph_wanted(&self) -> bool {
        let inner = lock(&self.inner);
        inner.clients.values().any(|client| client.follows_graph)
    }

    /// Sends graph changes to its followers.
    pub fn set_graph(&self, graph: ConnectionGraph) {
        let mut inner = lock(&self.inner);
        if let Some(message) = graph.since(&inner.graph) {
            let clients = inner.clients.values_mut();
            for client in clients.filter(|client| client.follows_graph) {
                client.outbox.control(message.clone());
                client.wake();
            }
            inner.graph = graph;
        }
    }

    /// Subscribes a client to a channel.
    pub fn subscribe(&self, id: u64, subscription: u32, channel_id: u32) {
        let mut inner = lock(&self.inner);
        let Inner {
            channels, clients, ..
        } = &mut *inner;
        let Some(Client { outbox, .. }) = clients.get_mut(&id) else {
            return;
        };
        let Some(channel) = channels.get_mut(channel_id as usize) else {
            let problem = format!("there is no channel {channel_id}");
            return outbox.control(protocol::status(&problem));
        };
        if !outbox.subscribe(subscription, channel_id, channel.class) {
            let topic = &channel.advertised.topic;
            let problem = format!("subscription {subscription}, or one to {topic}, exists already");
            return outbox.control(protocol::status(&problem));
        }
        channel.joined += 1;
        if let Some(last) = &channel.last {
            outbox.offer(channel_id, last);
        }
    }
}
