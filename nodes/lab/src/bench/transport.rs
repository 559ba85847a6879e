//! Loss, latency and processor time of clouds between two processes over the transport of the nodes.

use std::io::{self, BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Node, Runtime, SubscriptionExecutor};
use serde::{Deserialize, Serialize};

use super::clock::process_cpu_s;
use crate::AnyError;
use crate::options::within;

const TOPIC: &str = "/points";
/// Limit of the wait for a match, for each message, and for the first line of the other process.
const PATIENCE: Duration = Duration::from_secs(10);

/// Workload of the measurement.
#[derive(Clone, Copy, Debug)]
pub struct TransportSetup {
    /// Size of the point data of a message, bytes.
    pub bytes: usize,
    /// Publication rate, Hz.
    pub rate_hz: f64,
    /// Number of messages.
    pub count: u64,
    /// True for best effort, false for reliable.
    pub best_effort: bool,
}

/// Result of the receiving process.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Received {
    /// Number of messages received.
    pub heard: u64,
    /// Median latency from the call of `publish` to the call of the handler, ms.
    pub median_ms: f64,
    /// 99th percentile of the latency, ms.
    pub p99_ms: f64,
    /// Maximum latency, ms.
    pub max_ms: f64,
    /// Processor time of the process from the first message to the last, s.
    pub cpu_s: f64,
}

/// Result of both processes.
#[derive(Clone, Debug, Serialize)]
pub struct TransportReport {
    /// Name of the transport in `RMW_IMPLEMENTATION`.
    pub transport: &'static str,
    /// Number of messages sent.
    pub sent: u64,
    /// Processor time of the sending process, s.
    pub cpu_s: f64,
    /// Result of the receiving process.
    pub received: Received,
}

impl TransportSetup {
    fn qos(self) -> Qos {
        match self.best_effort {
            true => Qos::best_effort(20),
            false => Qos::reliable(20),
        }
    }
}

fn now() -> Duration {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.unwrap_or_default()
}

fn node(domain: u16, name: &str) -> Result<(Runtime, Node, &'static str), AnyError> {
    let network = Network {
        domain_id: domain,
        localhost_only: true,
        ..Network::from_env()?
    };
    let args = RosArgs::parse(["--ros-args".to_owned()])?;
    let runtime = Runtime::with_transport(name, args, &network)?;
    let node = runtime.node(name)?;
    Ok((runtime, node, network.transport.name()))
}

/// Measures the transport: `listener` makes the command of a process on the given domain, which calls [`listen`], and
/// this process publishes.
pub fn send(
    setup: TransportSetup,
    listener: impl FnOnce(u16) -> Command,
) -> Result<TransportReport, AnyError> {
    within("rate-hz", setup.rate_hz, 0.1, 1e6)?;
    let domain = LoopbackDomain::take()?;
    let (_runtime, node, transport) = node(domain.id(), "sender")?;
    let publisher = node.publisher::<PointCloud2>(TOPIC, setup.qos())?;
    let mut other = listener(domain.id());
    let mut other = other.stdout(Stdio::piped()).spawn()?;
    let lines = other.stdout.take().map(BufReader::new);
    let mut lines = lines.into_iter().flat_map(BufRead::lines);
    // It says that it knows us.
    lines.next().ok_or("the listener ended")??;
    let (start, cpu_start_s) = (Instant::now(), process_cpu_s());
    let data = vec![7; setup.bytes];
    for i in 0..setup.count {
        let due = start + Duration::from_secs_f64(i as f64 / setup.rate_hz);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        let mut cloud = PointCloud2 {
            data: data.clone().into(),
            ..PointCloud2::default()
        };
        cloud.header.stamp = Time::from_ns(now().as_nanos() as i64);
        publisher.publish(cloud)?;
    }
    let received = lines.next().ok_or("the listener ended early")??;
    let report = TransportReport {
        transport,
        sent: publisher.sent(),
        cpu_s: process_cpu_s() - cpu_start_s,
        received: serde_json::from_str(&received)?,
    };
    other.wait()?;
    Ok(report)
}

/// Subscribes on a domain and prints the result as one line for [`send`].
pub fn listen(setup: TransportSetup, domain: u16) -> Result<(), AnyError> {
    let (_runtime, node, _) = node(domain, "listener")?;
    let (sender, heard) = channel();
    let (joins, joined) = channel();
    let handler = move |cloud: Arc<PointCloud2>| {
        let sent_ns = cloud.header.stamp.to_ns() as f64;
        let _ = sender.send(now().as_nanos() as f64 - sent_ns);
    };
    let subscription =
        node.subscribe(TOPIC, setup.qos(), SubscriptionExecutor::Dedicated, handler)?;
    subscription.on_publisher_joined(move || {
        let _ = joins.send(());
    });
    joined.recv_timeout(PATIENCE)?;
    // The sender may know of this end a moment later.
    std::thread::sleep(Duration::from_millis(500));
    let mut out = io::stdout().lock();
    writeln!(out, "ready")?;
    out.flush()?;
    writeln!(
        out,
        "{}",
        serde_json::to_string(&hear(&heard, setup.count))?
    )?;
    Ok(())
}

fn hear(heard: &Receiver<f64>, count: u64) -> Received {
    let cpu_start_s = process_cpu_s();
    let mut delays_ns = Vec::new();
    while (delays_ns.len() as u64) < count
        && let Ok(delay_ns) = heard.recv_timeout(PATIENCE)
    {
        delays_ns.push(delay_ns);
    }
    let cpu_s = process_cpu_s() - cpu_start_s;
    delays_ns.sort_by(f64::total_cmp);
    let share = |share: f64| {
        let last = delays_ns.len().saturating_sub(1);
        let delay_ns = delays_ns.get((share * last as f64).round() as usize);
        delay_ns.map_or(f64::NAN, |ns| ns * 1e-6)
    };
    Received {
        heard: delays_ns.len() as u64,
        median_ms: share(0.5),
        p99_ms: share(0.99),
        max_ms: share(1.0),
        cpu_s,
    }
}
