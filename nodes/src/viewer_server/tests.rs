//! The stream of the map with clients of any pace, and the server over sockets.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Arc;

use async_tungstenite::tungstenite::client::IntoClientRequest;
use async_tungstenite::tungstenite::handshake::client::Response;
use async_tungstenite::tungstenite::{Error, Message, WebSocket, client};
use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::std_msgs::Empty;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::Activity;
use proptest::prelude::*;

use super::broadcast::entry;
use super::*;

/// A state of a map: a number that updates raise by one.
fn message(state: u64) -> Entry {
    Entry {
        stamp_ns: state,
        cdr: vec![0; 1000].into(),
        thin: None,
    }
}

#[derive(Clone, Debug)]
enum Step {
    Push,
    Reset,
    Read(usize),
    Keyframe,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        6 => Just(Step::Push),
        1 => Just(Step::Reset),
        4 => (0..3usize).prop_map(Step::Read),
        1 => Just(Step::Keyframe),
    ]
}

/// A client: its place, and the state that it knows.
type Follower = (Cursor, Option<u64>);

/// Reads once; a keyframe gives any state, an update only the one after what is known.
fn read(stream: &mut MapStream, state: u64, (cursor, known): &mut Follower) -> bool {
    match stream.next(cursor) {
        Next::Map(entry) => *known = Some(entry.stamp_ns),
        Next::Update(entry) => {
            assert_eq!(*known, Some(entry.stamp_ns - 1), "an update is missing");
            *known = Some(entry.stamp_ns);
        }
        Next::Waits => stream.set_keyframe(vec![message(state)]),
        Next::Nothing => return false,
    }
    true
}

proptest! {
    #[test]
    fn clients_of_any_pace_miss_nothing_and_end_alike(steps in prop::collection::vec(step(), 0..400)) {
        let mut stream = MapStream::new(20_000);
        let mut state = 0;
        let mut clients: [Follower; 3] = Default::default();
        for step in steps {
            match step {
                Step::Push => {
                    state += 1;
                    stream.push(message(state));
                }
                Step::Reset => {
                    state += 10;
                    stream.reset();
                }
                Step::Keyframe => stream.set_keyframe(vec![message(state)]),
                Step::Read(client) => _ = read(&mut stream, state, &mut clients[client]),
            }
        }
        for client in &mut clients {
            while read(&mut stream, state, client) {}
            prop_assert_eq!(client.1, Some(state));
        }
    }
}

pub(super) fn server(max_clients: usize, auth: RequestAuth) -> (Server, Arc<Broadcaster>) {
    let broadcaster = Arc::new(Broadcaster::new(max_clients, Activity::default()));
    broadcaster.channel::<LatticeMap>("/voxel_map", Class::Map, false);
    broadcaster.channel::<TFMessage>("/tf", Class::Newest { depth: 2 }, false);
    broadcaster.channel::<TFMessage>("/tf_static", Class::Newest { depth: 1 }, true);
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    (
        Server::start(address, auth, None, Arc::clone(&broadcaster)).unwrap(),
        broadcaster,
    )
}

/// The code of the answer to some bytes.
fn answer(server: &Server, request: &[u8]) -> String {
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream.write_all(request).unwrap();
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes);
    let text = String::from_utf8_lossy(&bytes).into_owned();
    text.split(' ').nth(1).unwrap_or_default().to_owned()
}

pub(super) fn connect(
    server: &Server,
    protocol: &str,
) -> Result<(WebSocket<TcpStream>, Response), String> {
    let stream = TcpStream::connect(server.address()).unwrap();
    let mut request = format!("ws://{}", server.address())
        .into_client_request()
        .unwrap();
    let name = "Sec-WebSocket-Protocol";
    request
        .headers_mut()
        .insert(name, protocol.parse().unwrap());
    client(request, stream).map_err(|error| format!("{error:?}"))
}

pub(super) fn text(socket: &mut WebSocket<TcpStream>) -> serde_json::Value {
    loop {
        match socket.read().unwrap() {
            Message::Text(text) => return serde_json::from_str(&text).unwrap(),
            Message::Binary(_) => panic!("a text message was expected"),
            _ => {}
        }
    }
}

pub(super) fn data(socket: &mut WebSocket<TcpStream>) -> (u32, Vec<u8>) {
    loop {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            assert_eq!(bytes[0], 1);
            let id = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
            return (id, bytes[13..].to_vec());
        }
    }
}

#[test]
fn a_client_gets_what_it_subscribes_to_and_late_ones_what_is_kept() {
    let (server, broadcaster) = server(4, RequestAuth::default());
    broadcaster.offer(2, cdr::to_vec(&TFMessage::default()).unwrap());
    let map = LatticeMap {
        voxels_total: 7,
        ..LatticeMap::default()
    };
    for protocol in SUBPROTOCOLS {
        let (mut socket, response) = connect(&server, protocol).unwrap();
        assert_eq!(response.headers()["Sec-WebSocket-Protocol"], protocol);
        assert_eq!(text(&mut socket)["op"], "serverInfo");
        let advertised = text(&mut socket);
        assert_eq!(advertised["channels"][0]["schemaName"], LatticeMap::TYPE);
        let wish =
            r#"{"op":"subscribe","subscriptions":[{"id":5,"channelId":0},{"id":6,"channelId":2}]}"#;
        socket.send(Message::Text(wish.into())).unwrap();
        assert_eq!(data(&mut socket).0, 6, "the fixed transforms are kept");
        broadcaster.change_map(|stream| {
            stream.reset();
            stream.set_keyframe(vec![entry(cdr::to_vec(&map).unwrap())]);
        });
        let (id, bytes) = data(&mut socket);
        assert_eq!(
            (id, cdr::from_slice::<LatticeMap>(&bytes).unwrap()),
            (5, map.clone())
        );
        socket.send(Message::Text("nonsense".into())).unwrap();
        assert_eq!(text(&mut socket)["op"], "status");
        socket.send(Message::Binary(vec![1; 20].into())).unwrap();
        assert_eq!(text(&mut socket)["level"], 1);
        // The next one has to wait for its map, too.
        broadcaster.change_map(MapStream::reset);
    }
    server.finish();
}

