//! Services of `bag_player` in each of its states: all are answered within 100 ms.

use std::io::{BufRead, BufReader};
use std::process::Child;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use lattice_msgs::rosbag2_interfaces::{
    Burst, BurstRequest, BurstResponse, GetRate, GetRateRequest, IsPaused, IsPausedRequest, Pause,
    PauseRequest, PlayNext, PlayNextRequest, Resume, ResumeRequest, Stop, StopRequest,
};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::{RosService, cdr};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Client, LoopbackDomain, Node, Runtime, Subscription, SubscriptionExecutor};
use serde_json::{Value, json};
use wait_timeout::ChildExt;

use crate::PATIENCE;
use crate::nodes::simulated;
use crate::record::{expect, play, signal, start};

/// Longest that a call may take.
const ANSWERED: Duration = Duration::from_millis(100);
/// Calls of each service, of which one in ten may be late: the machine may have other work.
const CALLS: usize = 20;

/// A player, and a node that calls its services.
struct Asked {
    player: Child,
    node: Node,
    runtime: Runtime,
    said: Receiver<String>,
}

impl Asked {
    fn start(domain: &LoopbackDomain, log: &str, parameters: &[&str]) -> Self {
        Self::of(domain, play(domain, log, parameters))
    }

    /// A node that calls the services of a player already started.
    fn of(domain: &LoopbackDomain, mut player: Child) -> Self {
        let network = Network {
            domain_id: domain.id(),
            localhost_only: true,
            ..Network::from_env().unwrap()
        };
        let runtime = Runtime::with_transport("asking", RosArgs::default(), &network).unwrap();
        let node = runtime.node("asking").unwrap();
        let lines = BufReader::new(player.stderr.take().unwrap()).lines();
        let (say, said) = channel();
        thread::spawn(move || {
            lines
                .map_while(Result::ok)
                .try_for_each(|line| say.send(line))
        });
        Self {
            player,
            node,
            runtime,
            said,
        }
    }

    fn client<S: RosService>(&self, name: &str) -> Client {
        self.node
            .client::<S>(&format!("/bag_player/{name}"))
            .unwrap()
    }

    fn call<S: RosService>(&self, name: &str, request: &S::Request) -> S::Response {
        call::<S>(&self.client::<S>(name), request)
    }

    /// A call whose answer comes later.
    fn burst(&self, num_messages: u64) -> Receiver<u64> {
        let (tell, told) = channel();
        let client = self.client::<Burst>("burst");
        let request = cdr::to_vec(&BurstRequest { num_messages }).unwrap();
        thread::spawn(move || {
            let answer = smol::block_on(client.call(request, 10 * PATIENCE)).unwrap();
            let answer: BurstResponse = cdr::from_slice(&answer).unwrap();
            tell.send(answer.actually_burst)
        });
        told
    }

    /// Calls two services repeatedly and asserts their latency.
    fn ask(&self, state: &str, is_paused: bool) {
        let paused = self.client::<IsPaused>("is_paused");
        let rate = self.client::<GetRate>("get_rate");
        // The first call of each waits for the discovery of its endpoints.
        let _ = call::<IsPaused>(&paused, &IsPausedRequest::default());
        let _ = call::<GetRate>(&rate, &GetRateRequest::default());
        let mut late = Vec::new();
        for _ in 0..CALLS {
            let begin = Instant::now();
            let answer = call::<IsPaused>(&paused, &IsPausedRequest::default());
            assert_eq!(answer.paused, is_paused, "{state}");
            late.push(begin.elapsed());
            let begin = Instant::now();
            let _ = call::<GetRate>(&rate, &GetRateRequest::default());
            late.push(begin.elapsed());
        }
        late.sort_unstable();
        println!("{state}: median {:?}, most {:?}", late[CALLS], late.last());
        let nine_of_ten = late[late.len() * 9 / 10];
        assert!(nine_of_ten < ANSWERED, "{state}: {late:?}");
    }

    /// Lines of its log until one has these words.
    fn until_said(&self, words: &str) {
        loop {
            let line = self.said.recv_timeout(PATIENCE).unwrap();
            if line.contains(words) {
                return;
            }
        }
    }

    fn stop(mut self) {
        let _ = self.call::<Stop>("stop", &StopRequest::default());
        let status = self.player.wait_timeout(PATIENCE).unwrap();
        assert!(status.is_some_and(|status| status.success()), "{status:?}");
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        let _ = self.player.kill();
        let _ = self.player.wait();
        self.runtime.shutdown_handle().request();
    }
}

fn call<S: RosService>(client: &Client, request: &S::Request) -> S::Response {
    let request = cdr::to_vec(request).unwrap();
    let answer = smol::block_on(client.call(request, PATIENCE)).unwrap();
    cdr::from_slice(&answer).unwrap()
}

/// A subscription whose messages come through the channel.
fn listens(node: &Node, topic: &str) -> (Subscription, Receiver<()>) {
    let (tell, heard) = channel();
    let qos = Qos::reliable(1000);
    let hear = move |_: Arc<PointCloud2>| _ = tell.send(());
    (
        node.subscribe(topic, qos, SubscriptionExecutor::Dedicated, hear)
            .unwrap(),
        heard,
    )
}

