//! Forged datagrams cost a process of ours no memory, and honest peers still reach it.
//!
//! The victim is an [`Echo`] with an address space of 1 GiB.

use std::fs;
use std::net::UdpSocket;

use lattice_msgs::cdr;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};
use lattice_runtime::env::TransportKind;
use lattice_test::domain::TestDomain;
use lattice_test::random::Random;

use super::forged::{DATA_FRAG, Forged, Fragments, data_frag, gap, parameter, text, user_data};
use super::{Echo, PATIENCE, Talk, Transport};

/// Growth of the largest resident set during an attack.
const MAX_GROWTH_KB: u64 = 20 << 10;

/// Messages that an honest peer says after each attack.
const MESSAGES: usize = 10;

const FAR: i64 = 1 << 45;

const CYCLONE: [u8; 2] = [0x01, 0x10];
const FAST_DDS: [u8; 2] = [0x01, 0x0f];

const STRINGS: (&str, &str) = ("rt/heard", "std_msgs::msg::dds_::String_");
const REQUESTS: (&str, &str) = (
    "rq/echo/resetRequest",
    "std_srvs::srv::dds_::Trigger_Request_",
);

/// Parameters that name the request of a reply.
const IDENTITY_PARAMETERS: [u16; 2] = [0x83, 0x800f];

/// Sequence numbers between two mutated samples, so that one that is out of place is no obstacle to the next.
const STEP: i64 = 4;

/// A process under attack, and its honest peer.
struct Scene {
    transport: Transport,
    echo: Echo,
    talk: Talk,
    // Free for others only when those above have ended.
    domain: TestDomain,
    said: usize,
    /// Messages besides that came back.
    others: usize,
}

impl Scene {
    fn start(transport: Transport) -> Self {
        let domain = TestDomain::take();
        // Who had the domain before may be ending still.
        let port = 7400 + 250 * domain.id() + 10;
        while UdpSocket::bind(("0.0.0.0", port)).is_err() {
            std::thread::yield_now();
        }
        let echo = Echo::start_within(&domain, transport, 1 << 20);
        // The victim is first in the domain, which gives it its ports.
        let first = Forged::new(&domain, CYCLONE);
        first.announce(STRINGS.0, STRINGS.1);
        let talk = Talk::start(&domain, transport);
        talk.until_echoed("before", PATIENCE);
        let mut scene = Self {
            transport,
            domain,
            echo,
            talk,
            said: 0,
            others: 0,
        };
        scene.is_well();
        scene
    }

    /// Attacks, and checks on memory and the honest peer.
    #[track_caller]
    fn survives(&mut self, what: &str, attack: impl FnOnce(&TestDomain)) {
        let _ = fs::write(self.file("clear_refs"), "5");
        let before = self.memory_kb("VmRSS:");
        attack(&self.domain);
        let answered = self.is_well();
        let growth = self.memory_kb("VmHWM:").saturating_sub(before);
        println!(
            "{what}: {growth} kB more than {before}, {MESSAGES} messages and a call in {answered:?}"
        );
        assert!(growth < MAX_GROWTH_KB, "{what}: {growth} kB more");
    }

    /// An honest peer's messages, each said once, and its call are answered.
    #[track_caller]
    fn is_well(&mut self) -> std::time::Duration {
        let start = std::time::Instant::now();
        for _ in 0..MESSAGES {
            self.said += 1;
            self.others += self.talk.once(&format!("honest {}", self.said), PATIENCE);
        }
        let client = self.talk.node.client::<Trigger>("/echo/reset").unwrap();
        let request = cdr::to_vec(&TriggerRequest::default()).unwrap();
        let answer = smol::block_on(client.call(request, PATIENCE)).unwrap();
        let answer: TriggerResponse = cdr::from_slice(&answer).unwrap();
        assert!(answer.success);
        start.elapsed()
    }

    fn file(&self, name: &str) -> String {
        format!("/proc/{}/{name}", self.echo.0.id())
    }

    fn memory_kb(&self, field: &str) -> u64 {
        let status = fs::read_to_string(self.file("status")).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix(field));
        let kb = line.unwrap().trim().trim_end_matches(" kB");
        kb.parse().unwrap()
    }
}

fn scenes() -> impl Iterator<Item = Scene> {
    TransportKind::BUILT_IN.iter().map(|one| Scene::start(*one))
}

/// A forged participant whose writer the victim knows.
fn known(domain: &TestDomain, vendor: [u8; 2], topic: (&str, &str)) -> Forged {
    let forged = Forged::new(domain, vendor);
    forged.announce(topic.0, topic.1);
    forged
}

#[test]
fn numbers_from_far_away_cost_nothing() {
    for mut scene in scenes() {
        for (topic, name) in [(STRINGS, "messages"), (REQUESTS, "requests")] {
            scene.survives(&format!("HEARTBEAT to 2^45 of {name}"), |domain| {
                let forged = known(domain, FAST_DDS, topic);
                forged.flood((0..1000).map(|_| forged.message(&[forged.heartbeat(1, FAR)])));
            });
            scene.survives(&format!("GAP to 2^45 of {name}"), |domain| {
                let forged = known(domain, FAST_DDS, topic);
                let gaps = (0..1000).map(|i| forged.message(&[gap(2 + 3 * i, FAR + i)]));
                forged.flood(gaps);
            });
        }
    }
}

