//! A node that publishes texts, and one that subscribes to them.
//!
//! `cargo run -p lattice_runtime --example 1_publish_and_subscribe -- --ros-args -r chatter:=talk`

use std::error::Error;
use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_msgs::std_msgs::String as Text;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};

const MESSAGES: usize = 5;
const PATIENCE: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn Error>> {
    // A domain of its own on this machine. On a robot: Runtime::start("talker", args).
    let domain = LoopbackDomain::take()?;
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env()?
    };
    let args = RosArgs::parse(std::env::args())?;
    let runtime = Runtime::with_transport("talker", args, &network)?;

    // The handler runs on a thread of the runtime and returns at once.
    let (sender, received) = channel();
    let listener = runtime.node("listener")?;
    let shared = SubscriptionExecutor::Shared;
    let subscription = listener.subscribe("chatter", Qos::DEFAULT, shared, move |text| {
        let text: &Text = &text;
        // Fails once main has returned.
        let _ = sender.send(text.data.clone());
    })?;
    println!("{} subscribes to {}", listener.name(), subscription.topic());

    // A timer publishes until it is dropped.
    let talker = runtime.node("talker")?;
    let publisher = talker.publisher::<Text>("chatter", Qos::DEFAULT)?;
    let mut count = 0;
    let timer = runtime.timer(Duration::from_millis(10), move || {
        count += 1;
        let data = format!("hello {count}");
        // A full queue is counted in /diagnostics.
        let _ = publisher.publish(Text { data });
    });

    for i in 1..=MESSAGES {
        let text = received.recv_timeout(PATIENCE)?;
        println!("{text}");
        assert_eq!(text, format!("hello {i}"));
    }
    drop(timer);

    // Ctrl-C requests this too.
    runtime.shutdown_handle().request();
    runtime.spin()?;
    Ok(())
}