#[test]
fn services_are_answered_in_every_state() {
    let directory = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let log = simulated(directory.path(), "mcap", "4");
    let asked = Asked::start(&domain, &log, &["start_paused:=true", "loop:=true"]);
    let (_clouds, heard) = listens(&asked.node, "/left/points");
    asked.ask("paused", true);
    // More than it will ever play.
    let played = asked.burst(u64::MAX);
    heard.recv_timeout(PATIENCE).unwrap();
    asked.ask("in a burst without end", true);
    // One that plays says no to another.
    let next = asked.call::<PlayNext>("play_next", &PlayNextRequest::default());
    assert!(!next.success);
    assert_eq!(asked.burst(5).recv_timeout(PATIENCE), Ok(0));
    assert!(played.try_recv().is_err());
    let _ = asked.call::<Resume>("resume", &ResumeRequest::default());
    let first = played.recv_timeout(PATIENCE).unwrap();
    assert!(first > 100, "{first}");
    asked.ask("playing", false);
    let _ = asked.call::<Pause>("pause", &PauseRequest::default());
    // All there are, again and again.
    let played = asked.burst(0);
    heard.recv_timeout(PATIENCE).unwrap();
    asked.ask("in a burst of all", true);
    assert!(played.try_recv().is_err());
    let _ = asked.call::<Resume>("resume", &ResumeRequest::default());
    assert!(played.recv_timeout(PATIENCE).unwrap() > 0);
    let _ = asked.call::<Pause>("pause", &PauseRequest::default());
    assert_eq!(asked.burst(7).recv_timeout(PATIENCE), Ok(7));
    let next = asked.call::<PlayNext>("play_next", &PlayNextRequest::default());
    assert!(next.success);
    asked.stop();
    // So slow that the log is held again before its next message is due.
    let slow = ["start_paused:=true", "loop:=true", "rate:=0.001"];
    let asked = Asked::start(&domain, &log, &slow);
    let (_clouds, heard) = listens(&asked.node, "/left/points");
    let played = asked.burst(0);
    heard.recv_timeout(PATIENCE).unwrap();
    let _ = asked.call::<Resume>("resume", &ResumeRequest::default());
    let _ = asked.call::<Pause>("pause", &PauseRequest::default());
    assert!(played.recv_timeout(PATIENCE).unwrap() > 0);
    asked.stop();
    // As fast as it goes.
    let asked = Asked::start(&domain, &log, &["rate:=1000.0", "loop:=true"]);
    let (_clouds, heard) = listens(&asked.node, "/left/points");
    heard.recv_timeout(PATIENCE).unwrap();
    asked.ask("at a thousand times the rate", false);
    asked.stop();
}

#[test]
fn services_are_answered_while_others_are_waited_for() {
    let directory = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let log = simulated(directory.path(), "mcap", "2");
    let of_left = "['/left/points']";
    let waits = format!("wait_for_subscribers:={of_left}");
    // Nobody listens yet.
    let asked = Asked::start(&domain, &log, &[&waits, "wait_timeout_s:=600.0"]);
    asked.ask("waiting for a subscriber", false);
    asked.stop();
    // An answer that does not come, and one that publishes it.
    let lockstep = "lockstep:=['/left/points', '/answers']";
    let parameters = [lockstep, "max_wait_s:=600.0", "wait_timeout_s:=600.0"];
    let asked = Asked::start(&domain, &log, &parameters);
    asked.ask("waiting for a publisher of answers", false);
    let _answers = asked
        .node
        .publisher::<PointCloud2>("/answers", Qos::latched(10));
    asked.until_said("playing");
    asked.ask("waiting for an answer", false);
    asked.stop();
}

/// Status, last line and report of a player whose recorder is stopped by a signal, if any, once the log plays.
fn played_to(stop: Option<&str>, strict: bool) -> (bool, String, Value) {
    let directory = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let log = simulated(directory.path(), "mcap", "2");
    let bag = directory.path().join("recorded").display().to_string();
    let report = directory.path().join("report");
    let report_file = format!("report_file:={}", report.display());
    let strict = format!("strict:={strict}");
    let player = play(
        &domain,
        &log,
        &[
            "qos./left/points.reliability:=reliable",
            "wait_for_subscribers:=['/left/points']",
            "start_paused:=true",
            &strict,
            &report_file,
        ],
    );
    let mut recorder = start(&domain, &["record", "-o", &bag, "/left/points"]);
    expect(&mut recorder, &["recording /left/points"]);
    let asked = Asked::of(&domain, player);
    asked.until_said("playing");
    assert!(
        asked
            .call::<PlayNext>("play_next", &PlayNextRequest::default())
            .success
    );
    if let Some(stop) = stop {
        signal(&recorder, stop);
    }
    let _ = asked.call::<Resume>("resume", &ResumeRequest::default());
    let mut asked = asked;
    let status = asked.player.wait_timeout(PATIENCE).unwrap().unwrap();
    let lines: Vec<String> = asked.said.iter().collect();
    let last = lines.iter().rfind(|line| line.contains("messages played"));
    let last = last.unwrap().clone();
    signal(&recorder, "-CONT");
    signal(&recorder, "-INT");
    recorder.wait().unwrap();
    let report = std::fs::read_to_string(&report).unwrap();
    (
        status.success(),
        last,
        serde_json::from_str(&report).unwrap(),
    )
}

#[test]
fn what_a_player_does_not_deliver_is_in_its_last_line_and_its_status() {
    let (success, last, report) = played_to(None, true);
    assert!(success && last.ends_with(" ms late"), "{last}");
    assert_eq!(
        (&report["failed"], &report["unacknowledged"]),
        (&json!(0), &json!(0))
    );
    for strict in [false, true] {
        // It is taken for gone after its lease of 10 s.
        let (success, last, report) = played_to(Some("-STOP"), strict);
        let unacknowledged = report["unacknowledged"].as_u64().unwrap();
        let messages = report["messages"].as_u64().unwrap();
        assert!((20..=messages).contains(&unacknowledged), "{report}");
        assert!(
            last.contains(&format!(" {unacknowledged} not acknowledged")),
            "{last}"
        );
        assert_eq!(success, !strict, "{last}");
    }
}
