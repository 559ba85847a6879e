//! Request head: request line and relevant headers.

use thiserror::Error;

/// Limit of head bytes.
pub const MAX_HEAD_BYTES: usize = 8 << 10;
/// Limit of headers.
const MAX_HEADERS: usize = 64;

/// Malformed head, answered with 400.
#[derive(Debug, Error, PartialEq)]
pub enum HeadError {
    /// Not HTTP.
    #[error("not an HTTP request: {0}")]
    Malformed(String),
    /// Longer than [`MAX_HEAD_BYTES`].
    #[error("the head of the request has more than {MAX_HEAD_BYTES} bytes")]
    TooLong,
    /// Duplicate header.
    #[error("duplicate header {0}")]
    Twice(&'static str),
}

/// Request head; bodies are not read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Head {
    /// As sent, such as `GET`.
    pub method: String,
    /// URL path, without the query.
    pub path: String,
    /// Query, without the question mark.
    pub query: String,
    /// `Host`.
    pub host: Option<String>,
    /// `Origin`.
    pub origin: Option<String>,
    /// `Cookie`.
    pub cookie: Option<String>,
    /// True for a WebSocket upgrade.
    pub upgrade: bool,
    /// `Sec-WebSocket-Key`.
    pub key: Option<String>,
    /// `Sec-WebSocket-Version`.
    pub version: Option<String>,
    /// `Sec-WebSocket-Protocol`, all values.
    pub protocols: Vec<String>,
}

impl Head {
    /// Parses a head from the first bytes of a connection; `None` while it is incomplete. Otherwise
    /// the head and its length.
    pub fn parse(bytes: &[u8]) -> Result<Option<(Head, usize)>, HeadError> {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        let status = request
            .parse(bytes)
            .map_err(|error| HeadError::Malformed(error.to_string()))?;
        let httparse::Status::Complete(length) = status else {
            return match bytes.len() > MAX_HEAD_BYTES {
                true => Err(HeadError::TooLong),
                false => Ok(None),
            };
        };
        if length > MAX_HEAD_BYTES {
            return Err(HeadError::TooLong);
        }
        let address = request.path.unwrap_or_default();
        let (path, query) = address.split_once('?').unwrap_or((address, ""));
        let mut head = Head {
            method: request.method.unwrap_or_default().to_owned(),
            path: path.to_owned(),
            query: query.to_owned(),
            ..Head::default()
        };
        for header in request.headers {
            head.take(header)?;
        }
        Ok(Some((head, length)))
    }

    fn take(&mut self, header: &httparse::Header) -> Result<(), HeadError> {
        // Non-UTF-8 values match nothing.
        let value = String::from_utf8_lossy(header.value).trim().to_owned();
        let name = header.name.to_ascii_lowercase();
        let once = |field: &mut Option<String>, name| match field.replace(value.clone()) {
            Some(_) => Err(HeadError::Twice(name)),
            None => Ok(()),
        };
        match name.as_str() {
            "host" => once(&mut self.host, "Host")?,
            "origin" => once(&mut self.origin, "Origin")?,
            "cookie" => once(&mut self.cookie, "Cookie")?,
            "sec-websocket-key" => once(&mut self.key, "Sec-WebSocket-Key")?,
            "sec-websocket-version" => once(&mut self.version, "Sec-WebSocket-Version")?,
            "upgrade" => self.upgrade |= value.eq_ignore_ascii_case("websocket"),
            "sec-websocket-protocol" => {
                let names = value.split(',').map(|name| name.trim().to_owned());
                self.protocols.extend(names);
            }
            _ => {}
        }
        Ok(())
    }

    /// Value of a cookie.
    pub fn cookie(&self, name: &str) -> Option<&str> {
        let pairs = self.cookie.as_deref()?.split(';');
        pairs
            .filter_map(|pair| pair.trim().split_once('='))
            .find_map(|(key, value)| (key == name).then_some(value))
    }

    /// Raw value of a query parameter.
    pub fn query(&self, name: &str) -> Option<&str> {
        let pairs = self.query.split('&');
        pairs
            .filter_map(|pair| pair.split_once('='))
            .find_map(|(key, value)| (key == name).then_some(value))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const UPGRADE: &str = "GET /ws?token=abc&x=1 HTTP/1.1\r\nHost: 127.0.0.1:8765\r\n\
        Origin: http://127.0.0.1:8765\r\nConnection: keep-alive, Upgrade\r\nUpgrade: WebSocket\r\n\
        Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
        Cookie: a=b; lattice_token=abc\r\n\
        Sec-WebSocket-Protocol: foxglove.sdk.v1, foxglove.websocket.v1\r\n\r\n";

    #[test]
    fn an_upgrade_is_read() {
        let (head, length) = Head::parse(UPGRADE.as_bytes()).unwrap().unwrap();
        assert_eq!(length, UPGRADE.len());
        assert_eq!((head.path.as_str(), head.upgrade), ("/ws", true));
        assert_eq!(head.query("token"), Some("abc"));
        assert_eq!(head.cookie("lattice_token"), Some("abc"));
        assert_eq!(head.protocols, ["foxglove.sdk.v1", "foxglove.websocket.v1"]);
        for end in 0..UPGRADE.len() {
            assert_eq!(Head::parse(&UPGRADE.as_bytes()[..end]), Ok(None), "{end}");
        }
    }

    #[test]
    fn long_and_doubled_heads_are_refused() {
        let long = format!("GET / HTTP/1.1\r\nX: {}", "a".repeat(MAX_HEAD_BYTES));
        assert_eq!(Head::parse(long.as_bytes()), Err(HeadError::TooLong));
        let twice = "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n";
        assert_eq!(Head::parse(twice.as_bytes()), Err(HeadError::Twice("Host")));
        assert!(Head::parse(b"\x16\x03\x01\x02\x00").is_err());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(5000))]
        #[test]
        fn mutated_heads_do_not_panic(changes in prop::collection::vec((0..UPGRADE.len(), any::<u8>()), 1..8)) {
            let mut bytes = UPGRADE.as_bytes().to_vec();
            for (at, byte) in changes {
                bytes[at] = byte;
            }
            if let Ok(Some((head, length))) = Head::parse(&bytes) {
                prop_assert!(length <= bytes.len());
                let _ = (head.query("token"), head.cookie("lattice_token"));
            }
        }
    }
}
