//! The books of a network that loses: between two machines, what was sent was received or is counted, to the message.
//!
//! Both ends are this test program once more, each on a machine of its own, which is a network namespace.

mod ends;
mod mapper;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use lattice_test::domain::TestDomain;

use crate::fresh_clients::Loss;
use crate::machines::Machines;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(120);

const DOMAIN: &str = "LATTICE_TEST_NETWORK_DOMAIN";

const DDS: &str = "rmw_cyclonedds_cpp";

/// A publisher of a node, the same of the other reliability, and one as a player has it.
const TOPICS: [&str; 3] = ["/reliable", "/best_effort", "/kept"];

/// Final counters of a sender for one topic.
#[derive(Debug, Default)]
struct Sent {
    /// Messages given to the publisher.
    given: u64,
    /// Those handed to DDS.
    sent: u64,
    dropped: u64,
    unacknowledged: u64,
}

/// Final counters of a receiver for one topic.
#[derive(Debug, Default)]
struct Received {
    first: u64,
    last: u64,
    received: u64,
    on_network: u64,
    overrun: u64,
    /// As the transport shows `on_network` in `/diagnostics`.
    diagnosed: u64,
}

/// One of the ends.
struct End {
    child: Child,
    input: Option<ChildStdin>,
    said: Receiver<String>,
}

impl End {
    fn start(mut command: Command, domain: &TestDomain, range: &str) -> Self {
        let mut child = command
            .env(DOMAIN, domain.id().to_string())
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", range)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let (say, said) = channel();
        thread::spawn(move || {
            lines
                .map_while(Result::ok)
                .try_for_each(|line| say.send(line))
        });
        Self {
            input: child.stdin.take(),
            child,
            said,
        }
    }

    /// The numbers of the next line that begins so, its topic left out.
    fn next(&self, kind: &str) -> Vec<u64> {
        loop {
            let line = self.said.recv_timeout(PATIENCE).unwrap();
            // The harness writes its own words before the first.
            if let Some((_, words)) = line.split_once(kind) {
                let words = words.split_whitespace();
                return words.filter_map(|word| word.parse().ok()).collect();
            }
        }
    }

    /// Waits until so many messages of each topic have come, and gives how many.
    fn until_received(&self, least: [u64; 3]) -> [u64; 3] {
        loop {
            let received: [u64; 3] = self.next("RECEIVED ").try_into().unwrap();
            if received.iter().zip(&least).all(|(n, least)| n >= least) {
                return received;
            }
        }
    }

    fn end(&mut self) {
        drop(self.input.take());
    }
}

