//! A client that stops reading while the map grows: it hurts nobody, and has the whole map at the end.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_tungstenite::tungstenite::client::IntoClientRequest;
use async_tungstenite::tungstenite::{Error, Message, WebSocket, client};
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_msgs::cdr;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Header;
use lattice_runtime::Activity;
use nalgebra::Vector3;
use serde_json::json;

use super::*;
use crate::convert::cloud::{Precision, message_from_points};
use crate::lattice_mapper::{LatticeMapper, MapperOptions};
use crate::map_follower::{Followed, MapFollower};

/// Mapper, server and the steps in which the map grows: the same as a node's, without ROS.
struct Growing {
    mapper: LatticeMapper,
    source: MapSource,
    broadcaster: Arc<Broadcaster>,
    server: Server,
    step: usize,
    sequence: u64,
}

impl Growing {
    fn new() -> Self {
        let lattice = Lattice::new(LatticeKind::Cubic, 0.001).unwrap();
        let mut mapper = LatticeMapper::new(MapperOptions::new(lattice), 7).unwrap();
        let broadcaster = Arc::new(Broadcaster::new(4, Activity::default()));
        broadcaster.channel::<LatticeMap>("/voxel_map", Class::Map, false);
        broadcaster.channel::<LatticeMapUpdate>("/voxel_map_updates", Class::Updates, false);
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let server = Server::start(
            address,
            RequestAuth::default(),
            None,
            Arc::clone(&broadcaster),
        )
        .unwrap();
        let mut source = MapSource::new(2_000_000);
        mapper
            .keyframe()
            .iter()
            .for_each(|chunk| _ = source.on_map(chunk).unwrap());
        Self {
            mapper,
            source,
            broadcaster,
            server,
            step: 0,
            sequence: 0,
        }
    }

    /// A cloud that hits `voxels` cells, of which `fresh` are new.
    fn grow(&mut self, voxels: usize, fresh: usize) {
        let place = |i: usize| {
            let i = i + self.step * fresh;
            [i % 1000, i / 1000 % 1000, i / 1_000_000].map(|k| k as f64 * 0.1)
        };
        let points: Vec<Vector3<f64>> = (0..voxels).map(|i| place(i).into()).collect();
        let header = Header {
            frame_id: "map".to_owned(),
            ..Header::default()
        };
        let cloud = message_from_points(header, &points, Precision::Float32);
        self.mapper.on_cloud(&cloud).unwrap();
        self.step += 1;
        for chunk in self.mapper.take_update() {
            self.sequence = chunk.sequence;
            let _ = self.source.on_update(&chunk).unwrap();
        }
        self.feed();
    }

    /// As the node does at each tick.
    fn feed(&mut self) {
        match self.source.take_change().unwrap() {
            MapChange::Unchanged => {}
            MapChange::Replaced => self.broadcaster.change_map(MapStream::reset),
            MapChange::Updates(updates) => self
                .broadcaster
                .change_map(|stream| updates.into_iter().for_each(|update| stream.push(update))),
        }
        if self.broadcaster.keyframe_wanted()
            && let Some(chunks) = self.source.keyframe().unwrap()
        {
            self.broadcaster
                .change_map(|stream| stream.set_keyframe(chunks));
        }
    }
}

/// A client that follows the map.
struct Client {
    socket: WebSocket<TcpStream>,
    follower: MapFollower,
}

impl Client {
    fn new(growing: &Growing) -> Self {
        let stream = TcpStream::connect(growing.server.address()).unwrap();
        let mut request = format!("ws://{}", growing.server.address())
            .into_client_request()
            .unwrap();
        let protocol = SUBPROTOCOLS[0].parse().unwrap();
        request
            .headers_mut()
            .insert("Sec-WebSocket-Protocol", protocol);
        let (mut socket, _) = client(request, stream).unwrap();
        let wish = json!({ "op": "subscribe", "subscriptions": [{ "id": 0, "channelId": 0 }, { "id": 1, "channelId": 1 }] });
        socket.send(Message::Text(wish.to_string().into())).unwrap();
        let follower = MapFollower::new(2_000_000);
        Self { socket, follower }
    }

