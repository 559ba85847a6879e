//! URLs of the page, for people.

use std::fmt::Write;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use qrcode::render::unicode::Dense1x2;
use qrcode::{EcLevel, QrCode};

use super::host_addresses::reachable;
use super::http::RequestAuth;
use super::tls::Identity;

/// URLs of the server, for browsers of this machine and others.
pub struct Access {
    /// URL of the page, with its token.
    pub url: String,
    /// URLs at other addresses of this machine.
    pub others: Vec<String>,
    /// True if it contains a secret.
    pub has_token: bool,
    /// SHA-256 of the certificate.
    pub fingerprint: Option<String>,
    /// True if other machines reach it.
    is_open: bool,
    /// URL at the other end of `adb reverse`, which connects to 127.0.0.1.
    usb: Option<String>,
    port: u16,
}

impl Access {
    /// Access to a server at an address.
    pub fn new(address: SocketAddr, auth: &RequestAuth, identity: Option<&Identity>) -> Self {
        let (ip, port) = (address.ip(), address.port());
        let scheme = match identity {
            Some(_) => "https",
            None => "http",
        };
        let query = match &auth.token {
            Some(token) => format!("/?token={token}"),
            None => String::new(),
        };
        let url = |host: IpAddr| format!("{scheme}://{}{query}", SocketAddr::new(host, port));
        let hosts = match (identity, ip.is_unspecified()) {
            (None, true) => vec![Ipv4Addr::LOCALHOST.into()],
            _ => reachable(ip),
        };
        let mut urls = hosts.into_iter().map(url);
        Self {
            url: urls.next().unwrap_or_default(),
            others: urls.collect(),
            has_token: auth.token.is_some(),
            fingerprint: identity.map(|identity| identity.fingerprint.clone()),
            is_open: !ip.is_loopback(),
            usb: (ip.is_unspecified() || ip == Ipv4Addr::LOCALHOST)
                .then(|| format!("{scheme}://localhost:{port}{query}")),
            port,
        }
    }

    /// Lines for a headset or phone: QR code of the URL, other URLs, fingerprint of the certificate. They contain the token, so they are
    /// not for a log. The QR code is for a terminal only.
    pub fn for_headset(&self, is_terminal: bool) -> Option<String> {
        let fingerprint = self.fingerprint.as_ref()?;
        let mut text = String::new();
        if let Some(code) = qr_code(&self.url).filter(|_| is_terminal && self.is_open) {
            text += &code;
        }
        // A string takes all of it.
        if !self.others.is_empty() {
            let _ = writeln!(text, "also at {}", self.others.join(", "));
        }
        let _ = writeln!(
            text,
            "SHA-256 fingerprint of the certificate: {fingerprint}"
        );
        if let (port, Some(usb)) = (self.port, &self.usb) {
            let _ = writeln!(
                text,
                "by USB instead: `adb reverse tcp:{port} tcp:{port}`, then {usb} on the headset"
            );
        }
        Some(text)
    }
}

/// QR code, in black on white whatever the colours of the terminal.
fn qr_code(url: &str) -> Option<String> {
    let code = QrCode::with_error_correction_level(url, EcLevel::L).ok()?;
    let picture = code.render::<Dense1x2>().build();
    let line = |line: &str| format!("\x1b[38;5;16;48;5;231m{line}\x1b[0m\n");
    Some(picture.lines().map(line).collect())
}
