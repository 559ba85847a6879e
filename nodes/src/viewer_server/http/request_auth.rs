//! Authorization of a request: a file of the page, a WebSocket, or a rejection.

use std::net::IpAddr;

use async_tungstenite::tungstenite::handshake::derive_accept_key;

use super::files;
use super::head::Head;
use crate::viewer_server::protocol::SUBPROTOCOLS;

/// Cookie with the token after it was given in a URL.
const COOKIE: &str = "lattice_token";
/// The same over TLS. Under one name browsers would keep it, and refuse that of a later server without TLS on this host; the prefix makes
/// them take it from HTTPS only.
const SECURE_COOKIE: &str = "__Host-lattice_token";

/// Content security policy: the page loads its own files only.
const POLICY: &str = "default-src 'none'; script-src 'self'; worker-src 'self'; style-src 'self'; \
     connect-src 'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

const UNKNOWN_HOST: &[u8] = b"This host name is not allowed: add it to `allowed_hosts`.\n";

/// Conditions for accepting a request.
#[derive(Clone, Debug, Default)]
pub struct RequestAuth {
    /// Host names of this machine, besides `localhost` and addresses.
    pub hosts: Vec<String>,
    /// Allowed cross-origin pages, such as `https://viewer.example`.
    pub origins: Vec<String>,
    /// Required secret.
    pub token: Option<String>,
    /// True if the page is served over TLS; the server sets it.
    pub secure: bool,
}

/// Response that ends the connection.
#[derive(Debug, PartialEq)]
pub struct Response {
    /// Status code and reason.
    pub status: &'static str,
    /// Media type of the body.
    pub media_type: &'static str,
    /// Further header lines, each with its line end.
    pub headers: String,
    /// Body.
    pub body: &'static [u8],
}

/// Decision on a request.
#[derive(Debug, PartialEq)]
pub enum Decision {
    /// Send a response.
    Answer(Response),
    /// Upgrade to a WebSocket, after sending this head.
    Upgrade(String),
}

impl RequestAuth {
    /// Decides on a request.
    pub fn decide(&self, head: &Head) -> Decision {
        let Some(host) = head.host.as_deref().filter(|host| self.knows(host)) else {
            return refuse("421 Misdirected Request", UNKNOWN_HOST);
        };
        if head.method != "GET" {
            return refuse("405 Method Not Allowed", b"Only GET is supported.\n");
        }
        if let Some(origin) = &head.origin
            && !self.trusts(origin, host)
        {
            let why = b"This origin is not allowed: add it to `allowed_origins`.\n";
            return refuse("403 Forbidden", why);
        }
        if let Some(token) = &self.token {
            let given = head.query("token").or_else(|| head.cookie(self.cookie()));
            if !given.is_some_and(|given| same(given, token)) {
                let why =
                    b"The token is missing or wrong: open the address that the node printed.\n";
                return refuse("401 Unauthorized", why);
            }
            if head.query("token").is_some() && !head.upgrade {
                return self.keep_token(token);
            }
        }
        match (head.upgrade, files::find(&head.path)) {
            (true, _) => upgrade(head),
            (false, Some(file)) => Decision::Answer(Response {
                status: "200 OK",
                media_type: file.media_type,
                headers: format!("Content-Security-Policy: {POLICY}\r\n"),
                body: file.bytes,
            }),
            (false, None) => refuse("404 Not Found", b"There is no such page.\n"),
        }
    }

