//! Peers that publish a word again and again on one topic and write down what they receive.
//!
//! They are processes: this test program once more, as the test `peer`.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Runtime, Subscription, SubscriptionExecutor, lock, logging};
use lattice_test::domain::TestDomain;

use super::keystore::Keystore;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(120);
/// Between two words of a peer.
const PERIOD: Duration = Duration::from_millis(100);
pub const QOS: Qos = Qos::reliable(100);

const DOMAIN: &str = "LATTICE_TEST_PEER_DOMAIN";
const WORD: &str = "LATTICE_TEST_PEER_WORD";

/// Topic of the talks in a domain, which no other test has.
pub fn topic(domain: u16) -> String {
    format!("/domain{domain}/talk")
}

/// Says a word again and again; others' words come to `heard`.
pub fn talk(
    runtime: &Runtime,
    (name, domain): (&str, u16),
    word: &str,
    heard: Sender<String>,
) -> Subscription {
    let node = runtime.node(name).unwrap();
    let out = node.publisher(&topic(domain), QOS).unwrap();
    let own = word.to_owned();
    let handler = move |message: Arc<RosString>| {
        if message.data != own {
            let _ = heard.send(message.data.clone());
        }
    };
    let subscription = node
        .subscribe(&topic(domain), QOS, SubscriptionExecutor::Shared, handler)
        .unwrap();
    let data = word.to_owned();
    let timer = runtime.timer(PERIOD, move || {
        let _ = out.publish(RosString { data: data.clone() });
    });
    timer.detach();
    subscription
}

#[test]
#[ignore = "the other end of the tests here, not one itself"]
fn peer() {
    let (Ok(id), Ok(word)) = (std::env::var(DOMAIN), std::env::var(WORD)) else {
        return;
    };
    let network = Network {
        domain_id: id.parse().unwrap(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let args = ["--ros-args", "--enclave", &format!("/{word}")].map(str::to_owned);
    let args = RosArgs::parse(args).unwrap();
    logging::init(&args, "peer").unwrap();
    let runtime = Runtime::with_transport("peer", args, &network).unwrap();
    let (sender, heard) = channel();
    let _talk = talk(&runtime, ("peer", network.domain_id), &word, sender);
    for word in heard {
        println!("heard {word}");
    }
}

/// A process that talks, and what it prints: a line `heard WORD` for each word, and its log.
pub struct Peer {
    child: Child,
    printed: Lines,
    pub log: Lines,
}

/// Lines so far.
type Lines = Arc<Mutex<Vec<String>>>;

impl Peer {
    pub fn start(domain: &TestDomain, word: &str, keystore: Option<&Keystore>) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args([
                "--exact",
                "security::peers::peer",
                "--ignored",
                "--nocapture",
            ])
            .env(DOMAIN, domain.id().to_string())
            .env(WORD, word)
            .env("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
            .env_remove("ROS_SECURITY_ENABLE");
        if let Some(keystore) = keystore {
            command
                .env("ROS_SECURITY_ENABLE", "true")
                .env("ROS_SECURITY_STRATEGY", "Enforce")
                .env("ROS_SECURITY_KEYSTORE", keystore.path(""));
        }
        Self::of(&mut command)
    }

    /// Another program that prints as ours does.
    pub fn of(command: &mut Command) -> Self {
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        Self {
            printed: lines(child.stdout.take().unwrap()),
            log: lines(child.stderr.take().unwrap()),
            child,
        }
    }

    pub fn count(&self, word: &str) -> usize {
        self.heard().iter().filter(|heard| *heard == word).count()
    }

    pub fn heard(&self) -> Vec<String> {
        let printed = lock(&self.printed);
        let heard = printed
            .iter()
            .filter_map(|line| line.strip_prefix("heard "));
        heard.map(str::to_owned).collect()
    }

    pub fn has_printed(&self, line: &str) -> bool {
        lock(&self.printed).iter().any(|printed| printed == line)
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn lines(from: impl std::io::Read + Send + 'static) -> Lines {
    let lines = Lines::default();
    let out = Arc::clone(&lines);
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            lock(&out).push(line);
        }
    });
    lines
}

/// Gives words to `enough` until it is true; without a word an empty one, so that it can look elsewhere.
pub fn until(heard: &Receiver<String>, what: &str, mut enough: impl FnMut(&str) -> bool) {
    let start = Instant::now();
    loop {
        assert!(start.elapsed() < PATIENCE, "{what}: in vain");
        match heard.recv_timeout(PERIOD) {
            Ok(word) if enough(&word) => return,
            Ok(_) => {}
            Err(RecvTimeoutError::Timeout) if enough("") => return,
            Err(RecvTimeoutError::Timeout) => {}
            Err(error) => panic!("{error}"),
        }
    }
}
