//! The two ends: they print what they have sent and received, once their input is closed.

use std::collections::BTreeMap;
use std::io::{Read, stdin};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use lattice_msgs::cdr;
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Publisher, RawPublisher, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::domain::localhost_only;

use super::{DOMAIN, PATIENCE, TOPICS};

/// Between two messages of a topic.
pub const PERIOD: Duration = Duration::from_millis(10);

/// Depth of the publishers: half a second.
const DEPTH: usize = 50;

/// Time without a message after which none is on the way.
const QUIET: Duration = Duration::from_secs(1);

/// Characters of the numbered message: every tenth has many datagrams.
fn length(number: u64) -> usize {
    if number.is_multiple_of(10) {
        60_000
    } else {
        200
    }
}

pub fn node() -> Option<(Runtime, Node)> {
    let id = std::env::var(DOMAIN).ok()?;
    let network = Network {
        domain_id: id.parse().unwrap(),
        localhost_only: localhost_only(),
        ..Network::from_env().unwrap()
    };
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport("end", args, &network).unwrap();
    let node = runtime.node("end").unwrap();
    Some((runtime, node))
}

/// True once the test that has started this process closes its input.
pub fn input_ends() -> Receiver<()> {
    let (tell, ended) = channel();
    thread::spawn(move || {
        let _ = stdin().read_to_end(&mut Vec::new());
        drop(tell);
    });
    ended
}

enum Sender {
    Node(Publisher<RosString>),
    Player(RawPublisher),
}

/// Both kinds of publisher alike.
macro_rules! each {
    ($of:expr, $publisher:ident => $expression:expr) => {
        match $of {
            Sender::Node($publisher) => $expression,
            Sender::Player($publisher) => $expression,
        }
    };
}

#[test]
#[ignore = "the sending end of the tests here, not one itself"]
fn sends() {
    let Some((_runtime, node)) = node() else {
        return;
    };
    let of_node = |topic, qos| Sender::Node(node.publisher(topic, qos).unwrap());
    let player = node.raw_publisher(TOPICS[2], "std_msgs/msg/String", None, Qos::reliable(DEPTH));
    let senders = [
        of_node(TOPICS[0], Qos::reliable(DEPTH)),
        of_node(TOPICS[1], Qos::best_effort(DEPTH)),
        Sender::Player(player.unwrap()),
    ];
    let has_reader = |of: &Sender| each!(of, publisher => publisher.subscriber_count() > 0);
    let ended = input_ends();
    while !senders.iter().all(has_reader) {
        thread::sleep(PERIOD);
    }
    let mut given = [0_u64; 3];
    let mut due = Instant::now();
    while ended.try_recv() != Err(TryRecvError::Disconnected) {
        for (sender, number) in senders.iter().zip(&mut given) {
            // To nobody nothing is sent.
            if !has_reader(sender) {
                continue;
            }
            let data = format!("{:<1$}", *number, length(*number));
            *number += 1;
            match sender {
                Sender::Node(publisher) => publisher.publish(RosString { data }).unwrap(),
                Sender::Player(publisher) => {
                    let bytes = cdr::to_vec(&RosString { data }).unwrap();
                    publisher.publish_within(bytes, PATIENCE).unwrap();
                }
            }
        }
        due += PERIOD;
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    for ((topic, sender), given) in TOPICS.iter().zip(&senders).zip(given) {
        let (sent, dropped, unacknowledged) = each!(sender, publisher => {
            assert!(publisher.flush(PATIENCE), "{topic}");
            (publisher.sent(), publisher.dropped(), match sender {
                Sender::Player(player) => player.unacknowledged(),
                Sender::Node(_) => 0,
            })
        });
        println!("SENT {topic} {given} {sent} {dropped} {unacknowledged}");
    }
}

/// Numbers of a topic as they come.
#[derive(Debug, Default)]
struct Numbers {
    first: Option<u64>,
    last: u64,
    received: u64,
}

fn hear(node: &Node, topic: &str, qos: Qos) -> (Subscription, Arc<Mutex<Numbers>>) {
    let numbers = Arc::<Mutex<Numbers>>::default();
    let noted = Arc::clone(&numbers);
    let note = move |message: Arc<RosString>| {
        let mut numbers = noted.lock().unwrap();
        let number = message.data.trim_end().parse().unwrap();
        assert_eq!(message.data.len(), length(number).max(1));
        assert!(numbers.first.is_none() || numbers.last < number, "{number}");
        numbers.first.get_or_insert(number);
        numbers.last = number;
        numbers.received += 1;
    };
    let subscription = node
        .subscribe(topic, qos, SubscriptionExecutor::Dedicated, note)
        .unwrap();
    (subscription, numbers)
}

#[test]
#[ignore = "the receiving end of the tests here, not one itself"]
fn hears() {
    let Some((_runtime, node)) = node() else {
        return;
    };
    let deep = |topic: &str| match topic {
        "/best_effort" => Qos::best_effort(10_000),
        _ => Qos::reliable(10_000),
    };
    let topics = TOPICS.map(|topic| hear(&node, topic, deep(topic)));
    let diagnosed = Arc::<Mutex<BTreeMap<String, String>>>::default();
    let shown = Arc::clone(&diagnosed);
    let show = move |all: Arc<DiagnosticArray>| {
        let values = all.status.iter().flat_map(|status| &status.values);
        let values = values.map(|value| (value.key.clone(), value.value.clone()));
        shown.lock().unwrap().extend(values);
    };
    let _diagnostics = node
        .subscribe(
            "/diagnostics",
            Qos::DIAGNOSTICS,
            SubscriptionExecutor::Shared,
            show,
        )
        .unwrap();
    let ended = input_ends();
    let (mut before, mut changed) = ([0; 3], Instant::now());
    loop {
        let has_ended = ended.recv_timeout(Duration::from_millis(100));
        let received = topics.each_ref().map(|(_, of)| of.lock().unwrap().received);
        if received != before {
            (before, changed) = (received, Instant::now());
            println!("RECEIVED {} {} {}", received[0], received[1], received[2]);
        }
        let is_quiet = changed.elapsed() > QUIET;
        if has_ended == Err(RecvTimeoutError::Disconnected) {
            if is_quiet {
                break;
            }
            thread::sleep(PERIOD);
        }
    }
    for (topic, (subscription, numbers)) in TOPICS.iter().zip(&topics) {
        let Numbers {
            first,
            last,
            received,
        } = &*numbers.lock().unwrap();
        let (on_network, overrun) = (subscription.lost_on_network(), subscription.overrun());
        let key = format!("{topic} lost_on_network");
        let value = || {
            let shown = diagnosed.lock().unwrap();
            shown.get(&key).map_or(0, |value| value.parse().unwrap())
        };
        let late = Instant::now() + PATIENCE;
        while value() != on_network && Instant::now() < late {
            thread::sleep(PERIOD);
        }
        let (first, value) = (first.unwrap(), value());
        println!("HEARD {topic} {first} {last} {received} {on_network} {overrun} {value}");
    }
}
