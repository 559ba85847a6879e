//! The server over TLS: its clients, plain connections, and handshakes that lead nowhere.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_tungstenite::tungstenite::client::IntoClientRequest;
use async_tungstenite::tungstenite::{Message, WebSocket, client};
use lattice_msgs::lattice::LatticeMap;
use lattice_runtime::Activity;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned, crypto};

use super::hostile_tests::until;
use super::*;

type Secure = StreamOwned<ClientConnection, TcpStream>;

/// A server with a self-made certificate and the token `secret`, and what a client trusts.
struct Setup {
    server: Server,
    broadcaster: Arc<Broadcaster>,
    trust: Arc<ClientConfig>,
}

impl Setup {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let place = || Ok(folder.path().to_owned());
        let identity = Tls::SelfMade.identity(place, &[Ipv4Addr::LOCALHOST.into()]);
        let identity = identity.unwrap().unwrap();
        let file = folder.path().join("viewer_tls.pem");
        let mut roots = RootCertStore::empty();
        roots
            .add(CertificateDer::from_pem_file(file).unwrap())
            .unwrap();
        let provider = Arc::new(crypto::ring::default_provider());
        let trust = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_root_certificates(roots)
            .with_no_client_auth();
        let broadcaster = Arc::new(Broadcaster::new(16, Activity::default()));
        broadcaster.channel::<LatticeMap>("/voxel_map", Class::Newest { depth: 2 }, true);
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let auth = RequestAuth {
            token: Some("secret".to_owned()),
            ..RequestAuth::default()
        };
        let config = Some(identity.config);
        let server = Server::start(address, auth, config, Arc::clone(&broadcaster)).unwrap();
        Self {
            server,
            broadcaster,
            trust: Arc::new(trust),
        }
    }

    fn session(&self) -> ClientConnection {
        let name = ServerName::IpAddress(Ipv4Addr::LOCALHOST.into());
        ClientConnection::new(Arc::clone(&self.trust), name).unwrap()
    }

    fn connect(&self) -> Secure {
        let stream = TcpStream::connect(self.server.address()).unwrap();
        StreamOwned::new(self.session(), stream)
    }

    fn socket(&self, query: &str) -> Result<WebSocket<Secure>, String> {
        let url = format!("wss://{}/{query}", self.server.address());
        let mut request = url.into_client_request().unwrap();
        let headers = request.headers_mut();
        let protocol = SUBPROTOCOLS[0].parse().unwrap();
        headers.insert("Sec-WebSocket-Protocol", protocol);
        let origin = format!("https://{}", self.server.address());
        headers.insert("Origin", origin.parse().unwrap());
        let done = client(request, self.connect());
        done.map(|(socket, _)| socket)
            .map_err(|error| format!("{error:?}"))
    }

    /// Bytes that begin a handshake.
    fn hello(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.session().write_tls(&mut bytes).unwrap();
        bytes
    }
}

/// Response to a request over any stream.
fn answer(mut stream: impl Read + Write, request: &str) -> String {
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = Vec::new();
    // The end of a stream without a closing alert is an error.
    let _ = stream.read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn the_page_and_the_socket_are_served_over_tls_to_those_with_the_token() {
    let setup = Setup::new();
    let ask = |lines: &str| {
        let request = format!("GET {lines}\r\nHost: 127.0.0.1\r\n\r\n");
        answer(setup.connect(), &request)
    };
    for (lines, code) in [
        ("/ HTTP/1.1", "401"),
        ("/?token=wrong HTTP/1.1", "401"),
        ("/?token=secret HTTP/1.1", "303"),
        ("/ HTTP/1.1\r\nCookie: lattice_token=secret", "401"),
        ("/ HTTP/1.1\r\nCookie: __Host-lattice_token=secret", "200"),
        ("/?token=secret HTTP/1.1\r\nOrigin: http://127.0.0.1", "403"),
    ] {
        let answer = ask(lines);
        assert!(answer.contains(&format!("HTTP/1.1 {code}")), "{answer}");
    }
    let kept = ask("/?token=secret HTTP/1.1");
    assert!(
        kept.contains("__Host-lattice_token=secret; Secure; HttpOnly; SameSite=Strict; Path=/")
    );
    let page = ask("/main.js HTTP/1.1\r\nCookie: __Host-lattice_token=secret");
    assert!(page.ends_with(include_str!("../../web/main.js")));
    let refused = setup.socket("").unwrap_err();
    assert!(refused.contains("401"), "{refused}");
    let mut socket = setup.socket("?token=secret").unwrap();
    let wish = r#"{"op":"subscribe","subscriptions":[{"id":6,"channelId":0}]}"#;
    socket.send(Message::Text(wish.into())).unwrap();
    until(|| setup.broadcaster.demand(0).joined > 0);
    // Longer than the buffers of both ends.
    let long: Vec<u8> = (0..4_u32 << 20).map(|at| (at % 251) as u8).collect();
    setup.broadcaster.offer(0, long.clone());
    let bytes = loop {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            break bytes;
        }
    };
    assert!(bytes[13..] == long[..]);
    let counts = setup.broadcaster.counts();
    assert_eq!((counts.tls_failed, counts.tls_plain), (0, 0));
    setup.server.finish();
}