#[test]
fn fragments_of_samples_that_never_end_cost_nothing() {
    let of = |sample, first, count, fragment_bytes, sample_bytes| Fragments {
        sample,
        first,
        count,
        fragment_bytes,
        sample_bytes,
    };
    for mut scene in scenes() {
        scene.survives("fragments of samples of 1 GiB", |domain| {
            let forged = known(domain, FAST_DDS, STRINGS);
            let fragment = |i: u32| {
                let of = of(
                    1 + i64::from(i),
                    1 + (i * 7919) % 1_000_000,
                    1,
                    1024,
                    1 << 30,
                );
                forged.message(&[data_frag(of, &[], &[7; 1024], true)])
            };
            forged.flood((0..20_000).map(fragment));
            // Of one sample, with holes between.
            let fragment = |i: u32| {
                let of = of(1, 1 + 2 * i, 1, 1024, 1 << 30);
                forged.message(&[data_frag(of, &[], &[7; 1024], true)])
            };
            forged.flood((0..5_000).map(fragment));
        });
        scene.survives("fragments of size 0", |domain| {
            let forged = known(domain, FAST_DDS, STRINGS);
            let cases = [
                (0, 1, 0, 0),
                (1, 0, 0, 0),
                (1, 1, 0, 1),
                (1, 1, 0, 1 << 30),
                (0, 0, 0, u32::MAX),
            ];
            let fragments = (0..10_000).map(|i| {
                let (first, count, fragment_bytes, sample_bytes) = cases[i % cases.len()];
                let of = of(1 + i as i64, first, count, fragment_bytes, sample_bytes);
                forged.message(&[data_frag(of, &[], &[7; 8], i % 2 == 0)])
            });
            forged.flood(fragments);
        });
    }
}

#[test]
#[ignore = "takes a minute, and beside other tests its victim is not found"]
fn a_crowd_of_forged_participants_costs_little() {
    for mut scene in scenes() {
        scene.survives("20000 participants", |domain| {
            let known = Forged::new(domain, CYCLONE).flood_participants(20_000);
            println!("{known} participants were let in");
        });
        // Who comes now is let in all the same.
        let new = Talk::start(&scene.domain, scene.transport);
        new.until_echoed("new", PATIENCE);
    }
}

/// Inline QoS with the identity of a request, more or less.
fn inline_qos(random: &mut Random, little: bool) -> Vec<u8> {
    let mut qos = Vec::new();
    for _ in 0..random.below(3) {
        let id = IDENTITY_PARAMETERS[random.below(2)];
        let value: Vec<u8> = (0..4 * random.below(9))
            .map(|_| random.bits() as u8)
            .collect();
        let length = match random.below(4) {
            0 => random.bits() as u16,
            1 => value.len() as u16 + random.below(9) as u16,
            _ => value.len() as u16,
        };
        qos.extend(parameter(id, length, &value, little));
    }
    if random.below(8) > 0 {
        qos.extend(parameter(1, 0, &[], little));
    }
    qos
}

/// A sample whose submessage is changed in some bytes, cut off or longer than it says.
fn mutated(random: &mut Random, sample: i64, payload: &[u8]) -> Vec<u8> {
    let little = random.below(2) == 0;
    let qos = inline_qos(random, little);
    let mut bytes = match random.below(2) {
        0 => user_data(sample, &qos, payload, little),
        _ => {
            let fragment_bytes = 1 + random.below(payload.len()) as u16;
            let count = payload.len().div_ceil(usize::from(fragment_bytes)) as u16;
            let (first, sample_bytes) = (1, payload.len() as u32);
            let of = Fragments {
                sample,
                first,
                count,
                fragment_bytes,
                sample_bytes,
            };
            data_frag(of, &qos, payload, little)
        }
    };
    // Its identity stays: others are attacks of their own.
    for _ in 0..random.below(4) {
        let place = 1 + random.below(bytes.len() - 1);
        bytes[place] = match random.below(3) {
            0 => random.bits() as u8,
            1 => [0, 1, 0x7f, 0x80, 0xff][random.below(5)],
            _ => bytes[place] ^ 1 << random.below(8),
        };
    }
    match random.below(8) {
        0 => bytes.truncate(4 + random.below(bytes.len() - 4)),
        1 => bytes.extend((0..random.below(64)).map(|i| i as u8)),
        _ => {}
    }
    debug_assert!(bytes[0] <= DATA_FRAG);
    bytes
}

fn mutations(count: usize) {
    let string = [&[0, 1, 0, 0][..], &text("forged")].concat();
    let request = [0, 1, 0, 0, 1, 0, 0, 0];
    for mut scene in scenes() {
        for (topic, name, payload, vendor) in [
            (STRINGS, "messages", &string[..], CYCLONE),
            (REQUESTS, "requests", &request, FAST_DDS),
        ] {
            let mut random = Random(7);
            scene.survives(&format!("{count} mutated {name}"), |domain| {
                let forged = known(domain, vendor, topic);
                let datagrams = (0..count).map(|i| {
                    let sample = 2 + STEP * i as i64;
                    let begin = forged.heartbeat(sample, sample);
                    forged.message(&[begin, mutated(&mut random, sample, payload)])
                });
                forged.flood(datagrams);
            });
        }
        println!("{} of the mutated messages came back", scene.others);
        assert!(scene.others > count / 100);
    }
}

#[test]
fn mutated_samples_of_a_known_writer_change_nothing() {
    mutations(10_000);
}

#[test]
#[ignore = "takes minutes"]
fn a_million_mutated_samples_change_nothing() {
    mutations(1_000_000);
}
