//! A participant made of datagrams alone, which announces one writer and then sends whatever it likes.

use std::collections::BTreeSet;
use std::fs;
use std::net::UdpSocket;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use lattice_test::domain::TestDomain;

use super::PATIENCE;

const SPDP_WRITER: [u8; 4] = [0, 1, 0, 0xc2];
const SPDP_READER: [u8; 4] = [0, 1, 0, 0xc7];
const SEDP_WRITER: [u8; 4] = [0, 0, 3, 0xc2];
const SEDP_READER: [u8; 4] = [0, 0, 3, 0xc7];
const PARTICIPANT: [u8; 4] = [0, 0, 1, 0xc1];
/// The announced writer, whose topic has no key.
const WRITER: [u8; 4] = [0, 0, 1, 3];
const ANY_READER: [u8; 4] = [0; 4];

const HEADER_BYTES: usize = 20;
const ACKNACK: u8 = 0x06;
const HEARTBEAT: u8 = 0x07;
const GAP: u8 = 0x08;
const INFO_DESTINATION: u8 = 0x0e;
const DATA: u8 = 0x15;
pub const DATA_FRAG: u8 = 0x16;

const LITTLE: u8 = 1;
const INLINE_QOS: u8 = 2;
const HAS_DATA: u8 = 4;

/// SPDP, SEDP and the messages of liveliness, both ways.
const BUILTIN_ENDPOINTS: u32 = 0xc3f;

/// Datagrams sent before the victim's socket has to be empty, whose buffer Linux keeps to 200 kB by default.
const BURST: usize = 32;

/// Time after which an announcement is sent again.
const AGAIN: Duration = Duration::from_millis(100);

/// Longest wait for the answer to a new participant, which may be refused.
const ANSWER: Duration = Duration::from_millis(100);

/// Numbers of participants in this process.
static NUMBER: AtomicU32 = AtomicU32::new(1);

pub struct Forged {
    vendor: [u8; 2],
    prefix: [u8; 12],
    socket: UdpSocket,
    metatraffic: u16,
    user: u16,
}

