//! A headless Chromium, controlled over its DevTools protocol.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use async_tungstenite::tungstenite::stream::MaybeTlsStream;
use async_tungstenite::tungstenite::{Message, WebSocket, connect};
use serde_json::{Value, json};
use tempfile::TempDir;

const OPTIONS: &str = "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader \
    --enable-unsafe-swiftshader --disable-quic --no-first-run --disable-background-networking \
    --disable-component-update --disable-sync --window-size=1280,800 --remote-debugging-port=0 \
    about:blank";

/// Longest wait for a condition.
const PATIENCE: Duration = Duration::from_secs(120);

/// A page in a browser of its own.
pub struct Page {
    browser: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    next: u64,
    /// Errors and warnings of its console.
    pub console: Vec<String>,
    /// Addresses that it asked for.
    pub requests: Vec<String>,
    _folder: TempDir,
}

impl Page {
    /// Opens an address.
    pub fn open(chromium: &Path, url: &str) -> Self {
        Self::open_with(chromium, url, &[])
    }

    /// The same with more options of the browser.
    pub fn open_with(chromium: &Path, url: &str, options: &[String]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut browser = Command::new(chromium)
            .args(options)
            .args(OPTIONS.split_whitespace())
            .arg(format!("--user-data-dir={}", folder.path().display()))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(browser.stderr.take().unwrap()).lines();
        let address = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|line| Some(line.split_once("ws://")?.1.to_owned()))
            .unwrap();
        // Nobody would read the rest, and a full pipe would stop it.
        std::thread::spawn(move || lines.for_each(drop));
        let (mut socket, _) = connect(format!("ws://{address}")).unwrap();
        let blank = json!({ "url": "about:blank" });
        let target = ask(&mut socket, 1, None, "Target.createTarget", blank);
        let target = target["targetId"].as_str().unwrap();
        let host = address.split('/').next().unwrap();
        let (socket, _) = connect(format!("ws://{host}/devtools/page/{target}")).unwrap();
        let mut page = Self {
            browser,
            socket,
            next: 0,
            console: Vec::new(),
            requests: Vec::new(),
            _folder: folder,
        };
        for domain in ["Runtime", "Log", "Network", "Page"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page.go(url);
        page
    }

    /// The browser's process, whose descendants do the work.
    pub fn process(&self) -> u32 {
        self.browser.id()
    }

    /// Goes to another address.
    pub fn go(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
    }

    /// Value of an expression, whose promise is waited for.
    pub fn value(&mut self, expression: &str) -> Value {
        let arguments =
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let result = self.call("Runtime.evaluate", arguments);
        assert!(
            result.get("exceptionDetails").is_none(),
            "{expression}: {result}"
        );
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true; while it fails, as before the page has loaded, it is not.
    pub fn wait_for(&mut self, expression: &str) {
        let end = Instant::now() + PATIENCE;
        let promise = format!(
            "new Promise((done) => {{ const look = () => {{ let is = false; \
             try {{ is = Boolean({expression}); }} catch {{ }} \
             if (is || look.times-- === 0) done(is); else setTimeout(look, 50); }}; \
             look.times = 40; look(); }})"
        );
        while self.value(&promise) != json!(true) {
            let console = &self.console;
            assert!(
                Instant::now() < end,
                "never true: {expression}; console: {console:?}"
            );
        }
    }

    /// A picture of the page, PNG in base64.
    pub fn picture(&mut self) -> String {
        let result = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        result["data"].as_str().unwrap().to_owned()
    }

    /// Calls a method of the protocol.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.next += 1;
        let (id, mut notes) = (self.next, Vec::new());
        let result = ask(&mut self.socket, id, Some(&mut notes), method, params);
        for note in notes {
            let params = &note["params"];
            match note["method"].as_str().unwrap_or_default() {
                "Runtime.exceptionThrown" | "Runtime.consoleAPICalled" | "Log.entryAdded" => {
                    self.console.push(params.to_string());
                }
                "Network.requestWillBeSent" => {
                    let url = params["request"]["url"].as_str().unwrap_or_default();
                    self.requests.push(url.to_owned());
                }
                _ => {}
            }
        }
        result
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = self.browser.kill();
        let _ = self.browser.wait();
    }
}

/// Sends a call and waits for its answer; what comes before it is noted.
fn ask(
    socket: &mut WebSocket<MaybeTlsStream<TcpStream>>,
    id: u64,
    mut notes: Option<&mut Vec<Value>>,
    method: &str,
    params: Value,
) -> Value {
    let call = json!({ "id": id, "method": method, "params": params });
    socket.send(Message::Text(call.to_string().into())).unwrap();
    loop {
        let Message::Text(text) = socket.read().unwrap() else {
            continue;
        };
        let message: Value = serde_json::from_str(&text).unwrap();
        if message["id"] == json!(id) {
            assert!(message.get("error").is_none(), "{method}: {message}");
            return message["result"].clone();
        }
        if let Some(notes) = &mut notes {
            notes.push(message);
        }
    }
}
