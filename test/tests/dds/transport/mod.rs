//! The transport between two participants, in one process and over loopback.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Publisher, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::domain::TestDomain;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

/// Two runtimes with a node each, as if on two machines.
struct Two {
    a: Runtime,
    b: Runtime,
    from: Node,
    to: Node,
    _domain: TestDomain,
}

impl Two {
    fn start() -> Self {
        Self::with_args(&[])
    }

    /// The second one with ROS arguments.
    fn with_args(args: &[&str]) -> Self {
        let domain = TestDomain::take();
        let (a, b) = (runtime(&domain, "a", &[]), runtime(&domain, "b", args));
        let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
        Self {
            a,
            b,
            from,
            to,
            _domain: domain,
        }
    }

    /// A publisher of the first process.
    fn publisher<M: RosMessage>(&self, topic: &str, qos: Qos) -> Publisher<M> {
        self.from.publisher(topic, qos).unwrap()
    }

    /// Messages that the second process receives.
    fn hear<M: RosMessage>(
        &self,
        topic: &str,
        qos: Qos,
        executor: SubscriptionExecutor,
    ) -> (Subscription, Receiver<Arc<M>>) {
        hear(&self.to, topic, qos, executor)
    }
}

fn runtime(domain: &TestDomain, name: &str, args: &[&str]) -> Runtime {
    let args = ["--ros-args"].iter().chain(args).map(|&arg| arg.to_owned());
    let args = RosArgs::parse(args).unwrap();
    Runtime::with_transport(name, args, &domain.transport()).unwrap()
}

fn text(data: impl ToString) -> RosString {
    RosString {
        data: data.to_string(),
    }
}

/// Publishes the numbers below `n`.
fn count_to(n: i32, publisher: &Publisher<RosString>) {
    for i in 0..n {
        publisher.publish(text(i)).unwrap();
    }
}

/// The next messages are the numbers below `n`.
#[track_caller]
fn assert_counted(n: i32, heard: &Receiver<Arc<RosString>>) {
    for i in 0..n {
        assert_heard(heard, &i.to_string());
    }
}

#[track_caller]
fn assert_heard(heard: &Receiver<Arc<RosString>>, data: &str) {
    assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, data);
}

/// Messages of a topic, in a channel.
fn hear<M: RosMessage>(
    node: &Node,
    topic: &str,
    qos: Qos,
    executor: SubscriptionExecutor,
) -> (Subscription, Receiver<Arc<M>>) {
    let (sender, receiver) = channel();
    let handler = move |message| {
        // The test may have heard enough.
        let _ = sender.send(message);
    };
    let subscription = node.subscribe::<M>(topic, qos, executor, handler).unwrap();
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
mod gaps;
mod process;
mod requests;
mod stalled;

/// Waits until `reached` is true, asked on a timer of the runtime.
fn wait_until(runtime: &Runtime, mut reached: impl FnMut() -> bool + Send + 'static) {
    let (sender, done) = channel();
    let _timer = runtime.timer(Duration::from_millis(5), move || {
        if reached() {
            let _ = sender.send(());
        }
    });
    done.recv_timeout(PATIENCE).expect("the state waited for");
}
