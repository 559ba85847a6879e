//! The server under clients and connections that mean it no good, beside one that means it well.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use async_tungstenite::tungstenite::client::IntoClientRequest;
use async_tungstenite::tungstenite::{Message, WebSocket, client};
use rustix::net::sockopt::set_socket_recv_buffer_size;

use super::server::connection_limit::{MAX_CONNECTIONS, MAX_PER_ADDRESS};
use super::server::stream::STALL_TIME;
use super::tests::{connect, data, server, text};
use super::*;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

/// Most that the buffers of both kernels hold, and more than the server may take unanswered.
const MOST_BYTES: usize = 64 << 20;

const WISH: &str = r#"{"op":"subscribe","subscriptions":[{"id":6,"channelId":1}]}"#;

/// A client that is let in and has subscribed to `/tf`.
fn subscribed(server: &Server, broadcaster: &Broadcaster) -> WebSocket<TcpStream> {
    let before = broadcaster.demand(1).joined;
    let (mut socket, _) = connect(server, SUBPROTOCOLS[0]).unwrap();
    assert_eq!(text(&mut socket)["op"], "serverInfo");
    assert_eq!(text(&mut socket)["op"], "advertise");
    socket.send(Message::Text(WISH.into())).unwrap();
    until(|| broadcaster.demand(1).joined > before);
    socket
}

pub(super) fn until(mut met: impl FnMut() -> bool) {
    let late = Instant::now() + PATIENCE;
    while !met() {
        assert!(Instant::now() < late);
        std::thread::yield_now();
    }
}

/// A frame of a client, masked with zeros.
fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
    let length = u8::try_from(payload.len()).unwrap();
    assert!(length < 126);
    [&[first, 0x80 | length, 0, 0, 0, 0], payload].concat()
}

/// Writes the same without end and reads nothing, until the server closes; gives the bytes that it took.
fn flood(socket: &WebSocket<TcpStream>, frames: &[u8]) -> usize {
    let mut stream = socket.get_ref();
    stream
        .set_write_timeout(Some(Duration::from_secs(1)))
        .unwrap();
    let (late, mut taken) = (Instant::now() + PATIENCE, 0);
    loop {
        assert!(Instant::now() < late, "{taken} bytes and not closed");
        assert!(taken < MOST_BYTES, "bytes without end are taken");
        // A part of a frame that is left out makes the next one another, which is as hostile.
        match stream.write(frames) {
            Ok(bytes) => taken += bytes,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => return taken,
        }
    }
}

#[test]
fn a_client_that_pings_and_reads_nothing_is_closed() {
    let (server, broadcaster) = server(4, RequestAuth::default());
    let mut good = subscribed(&server, &broadcaster);
    let hostile = subscribed(&server, &broadcaster);
    // 1 MB at a time.
    let pings = frame(0x89, &[7; 125]).repeat(8000);
    let taken = flood(&hostile, &pings);
    assert!(taken > pings.len());
    until(|| broadcaster.clients() == 1);
    assert_eq!(broadcaster.counts().clients_stalled, 1);
    broadcaster.offer(1, vec![5; 100]);
    assert_eq!(data(&mut good).1, [5; 100]);
    server.finish();
}

#[test]
fn a_client_that_asks_and_reads_nothing_is_closed() {
    let (server, broadcaster) = server(4, RequestAuth::default());
    let hostile = subscribed(&server, &broadcaster);
    // Each is answered by its problem.
    flood(&hostile, &frame(0x81, b"{}").repeat(8000));
    until(|| broadcaster.clients() == 0);
    assert_eq!(broadcaster.counts().clients_stalled, 1);
    server.finish();
}

#[test]
fn pings_of_a_client_that_reads_are_all_answered() {
    let (server, broadcaster) = server(4, RequestAuth::default());
    let mut socket = subscribed(&server, &broadcaster);
    let writer = socket.get_ref().try_clone().unwrap();
    const PINGS: u32 = 100_000;
    let answered = std::thread::scope(|scope| {
        scope.spawn(|| {
            for number in 0..PINGS {
                let ping = frame(0x89, &number.to_le_bytes());
                (&writer).write_all(&ping).unwrap();
            }
        });
        let pongs = std::iter::from_fn(|| match socket.read().unwrap() {
            Message::Pong(bytes) => Some(u32::from_le_bytes(bytes[..].try_into().unwrap())),
            other => panic!("{other}"),
        });
        pongs
            .take(PINGS as usize)
            .enumerate()
            .all(|(i, n)| i == n as usize)
    });
    assert!(answered);
    assert_eq!(
        (broadcaster.clients(), broadcaster.counts().clients_stalled),
        (1, 0)
    );
    server.finish();
}

#[test]
fn frames_without_content_hold_nobody_up() {
    let (server, broadcaster) = server(4, RequestAuth::default());
    let mut good = subscribed(&server, &broadcaster);
    let hostile = subscribed(&server, &broadcaster);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut stream = hostile.get_ref();
            stream.write_all(&frame(0x01, b"")).unwrap();
            let fragments = frame(0x00, b"").repeat(100_000);
            while !done.load(Relaxed) {
                stream.write_all(&fragments).unwrap();
            }
        });
        for number in 0..100 {
            broadcaster.offer(1, vec![number; 10]);
            assert_eq!(data(&mut good).1, [number; 10]);
        }
        done.store(true, Relaxed);
    });
    server.finish();
}