impl Drop for End {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sender and receiver of each topic.
type Books = BTreeMap<&'static str, (Sent, Received)>;

/// Has the ends talk over DDS while something happens to the network, and balances the books. None: no machines.
fn balance(percent: u32, happens: impl FnOnce(&Machines), after: u64) -> Option<Books> {
    let loss = Loss::new(percent)?;
    let on_each = |command: &mut Command, _| loss.on(command);
    let books = balance_over(DDS, on_each, happens, after)?;
    for (topic, (sent, _)) in &books {
        assert_eq!(sent.dropped, 0, "{topic}");
    }
    loss.check();
    Some(books)
}

/// The same over another transport, with more for the command of each end.
fn balance_over(
    transport: &str,
    on_each: impl Fn(&mut Command, usize),
    happens: impl FnOnce(&Machines),
    after: u64,
) -> Option<Books> {
    let domain = TestDomain::take();
    let machines = Machines::new(&domain)?;
    let start = |machine, test: &str| {
        let mut command = machines.run(machine, &format!("network::ends::{test}"));
        command.env("RMW_IMPLEMENTATION", transport);
        on_each(&mut command, machine);
        End::start(command, &domain, "SUBNET")
    };
    let (mut hears, mut sends) = (start(1, "hears"), start(0, "sends"));
    hears.until_received([200; 3]);
    happens(&machines);
    // Those on the way are behind this.
    while hears.said.try_recv().is_ok() {}
    let received = hears.until_received([0; 3]);
    hears.until_received(received.map(|received| received + after));
    sends.end();
    let sent = TOPICS.map(|topic| sends.next(&format!("SENT {topic}")));
    hears.end();
    let heard = TOPICS.map(|topic| hears.next(&format!("HEARD {topic}")));
    let books = TOPICS.iter().zip(sent).zip(heard);
    let books = books.map(|((topic, sent), heard)| {
        let [given, sent, dropped, unacknowledged] = sent.try_into().unwrap();
        let [first, last, received, on_network, overrun, diagnosed] = heard.try_into().unwrap();
        let (sent, heard) = (
            Sent {
                given,
                sent,
                dropped,
                unacknowledged,
            },
            Received {
                first,
                last,
                received,
                on_network,
                overrun,
                diagnosed,
            },
        );
        println!("{topic}: {sent:?} {heard:?}");
        (*topic, (sent, heard))
    });
    let books: BTreeMap<_, _> = books.collect();
    for (topic, (sent, heard)) in &books {
        // Of those from the first to the last that came, these found nobody to be sent to.
        let not_sent = sent.given - sent.sent;
        let between = heard.last - heard.first + 1 - not_sent;
        let counted = heard.on_network + heard.overrun;
        assert_eq!(between, heard.received + counted, "{topic}");
        assert_eq!(heard.diagnosed, heard.on_network, "{topic}");
        if *topic != "/best_effort" {
            assert_eq!(heard.last + 1, sent.given, "{topic}: the last ones");
        }
    }
    Some(books)
}

fn cut(seconds: u64) -> impl FnOnce(&Machines) {
    move |machines| {
        machines.set_link(false);
        thread::sleep(Duration::from_secs(seconds));
        machines.set_link(true);
    }
}

fn lost(books: &Books) -> [u64; 3] {
    TOPICS.map(|topic| books[topic].1.on_network)
}

#[test]
fn a_cut_of_5_s_is_counted_and_a_player_loses_nothing() {
    let Some(books) = balance(0, cut(5), 1000) else {
        return;
    };
    let [reliable, best_effort, kept] = lost(&books);
    // 500 were sent in that time; a depth of 50 has the last of them.
    assert!((100..700).contains(&reliable), "{reliable}");
    assert!((200..700).contains(&best_effort), "{best_effort}");
    assert_eq!((kept, books["/kept"].0.unacknowledged), (0, 0));
}

#[test]
fn a_cut_of_20_s_is_counted_at_both_ends() {
    let Some(books) = balance(0, cut(20), 300) else {
        return;
    };
    let [reliable, best_effort, kept] = lost(&books);
    assert!(reliable > 100 && best_effort > 100);
    // The receiver was taken for gone; what it had not acknowledged by then is what it misses, but for what it had
    // without having acknowledged it, and what came before it knew the sender again.
    assert!(kept > 100, "{kept}");
    assert!(books["/kept"].0.unacknowledged > 100);
}

#[test]
fn a_loss_of_5_percent_is_mended_or_counted() {
    lossy(5);
}

#[test]
fn a_loss_of_20_percent_is_mended_or_counted() {
    lossy(20);
}

fn lossy(percent: u32) {
    let Some(books) = balance(percent, |_| {}, 2000) else {
        return;
    };
    let [_, best_effort, kept] = lost(&books);
    assert!(best_effort > 20 * u64::from(percent), "{best_effort}");
    assert_eq!(kept, 0);
}

#[test]
fn packets_of_1400_bytes_lose_nothing() {
    let Some(books) = balance(0, |machines| machines.set_mtu(1400), 1000) else {
        return;
    };
    assert_eq!(lost(&books), [0; 3]);
}

/// The same cuts over Zenoh, without a router: the receiver calls the sender.
#[cfg(feature = "zenoh")]
mod zenoh {
    use super::*;

    fn balance(seconds: u64, after: u64) -> Option<Books> {
        let endpoints = ["listen", "connect"];
        let on_each = |command: &mut Command, machine: usize| {
            let endpoint = format!("{}/endpoints=[\"tcp/10.79.0.1:7447\"]", endpoints[machine]);
            command.env(
                "ZENOH_CONFIG_OVERRIDE",
                format!("connect/endpoints=[];{endpoint}"),
            );
            command.env("ZENOH_ROUTER_CHECK_ATTEMPTS", "-1");
        };
        balance_over("rmw_zenoh_cpp", on_each, cut(seconds), after)
    }

    #[test]
    fn a_cut_of_5_s_is_counted_and_a_player_loses_nothing() {
        let Some(books) = balance(5, 1000) else {
            return;
        };
        let [reliable, _, kept] = lost(&books);
        assert_eq!((reliable, kept), (0, 0));
        assert_eq!(books["/kept"].0.dropped, 0);
    }

    #[test]
    fn a_cut_of_20_s_is_counted() {
        let Some(books) = balance(20, 300) else {
            return;
        };
        let [reliable, best_effort, kept] = lost(&books);
        assert_eq!((reliable, kept), (0, 0));
        // What does not fit into the buffers of the kernel is left out, here or on the way.
        let not_sent = |topic| books[topic].0.dropped;
        assert!(not_sent("/best_effort") + best_effort > 100);
        assert!(not_sent("/reliable") > 100);
    }
}
