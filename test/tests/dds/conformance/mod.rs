//! One suite for every transport that is built in.
//!
//! The ends are in processes of their own where one is killed or stopped: an [`Echo`] is this test program
//! once more, as the test `echo`.

mod apart;
mod attacks;
mod crowd;
mod fastdds;
mod forged;
mod matching;
mod recovery;
mod services;

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::env::{Network, TransportKind};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Publisher, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::domain::{TestDomain, localhost_only};

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

/// Longest time to recovery after a peer was stopped or killed.
const RECOVERY: Duration = Duration::from_secs(12);

/// Between two messages of a talk.
const PERIOD: Duration = Duration::from_millis(50);

/// Messages both ways, however many are on the way.
const QOS: Qos = Qos::reliable(100);

/// Domain of an echo.
const DOMAIN: &str = "LATTICE_TEST_ECHO_DOMAIN";

/// Name in `RMW_IMPLEMENTATION`, and what it names.
pub type Transport = (&'static str, TransportKind);

/// Every transport with itself: none reaches another.
fn pairs() -> impl Iterator<Item = (Transport, Transport)> {
    TransportKind::BUILT_IN.iter().map(|one| (*one, *one))
}

fn runtime(domain: &TestDomain, transport: Transport, name: &str) -> Runtime {
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let network = Network {
        transport: transport.1,
        ..domain.transport()
    };
    Runtime::with_transport(name, args, &network).unwrap()
}

/// A process that publishes on `/said` what it receives on `/heard`, has a latched `/map` and a service `~/reset`.
pub struct Echo(pub Child);

impl Echo {
    pub fn start(domain: &TestDomain, transport: Transport) -> Self {
        Self::start_by(Command::new(program()), domain, transport)
    }

    /// In an address space of so many kB.
    pub fn start_within(domain: &TestDomain, transport: Transport, kb: usize) -> Self {
        let mut shell = Command::new("sh");
        let limited = format!("ulimit -v {kb} && exec \"$0\" \"$@\"");
        shell.args(["-c", &limited]).arg(program());
        Self::start_by(shell, domain, transport)
    }

    fn start_by(mut command: Command, domain: &TestDomain, transport: Transport) -> Self {
        let child = command
            .args(["--exact", "conformance::echo", "--ignored", "--nocapture"])
            .env(DOMAIN, domain.id().to_string())
            .env("RMW_IMPLEMENTATION", transport.0)
            .stdout(Stdio::null())
            .spawn();
        Self(child.unwrap())
    }

    pub fn signal(&self, name: &str) {
        let id = self.0.id().to_string();
        let done = Command::new("kill").args(["-s", name, &id]).status();
        assert!(done.unwrap().success());
    }
}

/// This test program.
fn program() -> PathBuf {
    std::env::current_exe().unwrap()
}

impl Drop for Echo {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[ignore = "the other end of the tests here, not one itself"]
fn echo() {
    let Ok(id) = std::env::var(DOMAIN) else {
        return;
    };
    let network = Network {
        domain_id: id.parse().unwrap(),
        localhost_only: localhost_only(),
        ..Network::from_env().unwrap()
    };
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport("echo", args, &network).unwrap();
    let node = runtime.node("echo").unwrap();
    let out = node.publisher::<RosString>("/said", QOS).unwrap();
    let map = node.publisher("/map", Qos::latched(1)).unwrap();
    map.publish(RosString {
        data: "map".to_owned(),
    })
    .unwrap();
    let say_again = move |message| {
        let _ = out.publish(message);
    };
    let _heard = node
        .subscribe::<RosString>("/heard", QOS, SubscriptionExecutor::Shared, say_again)
        .unwrap();
    let _served = node
        .service_trigger("~/reset", || (true, String::new()))
        .unwrap();
    runtime.spin().unwrap();
}

/// Our end of a talk with an echo.
struct Talk {
    publisher: Publisher<RosString>,
    heard: Receiver<String>,
    node: Node,
    _subscription: Subscription,
    _runtime: Runtime,
}

impl Talk {
    fn start(domain: &TestDomain, transport: Transport) -> Self {
        Self::with(runtime(domain, transport, "talk"))
    }

    fn with(runtime: Runtime) -> Self {
        let node = runtime.node("talk").unwrap();
        let publisher = node.publisher("/heard", QOS).unwrap();
        let (sender, heard) = channel();
        let handler = move |message: std::sync::Arc<RosString>| {
            let _ = sender.send(message.data.clone());
        };
        let subscription = node
            .subscribe("/said", QOS, SubscriptionExecutor::Shared, handler)
            .unwrap();
        Self {
            publisher,
            heard,
            node,
            _subscription: subscription,
            _runtime: runtime,
        }
    }

    /// Says a word until it comes back; the time that took.
    #[track_caller]
    fn until_echoed(&self, word: &str, within: Duration) -> Duration {
        let start = Instant::now();
        loop {
            let data = word.to_owned();
            // A full queue shows in the time.
            let _ = self.publisher.publish(RosString { data });
            loop {
                match self.heard.recv_timeout(PERIOD) {
                    Ok(heard) if heard == word => return start.elapsed(),
                    Ok(_) => {}
                    Err(RecvTimeoutError::Timeout) => break,
                    Err(error) => panic!("{error}"),
                }
            }
            assert!(start.elapsed() < within, "{word} was not heard again");
        }
    }

    /// Says a word once; it has to come back. Returns how many others came back before.
    #[track_caller]
    fn once(&self, word: &str, within: Duration) -> usize {
        let data = word.to_owned();
        self.publisher.publish(RosString { data }).unwrap();
        let end = Instant::now() + within;
        let mut others = 0;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.heard.recv_timeout(left) {
                Ok(heard) if heard == word => return others,
                Ok(_) => others += 1,
                Err(error) => panic!("{word} was not heard again: {error}"),
            }
        }
    }
}