    /// Takes messages until it is at the mapper's state; the server may have to be fed meanwhile.
    fn follow(&mut self, growing: &mut Growing) {
        self.wait_briefly();
        while self.follower.sequence() != Some(growing.sequence) {
            match self.socket.read() {
                Ok(Message::Binary(bytes)) => {
                    let cdr = &bytes[13..];
                    let followed = match bytes[1] {
                        0 => self.follower.on_map(&cdr::from_slice(cdr).unwrap()),
                        _ => self.follower.on_update(&cdr::from_slice(cdr).unwrap()),
                    };
                    assert_ne!(followed.unwrap(), Followed::NeedKeyframe);
                }
                Ok(_) => {}
                Err(Error::Io(error)) if is_early(&error) => growing.feed(),
                // Who takes nothing for 20 s is let go, and comes again as the page does.
                Err(_) => {
                    *self = Client::new(growing);
                    self.wait_briefly();
                }
            }
        }
    }

    fn wait_briefly(&self) {
        let timeout = Some(Duration::from_millis(20));
        self.socket.get_ref().set_read_timeout(timeout).unwrap();
    }

    fn keys(&self) -> Vec<u64> {
        let voxels = self.follower.map().unwrap().voxels();
        let mut keys: Vec<u64> = voxels.keys().map(|key| key.raw()).collect();
        keys.sort_unstable();
        keys
    }
}

fn is_early(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

/// By hand, with `LATTICE_PAUSE=1`: 30 s, in which the map grows to 800,000 voxels, and its figures.
#[test]
fn a_client_that_pauses_hurts_nobody_and_has_the_map_in_the_end() {
    let by_hand = std::env::var_os("LATTICE_PAUSE").is_some();
    let (steps, fresh, period_ms) = match by_hand {
        true => (300, 2667, 100),
        // More than the server keeps and the kernel holds for a client.
        false => (150, 500, 0),
    };
    let mut growing = Growing::new();
    let [mut reads, mut pauses] = [(); 2].map(|()| Client::new(&growing));
    growing.feed();
    reads.follow(&mut growing);
    let (mut gap_s, mut most_bytes, mut last) = (0.0_f64, 0, Instant::now());
    let begun = Instant::now();
    for step in 1..=steps {
        growing.grow(20_000, fresh);
        // It gets every state, whatever the other does.
        reads.follow(&mut growing);
        gap_s = gap_s.max(last.elapsed().as_secs_f64());
        last = Instant::now();
        growing
            .broadcaster
            .change_map(|stream| most_bytes = most_bytes.max(stream.kept_bytes()));
        let due = begun + Duration::from_millis(step * period_ms);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    assert!(by_hand || growing.broadcaster.clients() == 2);
    let paused = Instant::now();
    pauses.follow(&mut growing);
    let map = growing.mapper.list().sorted();
    let map: Vec<u64> = map.iter().map(|(key, _)| key.raw()).collect();
    assert!(reads.keys() == map && pauses.keys() == map, "other keys");
    // What it missed is no longer kept: it began again.
    assert!(by_hand || growing.broadcaster.counts().maps_restarted == 1);
    assert!(
        most_bytes < (8 << 20) + 12 * map.len() + 100_000,
        "{most_bytes} bytes"
    );
    if by_hand {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let memory = status.lines().find(|line| line.starts_with("VmHWM"));
        let caught_up_s = paused.elapsed().as_secs_f64();
        let voxels = map.len();
        println!(
            "{voxels} voxels, longest gap {gap_s:.3} s, {most_bytes} bytes kept, caught up in \
             {caught_up_s:.2} s, {memory:?}"
        );
    }
    growing.server.finish();
}