#[test]
fn half_a_frame_and_one_of_any_length_hold_nobody_up() {
    let (server, broadcaster) = server(4, RequestAuth::default());
    let mut good = subscribed(&server, &broadcaster);
    let mut half = subscribed(&server, &broadcaster);
    // 60,000 bytes are said, and 3 come.
    let begin = [0x82, 0xfe, 0xea, 0x60, 0, 0, 0, 0, 1, 2, 3];
    half.get_ref().write_all(&begin).unwrap();
    let huge = subscribed(&server, &broadcaster);
    let mut head = vec![0x82, 0xff];
    head.extend(u64::MAX.to_be_bytes());
    head[2] = 0x7f;
    head.extend([0; 4]);
    huge.get_ref().write_all(&head).unwrap();
    until(|| broadcaster.clients() == 2);
    broadcaster.offer(1, vec![3; 10]);
    for socket in [&mut good, &mut half] {
        assert_eq!(
            data(socket).1,
            [3; 10],
            "what it has begun is its own matter"
        );
    }
    assert_eq!(broadcaster.counts().clients_stalled, 0);
    server.finish();
}

/// Reads no faster than a slow line, at the pace of 100 ms.
struct Slow(TcpStream);

impl Read for Slow {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        std::thread::sleep(Duration::from_millis(100));
        let most = bytes.len().min(16 << 10);
        self.0.read(&mut bytes[..most])
    }
}

impl Write for Slow {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

#[test]
fn a_slow_client_that_reads_gets_all_of_a_long_message() {
    let (server, broadcaster) = server(4, RequestAuth::default());
    let stream = TcpStream::connect(server.address()).unwrap();
    // Small, so that the server sees how slow it is.
    set_socket_recv_buffer_size(&stream, 16 << 10).unwrap();
    let mut request = format!("ws://{}", server.address())
        .into_client_request()
        .unwrap();
    let protocol = SUBPROTOCOLS[0].parse().unwrap();
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    let (mut socket, _) = client(request, Slow(stream)).unwrap();
    socket.send(Message::Text(WISH.into())).unwrap();
    until(|| broadcaster.demand(1).joined > 0);
    let begin = Instant::now();
    broadcaster.offer(1, vec![9; 6 << 20]);
    let whole = loop {
        match socket.read().unwrap() {
            Message::Binary(bytes) => break bytes.len(),
            _ => continue,
        }
    };
    assert_eq!(whole, (6 << 20) + 13);
    assert!(begin.elapsed() > STALL_TIME, "too fast for this test");
    assert_eq!(
        (broadcaster.clients(), broadcaster.counts().clients_stalled),
        (1, 0)
    );
    server.finish();
}

/// Connections that say no more than this.
fn half_open(server: &Server, count: usize, said: &[u8]) -> Vec<TcpStream> {
    let connection = |_| {
        let mut stream = TcpStream::connect(server.address()).unwrap();
        // It may have been displaced already.
        let _ = stream.write_all(said);
        stream
    };
    (0..count).map(connection).collect()
}

#[test]
fn half_open_connections_keep_nobody_out() {
    let auth = || RequestAuth {
        token: Some("secret".to_owned()),
        ..RequestAuth::default()
    };
    let page = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
    // Half a request, nothing, another protocol, a request without the token.
    for said in [&b"GET / HT"[..], b"", b"\x16\x03\x01\x02\x00", page] {
        let (server, broadcaster) = server(16, auth());
        let _crowd = half_open(&server, 200, said);
        // All that there is place for.
        let inside: Vec<_> = (0..16).map(|_| with_token(server.address())).collect();
        assert_eq!(broadcaster.clients(), 16);
        let _more = half_open(&server, 200, said);
        for mut socket in inside {
            assert_eq!(text(&mut socket)["op"], "serverInfo");
        }
        let counts = broadcaster.counts();
        assert_eq!(counts.clients_refused, 0);
        let waits = said.len() < 10 && said.first() != Some(&0x16);
        if waits {
            // All are from one address; the connections of clients have displaced one each.
            let most = 416 - MAX_PER_ADDRESS as u64;
            assert!(
                (1..=most).contains(&counts.connections_displaced),
                "{counts:?}"
            );
            until(|| {
                broadcaster.counts().connections_displaced >= 400 - 2 * MAX_CONNECTIONS as u64
            });
        }
        server.finish();
    }
}

#[test]
fn connections_that_come_again_and_again_keep_nobody_out() {
    let auth = RequestAuth {
        token: Some("secret".to_owned()),
        ..RequestAuth::default()
    };
    let (server, broadcaster) = server(16, auth);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Relaxed) {
                drop(half_open(&server, 100, b"GET / HT"));
            }
        });
        until(|| broadcaster.counts().connections_displaced > 100);
        let in_time = (0..50).filter(|_| try_with_token(server.address()).is_ok());
        let in_time = in_time.count();
        done.store(true, Relaxed);
        assert!(in_time >= 45, "{in_time} of 50 at the first try");
    });
    server.finish();
}

fn try_with_token(address: SocketAddr) -> Result<WebSocket<TcpStream>, String> {
    let stream = TcpStream::connect(address).unwrap();
    let mut request = format!("ws://{address}/?token=secret")
        .into_client_request()
        .unwrap();
    let protocol = SUBPROTOCOLS[0].parse().unwrap();
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    let done = client(request, stream).map_err(|error| format!("{error:?}"));
    done.map(|(socket, _)| socket)
}

fn with_token(address: SocketAddr) -> WebSocket<TcpStream> {
    try_with_token(address).unwrap()
}

#[test]
fn answers_that_nobody_takes_are_bounded_in_bytes() {
    let mut outbox = Outbox::default();
    let mut stream = MapStream::new(1000);
    // One of any length goes.
    outbox.control("x".repeat(20 << 20));
    let sent = outbox.next(&mut stream);
    assert!(matches!(sent, Some(Outgoing::Text(text)) if text.len() == 20 << 20));
    for _ in 0..9 {
        outbox.control("x".repeat(1 << 20));
    }
    assert_eq!(outbox.next(&mut stream), Some(Outgoing::Close));
}