    fn cookie(&self) -> &'static str {
        match self.secure {
            true => SECURE_COOKIE,
            false => COOKIE,
        }
    }

    /// Stores the token in a cookie, and removes it from the URL.
    fn keep_token(&self, token: &str) -> Decision {
        let only_tls = match self.secure {
            true => "; Secure",
            false => "",
        };
        let cookie = self.cookie();
        Decision::Answer(Response {
            status: "303 See Other",
            media_type: "text/plain; charset=utf-8",
            headers: format!(
                "Location: /\r\nSet-Cookie: {cookie}={token}{only_tls}; HttpOnly; SameSite=Strict; Path=/\r\n"
            ),
            body: b"",
        })
    }

    /// Decides on a request without TLS to a server with TLS. A token in it was sent unencrypted, and is not repeated.
    pub fn decide_without_tls(&self, head: &Head) -> Decision {
        match head.host.as_deref().filter(|host| self.knows(host)) {
            Some(host) => Decision::Answer(Response::to_https(host)),
            None => refuse("421 Misdirected Request", UNKNOWN_HOST),
        }
    }

    /// True for host names of this machine, against DNS rebinding. A foreign name may resolve to this
    /// machine; an address cannot.
    fn knows(&self, host: &str) -> bool {
        let name = host.rsplit_once(':').map_or(host, |(name, port)| {
            match port.bytes().all(|byte| byte.is_ascii_digit()) {
                true => name,
                false => host,
            }
        });
        let address = name.trim_start_matches('[').trim_end_matches(']');
        name.eq_ignore_ascii_case("localhost")
            || address.parse::<IpAddr>().is_ok()
            || self
                .hosts
                .iter()
                .any(|known| known.eq_ignore_ascii_case(name))
    }

    fn trusts(&self, origin: &str, host: &str) -> bool {
        let scheme = match self.secure {
            true => "https://",
            false => "http://",
        };
        let own = origin.strip_prefix(scheme);
        own.is_some_and(|own| own.eq_ignore_ascii_case(host))
            || self.origins.iter().any(|known| known == origin)
    }
}

/// Compares in constant time.
fn same(given: &str, token: &str) -> bool {
    let pairs = given.bytes().zip(token.bytes());
    let differences = pairs.fold(0, |all, (a, b)| all | (a ^ b));
    std::hint::black_box(differences) == 0 && given.len() == token.len()
}

fn refuse(status: &'static str, body: &'static [u8]) -> Decision {
    Decision::Answer(Response {
        status,
        media_type: "text/plain; charset=utf-8",
        headers: String::new(),
        body,
    })
}

fn upgrade(head: &Head) -> Decision {
    let Some(key) = head.key.as_deref().filter(|key| key.len() == 24) else {
        return refuse("400 Bad Request", b"Sec-WebSocket-Key is missing.\n");
    };
    if head.version.as_deref() != Some("13") {
        return refuse(
            "426 Upgrade Required",
            b"Only WebSocket version 13 is supported.\n",
        );
    }
    let offered = |name: &&&str| head.protocols.iter().any(|offered| offered == **name);
    let Some(protocol) = SUBPROTOCOLS.iter().find(offered) else {
        let why = b"Neither foxglove.sdk.v1 nor foxglove.websocket.v1 is among the subprotocols.\n";
        return refuse("400 Bad Request", why);
    };
    Decision::Upgrade(format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Accept: {}\r\nSec-WebSocket-Protocol: {protocol}\r\n\r\n",
        derive_accept_key(key.as_bytes())
    ))
}

impl Response {
    /// Response at the client limit.
    pub fn full() -> Self {
        Self {
            status: "503 Service Unavailable",
            media_type: "text/plain; charset=utf-8",
            headers: "Retry-After: 5\r\n".to_owned(),
            body: b"`max_clients` is reached: close another page, or raise it.\n",
        }
    }

    /// Redirection of a request without TLS, not to be remembered: the next server may have none.
    fn to_https(host: &str) -> Self {
        Self {
            status: "307 Temporary Redirect",
            media_type: "text/plain; charset=utf-8",
            headers: format!("Location: https://{host}/\r\n"),
            body: b"This port serves HTTPS and wss only: open the https address that the node printed.\n",
        }
    }

    /// Response to a malformed request.
    pub fn bad_request() -> Self {
        Self {
            status: "400 Bad Request",
            media_type: "text/plain; charset=utf-8",
            headers: String::new(),
            body: b"Not an HTTP/1.1 request with a head of at most 8 kB.\n",
        }
    }