impl Forged {
    /// A participant that the first one in the domain does not know yet.
    pub fn new(domain: &TestDomain, vendor: [u8; 2]) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(AGAIN)).unwrap();
        let metatraffic = 7400 + 250 * domain.id() + 10;
        Self {
            vendor,
            prefix: prefix(vendor, NUMBER.fetch_add(1, Relaxed)),
            socket,
            metatraffic,
            user: metatraffic + 1,
        }
    }

    /// Announces the writer until the victim's reader asks it where it stands.
    pub fn announce(&self, topic: &str, type_name: &str) {
        let start = Instant::now();
        loop {
            self.send_discovery(&self.participant(self.prefix));
            let heartbeat = heartbeat(SEDP_WRITER, 1, 1);
            let list = self.writer(topic, type_name);
            let written = data((SEDP_READER, SEDP_WRITER), 1, &[], &list, true);
            self.send_discovery(&[self.header(), heartbeat, written].concat());
            self.send(&self.message(&[self.heartbeat(1, 1)]));
            let mut answer = [0; 1 << 16];
            while let Ok(length) = self.socket.recv(&mut answer) {
                if asks(&answer[..length], WRITER) {
                    return;
                }
            }
            assert!(start.elapsed() < PATIENCE, "{topic} is not read");
        }
    }

    /// RTPS header and submessages of this participant.
    pub fn message(&self, submessages: &[Vec<u8>]) -> Vec<u8> {
        [self.header(), submessages.concat()].concat()
    }

    pub fn heartbeat(&self, first: i64, last: i64) -> Vec<u8> {
        heartbeat(WRITER, first, last)
    }

    /// Sends to the victim's port for user traffic.
    pub fn send(&self, datagram: &[u8]) {
        self.send_to(datagram, self.user);
    }

    /// Sends all of them, at the pace at which the victim reads.
    pub fn flood(&self, datagrams: impl Iterator<Item = Vec<u8>>) {
        for (number, datagram) in datagrams.enumerate() {
            self.send(&datagram);
            if number.is_multiple_of(BURST) {
                self.drain();
            }
        }
        self.drain();
    }

    /// Announces as many participants besides, at the pace at which the victim answers them; how many it answered.
    pub fn flood_participants(&self, count: u32) -> usize {
        let first = NUMBER.fetch_add(count, Relaxed);
        self.socket.set_read_timeout(Some(ANSWER)).unwrap();
        let mut answered = BTreeSet::new();
        for number in first..first + count {
            let prefix = prefix(self.vendor, number);
            self.send_discovery(&self.participant(prefix));
            if !(number as usize).is_multiple_of(BURST) {
                continue;
            }
            let (start, mut answer) = (Instant::now(), [0; 1 << 16]);
            while !answered.contains(&prefix) && start.elapsed() < ANSWER {
                if let Ok(length) = self.socket.recv(&mut answer) {
                    answered.extend(destination(&answer[..length]));
                }
            }
        }
        answered.len()
    }

    /// Waits until the victim has read all that was sent to its port.
    fn drain(&self) {
        let start = Instant::now();
        while waiting(self.user) != Some(0) {
            assert!(start.elapsed() < PATIENCE, "port {} is not read", self.user);
            std::thread::yield_now();
        }
    }

    fn send_discovery(&self, datagram: &[u8]) {
        self.send_to(datagram, self.metatraffic);
    }

    fn send_to(&self, datagram: &[u8], port: u16) {
        // Linux reports here that nobody is at the port yet.
        let _ = self.socket.send_to(datagram, ("127.0.0.1", port));
    }

    fn header(&self) -> Vec<u8> {
        header(self.vendor, self.prefix)
    }

    fn participant(&self, prefix: [u8; 12]) -> Vec<u8> {
        let port = u32::from(self.socket.local_addr().unwrap().port());
        let mut locator = [0; 24];
        locator[..4].copy_from_slice(&1_u32.to_le_bytes());
        locator[4..8].copy_from_slice(&port.to_le_bytes());
        locator[20..].copy_from_slice(&[127, 0, 0, 1]);
        let lease = [&3600_u32.to_le_bytes()[..], &[0; 4]].concat();
        let list = parameters(&[
            (0x15, &[2, 1, 0, 0]),
            (0x16, &[self.vendor[0], self.vendor[1], 0, 0]),
            (0x50, &[&prefix[..], &PARTICIPANT].concat()),
            (0x58, &BUILTIN_ENDPOINTS.to_le_bytes()),
            (0x31, &locator),
            (0x32, &locator),
            (0x02, &lease),
        ]);
        let written = data((SPDP_READER, SPDP_WRITER), 1, &[], &list, true);
        [header(self.vendor, prefix), written].concat()
    }

    fn writer(&self, topic: &str, type_name: &str) -> Vec<u8> {
        parameters(&[
            (0x5a, &[&self.prefix[..], &WRITER].concat()),
            (0x50, &[&self.prefix[..], &PARTICIPANT].concat()),
            (0x05, &text(topic)),
            (0x07, &text(type_name)),
            // Reliable.
            (0x1a, &[2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]),
        ])
    }
}

/// GUID prefix of the participant of a number.
fn prefix(vendor: [u8; 2], number: u32) -> [u8; 12] {
    let mut prefix = [0x66; 12];
    prefix[..2].copy_from_slice(&vendor);
    prefix[8..].copy_from_slice(&number.to_le_bytes());
    prefix
}

fn header(vendor: [u8; 2], prefix: [u8; 12]) -> Vec<u8> {
    [&b"RTPS\x02\x01"[..], &vendor, &prefix].concat()
}

fn number(value: i64, little: bool) -> Vec<u8> {
    let words = [(value >> 32) as u32, value as u32];
    words.iter().flat_map(|w| word(*w, little)).collect()
}

fn word(value: u32, little: bool) -> [u8; 4] {
    match little {
        true => value.to_le_bytes(),
        false => value.to_be_bytes(),
    }
}

fn half(value: u16, little: bool) -> [u8; 2] {
    match little {
        true => value.to_le_bytes(),
        false => value.to_be_bytes(),
    }
}

fn submessage(id: u8, flags: u8, body: &[u8]) -> Vec<u8> {
    let length = half(body.len() as u16, flags & LITTLE != 0);
    [&[id, flags], &length[..], body].concat()
}

fn heartbeat(writer: [u8; 4], first: i64, last: i64) -> Vec<u8> {
    static COUNT: AtomicU32 = AtomicU32::new(1);
    let count = COUNT.fetch_add(1, Relaxed);
    let numbers = [number(first, true), number(last, true)].concat();
    let body = [&ANY_READER[..], &writer, &numbers, &count.to_le_bytes()].concat();
    submessage(HEARTBEAT, LITTLE, &body)
}