#[test]
fn plain_connections_to_a_server_with_tls_are_sent_to_https() {
    let setup = Setup::new();
    let ask = |request: &str| {
        let stream = TcpStream::connect(setup.server.address()).unwrap();
        answer(stream, request)
    };
    let sent = ask("GET /?token=secret HTTP/1.1\r\nHost: 10.0.0.7:8765\r\n\r\n");
    assert!(sent.starts_with("HTTP/1.1 307 "), "{sent}");
    assert!(sent.contains("\r\nLocation: https://10.0.0.7:8765/\r\n"));
    assert!(sent.contains("HTTPS and wss only") && !sent.contains("secret"));
    let evil = ask("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n");
    assert!(evil.starts_with("HTTP/1.1 421 "), "{evil}");
    let socket = "GET /?token=secret HTTP/1.1\r\nHost: 10.0.0.7\r\nUpgrade: websocket\r\n\
        Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
        Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n";
    assert!(ask(socket).starts_with("HTTP/1.1 307 "));
    assert!(ask("\0nonsense\r\n\r\n").starts_with("HTTP/1.1 400 "));
    assert_eq!(setup.broadcaster.clients(), 0);
    assert_eq!(setup.broadcaster.counts().tls_plain, 4);
    setup.server.finish();
}

#[test]
fn damaged_and_stalled_handshakes_keep_nobody_out() {
    let setup = Setup::new();
    let mut inside: Vec<_> = (0..4)
        .map(|_| setup.socket("?token=secret").unwrap())
        .collect();
    let (hello, begin) = (setup.hello(), Instant::now());
    let open = |bytes: &[u8]| {
        let mut stream = TcpStream::connect(setup.server.address()).unwrap();
        // It may have been displaced already.
        let _ = stream.write_all(bytes);
        stream
    };
    let mut crowd = Vec::new();
    for at in 0..200 {
        let mut bytes = hello.clone();
        match at % 4 {
            // Cut off, so that the rest is waited for.
            0 => bytes.truncate(1 + at * (hello.len() - 1) / 200),
            // Whole, and never continued.
            1 => {}
            // A longer record than there are.
            2 => bytes[3..5].copy_from_slice(&[0xff, 0xff]),
            _ => {
                for byte in bytes.iter_mut().skip(5 + at % 7).step_by(3) {
                    *byte ^= at as u8 | 1;
                }
            }
        }
        crowd.push(open(&bytes));
    }
    // Those with the token come in meanwhile, and those inside are served.
    let later: Vec<_> = (0..8)
        .map(|_| setup.socket("?token=secret").unwrap())
        .collect();
    for socket in inside
        .iter_mut()
        .chain(&mut later.into_iter().collect::<Vec<_>>())
    {
        assert!(
            matches!(socket.read().unwrap(), Message::Text(text) if text.contains("serverInfo"))
        );
    }
    assert!(begin.elapsed() < Duration::from_secs(30));
    // Each is displaced by a later one, refused, or ends after 5 s.
    until(|| {
        let counts = setup.broadcaster.counts();
        counts.tls_failed + counts.connections_displaced >= 200
    });
    // Those that come last are displaced by nobody but the clients.
    let counts = setup.broadcaster.counts();
    assert!(counts.tls_failed >= 8, "{counts:?}");
    drop(crowd);
    setup.server.finish();
}

#[test]
fn a_handshake_that_drips_ends_in_time() {
    let setup = Setup::new();
    let hello = setup.hello();
    let mut stream = TcpStream::connect(setup.server.address()).unwrap();
    let begin = Instant::now();
    let mut bytes = hello.iter();
    // A byte each 50 ms would take longer than the server waits.
    while setup.broadcaster.counts().tls_failed == 0 {
        let byte = *bytes.next().unwrap();
        if stream.write_all(&[byte]).is_err() {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    until(|| setup.broadcaster.counts().tls_failed == 1);
    assert!(begin.elapsed() < Duration::from_secs(20));
    setup.server.finish();
}