    /// Serialized response.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = format!(
            "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n\
             Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n\
             Referrer-Policy: no-referrer\r\n{}\r\n",
            self.status,
            self.media_type,
            self.body.len(),
            self.headers
        )
        .into_bytes();
        bytes.extend_from_slice(self.body);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(lines: &str) -> Head {
        let text = format!("{}\r\n\r\n", lines.replace('\n', "\r\n"));
        Head::parse(text.as_bytes()).unwrap().unwrap().0
    }

    fn status(auth: &RequestAuth, lines: &str) -> String {
        match auth.decide(&request(lines)) {
            Decision::Answer(answer) => answer.status.split(' ').next().unwrap().to_owned(),
            Decision::Upgrade(bytes) => bytes.split(' ').nth(1).unwrap().to_owned(),
        }
    }

    const SOCKET: &str = "Upgrade: websocket\nSec-WebSocket-Version: 13\n\
        Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\nSec-WebSocket-Protocol: foxglove.websocket.v1";

    #[test]
    fn files_are_served_to_names_of_this_machine() {
        let auth = RequestAuth {
            hosts: vec!["robot.local".to_owned()],
            ..RequestAuth::default()
        };
        for host in [
            "127.0.0.1:8765",
            "localhost",
            "[::1]:8765",
            "10.0.0.7",
            "Robot.local:80",
        ] {
            assert_eq!(
                status(&auth, &format!("GET / HTTP/1.1\nHost: {host}")),
                "200",
                "{host}"
            );
        }
        for host in ["evil.example:8765", "localhost.evil.example", ""] {
            assert_eq!(
                status(&auth, &format!("GET / HTTP/1.1\nHost: {host}")),
                "421",
                "{host}"
            );
        }
        assert_eq!(status(&auth, "GET / HTTP/1.1"), "421");
        assert_eq!(
            status(&auth, "GET /etc/passwd HTTP/1.1\nHost: localhost"),
            "404"
        );
        assert_eq!(status(&auth, "POST / HTTP/1.1\nHost: localhost"), "405");
    }

    #[test]
    fn a_socket_needs_its_own_origin_or_one_that_is_allowed() {
        let mut auth = RequestAuth::default();
        let ask = |auth: &RequestAuth, origin: &str| {
            let host = "Host: 127.0.0.1:8765";
            status(auth, &format!("GET / HTTP/1.1\n{host}\n{origin}{SOCKET}"))
        };
        assert_eq!(ask(&auth, ""), "101", "no browser");
        assert_eq!(ask(&auth, "Origin: http://127.0.0.1:8765\n"), "101");
        for other in [
            "http://127.0.0.1:80",
            "https://viewer.example",
            "null",
            "http://localhost:8765",
        ] {
            assert_eq!(ask(&auth, &format!("Origin: {other}\n")), "403", "{other}");
        }
        auth.origins.push("https://viewer.example".to_owned());
        assert_eq!(ask(&auth, "Origin: https://viewer.example\n"), "101");
    }

    #[test]
    fn the_accepted_key_is_that_of_the_standard() {
        let head = request(&format!("GET / HTTP/1.1\nHost: localhost\n{SOCKET}"));
        let Decision::Upgrade(bytes) = RequestAuth::default().decide(&head) else {
            panic!("no upgrade");
        };
        // The example of RFC 6455, section 1.3.
        assert!(bytes.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{bytes}");
        assert!(bytes.contains("Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n"));
    }

    #[test]
    fn a_token_comes_by_address_once_and_then_by_cookie() {
        let auth = RequestAuth {
            token: Some("secret".to_owned()),
            ..RequestAuth::default()
        };
        let ask = |lines: &str| status(&auth, &format!("{lines}\nHost: 10.0.0.7"));
        assert_eq!(ask("GET / HTTP/1.1"), "401");
        assert_eq!(ask("GET /?token=secre HTTP/1.1"), "401");
        assert_eq!(ask("GET /?token=secret HTTP/1.1"), "303");
        assert_eq!(ask("GET / HTTP/1.1\nCookie: lattice_token=secret"), "200");
        assert_eq!(ask(&format!("GET / HTTP/1.1\n{SOCKET}")), "401");
        assert_eq!(
            ask(&format!("GET /?token=secret HTTP/1.1\n{SOCKET}")),
            "101"
        );
    }
}