/// Says that the samples from `first` until before `end` are not there.
pub fn gap(first: i64, end: i64) -> Vec<u8> {
    let numbers = [number(first, true), number(end, true)].concat();
    submessage(
        GAP,
        LITTLE,
        &[&ANY_READER[..], &WRITER, &numbers, &[0; 4]].concat(),
    )
}

/// DATA between endpoints; `qos` is a parameter list, or empty.
fn data(
    (reader, writer): ([u8; 4], [u8; 4]),
    sample: i64,
    qos: &[u8],
    payload: &[u8],
    little: bool,
) -> Vec<u8> {
    let fixed = [&[0, 0], &half(16, little)[..], &reader, &writer].concat();
    let body = [&fixed[..], &number(sample, little), qos, payload].concat();
    submessage(DATA, flags(qos, little) | HAS_DATA, &body)
}

/// Fragments of a sample of the announced writer.
#[derive(Clone, Copy)]
pub struct Fragments {
    pub sample: i64,
    pub first: u32,
    pub count: u16,
    pub fragment_bytes: u16,
    pub sample_bytes: u32,
}

pub fn data_frag(of: Fragments, qos: &[u8], payload: &[u8], little: bool) -> Vec<u8> {
    let fixed = [&[0, 0], &half(28, little)[..], &ANY_READER, &WRITER].concat();
    let place = [
        &number(of.sample, little)[..],
        &word(of.first, little),
        &half(of.count, little),
        &half(of.fragment_bytes, little),
        &word(of.sample_bytes, little),
    ];
    let body = [&fixed[..], &place.concat(), qos, payload].concat();
    submessage(DATA_FRAG, flags(qos, little), &body)
}

/// DATA of the announced writer to all readers.
pub fn user_data(sample: i64, qos: &[u8], payload: &[u8], little: bool) -> Vec<u8> {
    data((ANY_READER, WRITER), sample, qos, payload, little)
}

fn flags(qos: &[u8], little: bool) -> u8 {
    let with_qos = if qos.is_empty() { 0 } else { INLINE_QOS };
    with_qos | u8::from(little)
}

/// A parameter of inline QoS, whatever its length is said to be.
pub fn parameter(id: u16, length: u16, value: &[u8], little: bool) -> Vec<u8> {
    [&half(id, little)[..], &half(length, little), value].concat()
}

/// A serialised parameter list.
fn parameters(all: &[(u16, &[u8])]) -> Vec<u8> {
    let mut list = vec![0, 3, 0, 0];
    for (id, value) in all {
        list.extend(parameter(*id, value.len() as u16, value, true));
    }
    list.extend([1, 0, 0, 0]);
    list
}

/// A string in CDR, filled up to words.
pub fn text(text: &str) -> Vec<u8> {
    let length = text.len() as u32 + 1;
    let mut bytes = [&length.to_le_bytes()[..], text.as_bytes(), &[0]].concat();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

/// True if a datagram has an ACKNACK to a writer.
fn asks(datagram: &[u8], writer: [u8; 4]) -> bool {
    submessages(datagram).any(|(id, body)| id == ACKNACK && body.get(4..8) == Some(&writer))
}

/// The participant that a datagram is for.
fn destination(datagram: &[u8]) -> Option<[u8; 12]> {
    let mut to = submessages(datagram).filter(|(id, _)| *id == INFO_DESTINATION);
    to.find_map(|(_, body)| body.first_chunk().copied())
}

/// Kinds of the submessages of a datagram, and their bodies with all that follows.
fn submessages(datagram: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = datagram.get(HEADER_BYTES..).unwrap_or_default();
    std::iter::from_fn(move || {
        let [id, flags, a, b, body @ ..] = rest else {
            return None;
        };
        let length = match flags & LITTLE {
            0 => u16::from_be_bytes([*a, *b]),
            _ => u16::from_le_bytes([*a, *b]),
        };
        rest = body.get(usize::from(length)..).unwrap_or_default();
        Some((*id, body))
    })
}

/// Bytes that wait in the socket on a port of the loopback interface. None: the kernel's table, which changes while it
/// is read, does not have it.
fn waiting(port: u16) -> Option<u64> {
    let table = fs::read_to_string("/proc/net/udp").unwrap();
    let end = format!(":{port:04X}");
    let line = table.lines().find_map(|line| {
        let fields: Vec<_> = line.split_whitespace().collect();
        fields.get(1)?.ends_with(&end).then_some(fields)
    });
    let (_, received) = line?[4].split_once(':')?;
    u64::from_str_radix(received, 16).ok()
}