#[test]
fn strangers_and_one_client_too_many_are_refused() {
    let auth = RequestAuth {
        token: Some("secret".to_owned()),
        ..RequestAuth::default()
    };
    let (protected, _) = server(1, auth);
    assert_eq!(
        answer(&protected, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        "401"
    );
    let (server, broadcaster) = server(16, RequestAuth::default());
    for (request, code) in [
        ("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "200"),
        ("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", "421"),
        (
            "GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://evil.example\r\n\r\n",
            "403",
        ),
        ("GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n", "404"),
        ("\r\n\r\nnonsense\r\n\r\n", "400"),
    ] {
        assert_eq!(answer(&server, request.as_bytes()), code, "{request}");
    }
    assert_eq!(answer(&server, &[b'a'; 9000]), "400");
    let mut inside: Vec<_> = (0..16)
        .map(|_| connect(&server, SUBPROTOCOLS[0]).unwrap())
        .collect();
    let refused = connect(&server, SUBPROTOCOLS[0]).unwrap_err();
    assert!(refused.contains("503"), "{refused}");
    assert_eq!(
        (broadcaster.clients(), broadcaster.counts().clients_refused),
        (16, 1)
    );
    // A message that is too long ends its connection alone.
    let (socket, _) = &mut inside[0];
    socket
        .send(Message::Text("x".repeat(100_000).into()))
        .unwrap();
    while !matches!(
        socket.read(),
        Err(Error::ConnectionClosed | Error::Protocol(_) | Error::Io(_))
    ) {}
    assert_eq!(text(&mut inside[1].0)["op"], "serverInfo");
    server.finish();
    protected.finish();
}

#[test]
fn a_taken_port_is_one_clear_line() {
    let (server, broadcaster) = server(1, RequestAuth::default());
    let Err(error) = Server::start(server.address(), RequestAuth::default(), None, broadcaster)
    else {
        panic!("two servers on one port");
    };
    let error = error.to_string();
    assert!(
        error.contains(&server.address().to_string()) && error.contains("port"),
        "{error}"
    );
}

#[test]
fn newest_messages_give_way_and_control_is_bounded() {
    let mut outbox = Outbox::default();
    let mut stream = MapStream::new(1000);
    assert!(outbox.subscribe(1, 9, Class::Newest { depth: 2 }));
    assert!(
        !outbox.subscribe(2, 9, Class::Newest { depth: 2 }),
        "one for each channel"
    );
    for state in 0..5 {
        assert!(outbox.offer(9, &message(state)));
    }
    assert!(!outbox.offer(8, &message(0)));
    for state in [3, 4] {
        assert_eq!(
            outbox.next(&mut stream),
            Some(Outgoing::Data(1, message(state)))
        );
    }
    assert_eq!((outbox.next(&mut stream), outbox.dropped()), (None, 3));
    for _ in 0..300 {
        outbox.control(serde_json::to_string(&Empty::default()).unwrap());
    }
    assert_eq!(outbox.next(&mut stream), Some(Outgoing::Close));
}

#[test]
fn messages_to_clients_are_counted_and_those_that_give_way_too() {
    let broadcaster = Broadcaster::new(2, Activity::default());
    let channel = broadcaster.channel::<Empty>("/newest", Class::Newest { depth: 2 }, false);
    let (id, _woken) = broadcaster.enter().unwrap();
    broadcaster.subscribe(id, 1, channel);
    for _ in 0..5 {
        broadcaster.offer(channel, vec![0; 100]);
    }
    // What the server is, what it has, and the last two.
    assert_eq!(std::iter::from_fn(|| broadcaster.next(id)).count(), 4);
    let counts = broadcaster.counts();
    assert_eq!((counts.messages_out, counts.bytes_out), (4, 200));
    assert_eq!(counts.messages_dropped, 3);
    broadcaster.leave(id);
    assert_eq!(broadcaster.counts().messages_dropped, 3);
}

#[test]
fn a_client_that_is_often_refused_silences_no_other() {
    let broadcaster = Broadcaster::new(2, Activity::default());
    let [(noisy, _noisy), (other, _other)] = [(); 2].map(|()| broadcaster.enter().unwrap());
    let told = |id: u64| {
        let waiting = std::iter::from_fn(|| broadcaster.next(id));
        let words =
            |message: &Outgoing| matches!(message, Outgoing::Text(text) if text.contains("status"));
        waiting.filter(words).count()
    };
    for _ in 0..100 {
        broadcaster.refuse(noisy, InputRefusal::Busy);
    }
    broadcaster.refuse(other, InputRefusal::Malformed);
    assert_eq!((told(noisy), told(other)), (1, 1));
    broadcaster.refuse(other, InputRefusal::Malformed);
    assert_eq!(told(other), 0, "a word a second");
}
