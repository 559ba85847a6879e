//! The transport between two participants, in one process and over loopback.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Load, Node, Runtime, Subscription};
use lattice_test::domain::TestDomain;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

fn runtime(domain: &TestDomain, name: &str) -> Runtime {
    with_args(domain, name, &[])
}

fn with_args(domain: &TestDomain, name: &str, args: &[&str]) -> Runtime {
    let args = ["--ros-args"].iter().chain(args).map(|&arg| arg.to_owned());
    let args = RosArgs::parse(args).unwrap();
    Runtime::with_transport(name, args, &domain.transport()).unwrap()
}

fn text(data: &str) -> RosString {
    RosString {
        data: data.to_owned(),
    }
}

/// Messages of a topic, in a channel.
fn hear<M: RosMessage>(
    node: &Node,
    topic: &str,
    qos: Qos,
    load: Load,
) -> (Subscription, Receiver<Arc<M>>) {
    let (sender, receiver) = channel();
    let handler = move |message| {
        // The test may have heard enough.
        let _ = sender.send(message);
    };
    let subscription = node.subscribe::<M>(topic, qos, load, handler).unwrap();
    (subscription, receiver)
}

/// Waits for a subscriber of the publisher.
macro_rules! wait_for_subscriber {
    ($publisher:expr) => {{
        let (sender, joined) = channel();
        $publisher.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        joined.recv_timeout(PATIENCE).expect("a subscriber");
    }};
}

/// Waits until both sides know each other: only then does nothing best-effort go amiss.
macro_rules! wait_for_match {
    ($publisher:expr, $subscription:expr) => {{
        wait_for_subscriber!($publisher);
        let (sender, joined) = channel();
        $subscription.on_publisher_joined(move || {
            let _ = sender.send(());
        });
        joined.recv_timeout(PATIENCE).expect("a publisher");
    }};
}

mod delivery;
mod process;

/// Waits until `reached` is true, asked on a timer of the runtime.
fn wait_until(runtime: &Runtime, mut reached: impl FnMut() -> bool + Send + 'static) {
    let (sender, done) = channel();
    runtime.timer(Duration::from_millis(5), move || {
        if reached() {
            let _ = sender.send(());
        }
    });
    done.recv_timeout(PATIENCE).expect("the state waited for");
}
