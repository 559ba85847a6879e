//! Datagrams that are forged in the name of writers the victim knows: it lives, in little memory, and answers others.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

use lattice_msgs::cdr;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};
use lattice_runtime::env::TransportKind;
use lattice_runtime::{Client, Runtime};
use lattice_test::domain::TestDomain;
use lattice_test::python::{python, script};

use super::{Echo, PATIENCE, Talk, runtime};

/// Address space of the victim, bytes.
const LIMIT: u64 = 1 << 30;

/// Growth that is allowed for an attack, bytes.
const GROWTH: u64 = 20 << 20;

/// Longest time to an answer after an attack.
const WITHIN: Duration = Duration::from_secs(20);

const ATTACKS: [&str; 6] = [
    "heartbeats",
    "gaps",
    "gigabytes",
    "fragments_of_nothing",
    "mutations",
    "participants",
];

/// The program that attacks.
struct Attacker {
    child: Child,
    orders: ChildStdin,
    told: std::io::Lines<BufReader<std::process::ChildStdout>>,
}

impl Attacker {
    fn start(python: &std::path::Path, domain: &TestDomain, count: usize) -> Self {
        let mut child = Command::new(python)
            .arg(script("attack_peer.py"))
            .args([&domain.id().to_string(), "echo/reset", &count.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // It hears its own datagrams too, and says so.
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let orders = child.stdin.take().unwrap();
        let told = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut this = Self {
            child,
            orders,
            told,
        };
        assert_eq!(this.told.next().unwrap().unwrap(), "ready");
        this
    }

    fn attack(&mut self, name: &str) {
        writeln!(self.orders, "{name}").unwrap();
        assert_eq!(self.told.next().unwrap().unwrap(), name);
    }
}

impl Drop for Attacker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Memory that a process has in use, bytes.
fn resident(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let kilobytes: u64 = line
        .unwrap()
        .split_whitespace()
        .nth(1)
        .unwrap()
        .parse()
        .unwrap();
    kilobytes << 10
}

fn is_answered(client: &Client) {
    let request = cdr::to_vec(&TriggerRequest::default()).unwrap();
    let answer = smol::block_on(client.call(request, WITHIN)).unwrap();
    assert!(cdr::from_slice::<TriggerResponse>(&answer).unwrap().success);
}

fn attacked(count: usize) {
    let Some(python) = python() else { return };
    let domain = TestDomain::take();
    let transport = TransportKind::BUILT_IN[0];
    let victim = Echo::start(&domain, transport);
    let id = victim.0.id();
    let limited = Command::new("prlimit")
        .args([format!("--pid={id}"), format!("--as={LIMIT}")])
        .status();
    assert!(limited.unwrap().success());
    let talk = Talk::start(&domain, transport);
    talk.until_echoed("before", PATIENCE);
    let asking: Runtime = runtime(&domain, transport, "asking");
    let node = asking.node("asking").unwrap();
    let client = node.client::<Trigger>("/echo/reset").unwrap();
    is_answered(&client);
    let mut attacker = Attacker::start(&python, &domain, count);
    for attack in ATTACKS {
        let before = resident(id);
        attacker.attack(attack);
        for word in 0..10 {
            talk.until_echoed(&format!("{attack} {word}"), WITHIN);
            is_answered(&client);
        }
        let grown = resident(id).saturating_sub(before);
        println!("{attack}: {} kB more", grown >> 10);
        assert!(grown < GROWTH, "{attack}: {grown} bytes");
    }
}

#[test]
fn forged_datagrams_cost_nothing_and_silence_nobody() {
    attacked(20_000);
}

#[test]
#[ignore = "takes minutes"]
fn a_million_forged_datagrams_cost_nothing_and_silence_nobody() {
    attacked(1_000_000);
}
