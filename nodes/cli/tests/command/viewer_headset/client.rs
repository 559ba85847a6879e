//! A client of the viewer's socket that subscribes and publishes.

use std::io::ErrorKind;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use async_tungstenite::tungstenite::stream::MaybeTlsStream;
use async_tungstenite::tungstenite::{Error, Message};
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::{RosMessage, cdr};
use serde_json::{Value, json};

use super::scene::Told;
use crate::PATIENCE;
use crate::viewer_writing::{Socket, socket, text};

/// A client that subscribes and publishes.
pub struct Client {
    pub socket: Socket,
    /// Ids of the server's channels by topic.
    pub channels: Value,
    /// Id of the service.
    pub service: Value,
    /// Topics that it publishes on, by id.
    pub mine: Vec<&'static str>,
}

impl Client {
    pub fn connect(url: &str) -> Self {
        let mut socket = socket(url);
        let capabilities = text(&mut socket, "serverInfo")["capabilities"].clone();
        assert_eq!(
            capabilities,
            json!(["services", "clientPublish", "connectionGraph"])
        );
        let all = text(&mut socket, "advertise")["channels"].clone();
        let services = text(&mut socket, "advertiseServices")["services"].clone();
        let name = "/semantic_icp_server/calibrate";
        let mut found = services.as_array().unwrap().iter();
        let service = found.find(|of| of["name"] == name).unwrap()["id"].clone();
        let channels = all.as_array().unwrap().iter();
        let channels =
            channels.map(|of| (of["topic"].as_str().unwrap().to_owned(), of["id"].clone()));
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            let stream: &TcpStream = stream;
            let second = Duration::from_secs(1);
            stream.set_read_timeout(Some(second)).unwrap();
        }
        Self {
            socket,
            channels: Value::Object(channels.collect()),
            service,
            mine: Vec::new(),
        }
    }

    pub fn say(&mut self, message: &Value) {
        let message = Message::Text(message.to_string().into());
        self.socket.send(message).unwrap();
    }

    /// Subscribes with the id of the channel.
    pub fn subscribe(&mut self, topics: &[&str]) {
        let wishes = topics.iter().map(|topic| {
            let id = &self.channels[*topic];
            json!({"id": id, "channelId": id})
        });
        let wishes: Vec<Value> = wishes.collect();
        self.say(&json!({"op": "subscribe", "subscriptions": wishes}));
    }

    /// Publishes, poses in JSON and the others in CDR.
    pub fn publish(&mut self, message: &Told) {
        let is_json = message.topic == "/headset/pose";
        let known = self.mine.iter().position(|topic| *topic == message.topic);
        let id = known.unwrap_or(self.mine.len());
        if known.is_none() {
            self.mine.push(message.topic);
            let encoding = if is_json { "json" } else { "cdr" };
            let channel = json!({"id": id, "topic": message.topic, "encoding": encoding,
                "schemaName": message.type_name});
            self.say(&json!({"op": "advertise", "channels": [channel]}));
        }
        let body = match is_json {
            true => message.json.to_string().into_bytes(),
            false => message.cdr.clone(),
        };
        self.send(id as u32, &body);
    }

    pub fn send(&mut self, channel: u32, body: &[u8]) {
        let bytes = [&[1][..], &channel.to_le_bytes(), body].concat();
        self.socket.send(Message::Binary(bytes.into())).unwrap();
    }

    /// The next message, none if none comes for a second.
    pub fn next(&mut self) -> Option<Message> {
        match self.socket.read() {
            Ok(message) => Some(message),
            Err(Error::Io(error))
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
            {
                None
            }
            Err(error) => panic!("{error}"),
        }
    }

    /// Messages of a topic as they come, until one is what is looked for; `wait` is done each second.
    pub fn until<M: RosMessage, T>(
        &mut self,
        topic: &str,
        mut wait: impl FnMut(&mut Self),
        mut found: impl FnMut(M) -> Option<T>,
    ) -> T {
        let late = Instant::now() + PATIENCE;
        let id = self.channels[topic].as_u64().unwrap() as u32;
        let mut last = Instant::now() - Duration::from_secs(9);
        loop {
            assert!(Instant::now() < late, "nothing came on {topic}");
            if last.elapsed() > Duration::from_secs(1) {
                last = Instant::now();
                wait(self);
            }
            let Some(Message::Binary(bytes)) = self.next() else {
                continue;
            };
            if bytes[0] != 1 || bytes[1..5] != id.to_le_bytes() {
                continue;
            }
            if let Some(found) = found(cdr::from_slice(&bytes[13..]).unwrap()) {
                return found;
            }
        }
    }

    /// Value of a diagnostic of the viewer.
    pub fn until_counted(&mut self, key: &str, value: &str) {
        self.until(
            "/diagnostics",
            |_| (),
            |all: DiagnosticArray| {
                let values = all.status.into_iter().flat_map(|status| status.values);
                let mut values = values.filter(|of| of.key == key);
                values.any(|of| of.value == value).then_some(())
            },
        );
    }
}
