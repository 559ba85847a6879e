//! `lattice view --headset`: the page over TLS on the network, in a browser and for foreign peers.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::channel;

use lattice_msgs::rcl_interfaces::Log;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};
use serde_json::json;

use crate::browser::chromium;
use crate::browser::devtools::Page;
use crate::viewer::{COMPLETE, Viewer, keys, map_of, scene, shown};
use crate::viewer_foreign;
use crate::viewer_mixed::{BUTTON, capture, emulate};
use crate::{PATIENCE, refused};

/// A folder for the state of a user, with a map and the parameters of a mapper that continues it.
struct Home {
    folder: tempfile::TempDir,
    domain: LoopbackDomain,
    map: String,
}

impl Home {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let map = map_of(&scene(folder.path(), 5.0), "fcc");
        let dir = folder.path().display();
        let params = format!(
            "/**/lattice_mapper:\n  ros__parameters: {{lattice: fcc, cell_volume_m3: 0.125, map_dir: '{dir}', \
             autosave_file: site.lattice, resume: true}}\n"
        );
        std::fs::copy(&map, folder.path().join("site.lattice")).unwrap();
        std::fs::write(folder.path().join("nodes.yaml"), params).unwrap();
        let domain = LoopbackDomain::take().unwrap();
        Self {
            folder,
            domain,
            map,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn pem(&self) -> PathBuf {
        self.path("lattice/viewer_tls.pem")
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = crate::command(arguments);
        command
            .env("XDG_STATE_HOME", self.folder.path())
            .env("ROS_LOG_DIR", self.path("log"))
            .env("ROS_DOMAIN_ID", self.domain.id().to_string())
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST");
        command
    }

    /// A robot with its page for headsets.
    fn robot(&self) -> Viewer {
        let params = self.path("nodes.yaml").display().to_string();
        Viewer::run(&mut self.command(&["view", &params, "--headset", "--port", "0"]))
    }
}

/// Address and token of a URL.
fn parts(url: &str) -> (SocketAddr, String) {
    let rest = url.strip_prefix("https://").unwrap();
    let (address, token) = rest.split_once("/?token=").unwrap();
    (address.parse().unwrap(), token.to_owned())
}

/// True where the machine has an address that others reach.
fn is_on_a_network(address: IpAddr) -> bool {
    let is = !address.is_loopback();
    if !is {
        let why = "SKIPPED: this machine has no address but loopback\n";
        let _ = std::io::stderr().write_all(why.as_bytes());
    }
    is
}

/// SHA-256 of the public key in base64, by OpenSSL.
fn public_key(pem: &Path) -> String {
    let script = "openssl x509 -in \"$1\" -pubkey -noout | openssl pkey -pubin -outform der | \
        openssl dgst -sha256 -binary | openssl base64 -A";
    let mut command = Command::new("bash");
    command.args(["-euc", script, "-"]).arg(pem);
    String::from_utf8(command.output().unwrap().stdout).unwrap()
}

#[test]
fn the_page_for_headsets_is_secure_has_the_cells_and_the_button() {
    let Some(chromium) = chromium() else { return };
    let home = Home::new();
    let viewer = home.robot();
    let (address, token) = parts(&viewer.url);
    if !is_on_a_network(address.ip()) {
        return;
    }
    let trusted = public_key(&home.pem());
    let option = format!("--ignore-certificate-errors-spki-list={trusted}");
    let mut page = Page::open_with(&chromium, "about:blank", &[option]);
    let node = viewer_foreign::folder().map(PathBuf::from);
    if let Some(node) = &node {
        emulate(&mut page, node, &capture(node, "living_room"));
    }
    page.go(&viewer.url);
    page.wait_for(COMPLETE);
    let state =
        page.value("[isSecureContext, location.protocol, location.search, 'xr' in navigator]");
    assert_eq!(state, json!([true, "https:", "", true]));
    assert_eq!(shown(&mut page), keys(&home.map));
    let is_wss =
        "performance.getEntriesByType('resource').every(({ name }) => name.startsWith('https://'))";
    assert_eq!(page.value(is_wss), json!(true));
    if node.is_some() {
        page.wait_for(&format!("!{BUTTON}.hidden"));
    }
    assert_eq!(page.value("lattice.state.problems"), json!([]));
    assert!(page.console.is_empty(), "{:?}", page.console);
    // A scheme that was left out, and another token.
    page.go(&format!("http://{address}/"));
    page.wait_for("location.protocol === 'https:'");
    page.go(&format!(
        "https://{address}/?token={}",
        "0".repeat(token.len())
    ));
    page.wait_for("document.body.textContent.includes('The token is missing or wrong')");
    // A browser without an exception warns; without the server its port is closed.
    let warned = "document.documentElement.textContent.includes('ERR_CERT_AUTHORITY_INVALID')";
    Page::open(&chromium, &viewer.url).wait_for(warned);
    let url = viewer.url.clone();
    drop(viewer);
    page.go(&url);
    page.wait_for("document.documentElement.textContent.includes('ERR_CONNECTION_REFUSED')");
    // The same page without TLS is not secure there, which is the reason for all this.
    let any = ["view", &home.map, "--address", "0.0.0.0", "--port", "0"];
    let plain = Viewer::run(&mut home.command(&any));
    let (_, local) = plain.url.split_once("127.0.0.1").unwrap();
    page.go(&format!("http://{}{local}", address.ip()));
    page.wait_for(COMPLETE);
    assert_eq!(page.value("isSecureContext"), json!(false));
}

/// Asks for the page with Python's TLS, which trusts the kept certificate alone.
const PEER: &str = "
import hashlib, socket, ssl, sys
pem, host, port, token = sys.argv[1:]
context = ssl.create_default_context(cafile=pem)
def ask(context, name, query, answer):
    with socket.create_connection((host, int(port))) as raw:
        with context.wrap_socket(raw, server_hostname=name) as tls:
            assert tls.version() == 'TLSv1.3' and tls.selected_alpn_protocol() in (None, 'http/1.1'), tls.version()
            tls.sendall(f'GET /{query} HTTP/1.1\\r\\nHost: {host}\\r\\n\\r\\n'.encode())
            said = b''.join(iter(lambda: tls.recv(65536), b''))
            assert said.startswith(f'HTTP/1.1 {answer} '.encode()), said
            return tls.getpeercert(True)
for name in (host, 'localhost', '127.0.0.1'):
    certificate = ask(context, name, f'?token={token}', 303)
ask(context, host, '', 401)
ask(context, host, '?token=wrong', 401)
context.set_alpn_protocols(['h2', 'http/1.1'])
ask(context, host, '', 401)
for refused in (lambda c: setattr(c, 'maximum_version', ssl.TLSVersion.TLSv1_2), lambda c: c.set_alpn_protocols(['h2'])):
    other = ssl.create_default_context(cafile=pem)
    refused(other)
    try:
        ask(other, host, '', 401)
    except ssl.SSLError:
        continue
    raise SystemExit('not refused')
try:
    ask(ssl.create_default_context(), host, '', 401)
except ssl.SSLCertVerificationError:
    pass
print(':'.join(f'{byte:02X}' for byte in hashlib.sha256(certificate).digest()))
";

/// Lines that a process writes, and those of its log until it has this text.
fn lines_until(stream: impl Read, text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    for line in BufReader::new(stream).lines().map_while(Result::ok) {
        let is_last = line.contains(text);
        lines.push(line);
        if is_last {
            return lines;
        }
    }
    panic!("no line with {text}: {lines:?}");
}

#[test]
fn foreign_peers_verify_the_certificate_and_the_token_is_in_no_log() {
    let Some(python) = crate::python() else {
        return;
    };
    let home = Home::new();
    let network = Network {
        domain_id: home.domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let runtime = Runtime::with_transport("peer", RosArgs::default(), &network).unwrap();
    let node = runtime.node("peer").unwrap();
    let (tell, told) = channel();
    let hear = move |line: Arc<Log>| {
        let _ = tell.send(line.msg.clone());
    };
    let logged = node.subscribe("/rosout", Qos::ROSOUT, SubscriptionExecutor::Shared, hear);
    let _logged = logged.unwrap();
    let params = home.path("nodes.yaml").display().to_string();
    let mut command = home.command(&["view", &params, "--headset", "--port", "0"]);
    let mut process = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = lines_until(process.stderr.take().unwrap(), "by USB instead");
    let url = said
        .iter()
        .find_map(|line| line.split_once("the map is at "));
    let (address, token) = parts(url.unwrap().1);
    let pem = home.pem();
    let output = Command::new(&python)
        .args(["-c", PEER])
        .arg(&pem)
        .args([address.ip().to_string(), address.port().to_string()])
        .arg(&token)
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}");
    let fingerprint = String::from_utf8(output.stdout).unwrap();
    let fingerprint = fingerprint.trim();
    let all = said.join("\n");
    assert!(all.contains(fingerprint), "{fingerprint}: {all}");
    let port = address.port();
    let usb = format!(
        "`adb reverse tcp:{port} tcp:{port}`, then https://localhost:{port}/?token={token}"
    );
    assert!(all.contains(&usb), "{all}");
    assert!(!all.contains('█'), "a QR code is for a terminal");
    // The log has the fingerprint, and not the token.
    let mut heard = String::new();
    while !heard.contains(fingerprint) {
        heard += &told.recv_timeout(PATIENCE).unwrap();
    }
    let _ = process.kill();
    let _ = process.wait();
    let mut files = String::new();
    for entry in std::fs::read_dir(home.path("log")).unwrap() {
        files += &std::fs::read_to_string(entry.unwrap().path()).unwrap();
    }
    assert!(files.contains(fingerprint), "{files}");
    heard.extend(told.try_iter());
    assert!(!files.contains(&token) && !heard.contains(&token));
    assert_eq!(pem.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    // After a restart, here with a file, the certificate is the same.
    let kept = std::fs::read(&pem).unwrap();
    let again = Viewer::run(&mut home.command(&["view", &home.map, "--headset", "--port", "0"]));
    assert!(parts(&again.url).0.port() > 0);
    assert_eq!(std::fs::read(&pem).unwrap(), kept);
    let mut plain = TcpStream::connect(parts(&again.url).0).unwrap();
    plain
        .write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .unwrap();
    let mut answer = String::new();
    plain.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 307 ") && answer.contains("HTTPS and wss only"));
}

#[test]
fn a_terminal_has_a_qr_code_of_the_address() {
    let Some(python) = crate::python() else {
        return;
    };
    let home = Home::new();
    let script = "import pty, sys; pty.spawn(sys.argv[1:])";
    let lattice = env!("CARGO_BIN_EXE_lattice");
    let mut terminal = Command::new(&python)
        .args([
            "-c",
            script,
            lattice,
            "view",
            &home.map,
            "--headset",
            "--port",
            "0",
        ])
        .env("XDG_STATE_HOME", home.folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let said = lines_until(terminal.stdout.take().unwrap(), "by USB instead");
    let _ = terminal.kill();
    let _ = terminal.wait();
    let begin = "\u{1b}[38;5;16;48;5;231m";
    let rows: Vec<_> = said
        .iter()
        .filter_map(|line| line.strip_prefix(begin)?.strip_suffix("\u{1b}[0m"))
        .collect();
    let url = said
        .iter()
        .find_map(|line| line.split_once("the map is at "));
    let url = url.unwrap().1.split(',').next().unwrap();
    let (address, _) = parts(url);
    if !is_on_a_network(address.ip()) {
        return;
    }
    let code = home.path("code.txt");
    std::fs::write(&code, rows.join("\n")).unwrap();
    let mut reader = Command::new(python);
    reader
        .args(["-c", include_str!("viewer_qr_code.py")])
        .stdin(std::fs::File::open(code).unwrap());
    let read = reader.output().unwrap();
    let words = String::from_utf8_lossy(&read.stderr);
    assert_eq!(String::from_utf8_lossy(&read.stdout).trim(), url, "{words}");
}

#[test]
fn certificates_that_cannot_be_used_are_refused_by_command_and_node() {
    let home = Home::new();
    let missing = home.path("missing.pem").display().to_string();
    let says = |arguments: &[&str], parts: &[&str]| {
        let output = refused(arguments);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(parts.iter().all(|part| words.contains(part)), "{words}");
    };
    let files = ["--tls-certificate", &missing, "--tls-key", &missing];
    let view = ["view", &home.map, "--port", "0", "--headset"];
    let parts = ["missing.pem", "`tls_certificate`", "PEM"];
    says(&[&view[..], &files].concat(), &parts);
    says(&[&view[..4], &files].concat(), &["--headset"]);
    says(&[&view[..], &files[..2]].concat(), &["--tls-key"]);
    let params = home.path("nodes.yaml").display().to_string();
    let live = ["view", &params, "--port", "0", "--headset"];
    says(&[&live[..], &files].concat(), &parts);
    let certificate = format!("tls_certificate:={missing}");
    let node = ["node", "viewer_server", "--ros-args", "-p", "port:=0"];
    says(
        &[&node[..], &["-p", &certificate]].concat(),
        &["tls", "expected true"],
    );
    let on = ["-p", "tls:=true", "-p", &certificate];
    says(&[&node[..], &on].concat(), &["tls_key", "private key"]);
}
