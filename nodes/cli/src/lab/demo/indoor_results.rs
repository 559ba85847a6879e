//! Results of calibrations, as a node of the demo receives them.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, RecvTimeoutError, unbounded};
use lattice_msgs::lattice::CalibrationResult;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, Shutdown, Subscription, SubscriptionExecutor};

use crate::CliResult;

/// Time for the first answer after the log, and for a better one after it.
const FIRST_ANSWER: Duration = Duration::from_secs(240);
const NEXT_ANSWER: Duration = Duration::from_secs(60);
/// The same by the time of the longest answer, for machines that are busy.
const NEXT_ANSWERS: f64 = 3.0;
/// Longest sleep between two looks at the shutdown flag.
const NAP: Duration = Duration::from_millis(100);

/// Node of this process that receives calibrations.
pub struct Results {
    heard: Receiver<Arc<CalibrationResult>>,
    shutdown: Shutdown,
    _subscription: Subscription,
    _runtime: Runtime,
}

impl Results {
    /// Starts the node.
    pub fn listen(domain: &LoopbackDomain) -> CliResult<Self> {
        let mut network = Network::from_env()?;
        network.localhost_only = true;
        network.domain_id = domain.id();
        network.static_peers.clear();
        let args = RosArgs::parse(["--ros-args".to_owned()])?;
        let runtime = Runtime::with_transport("lattice_demo", args, &network)?;
        let node = runtime.node("lattice_demo")?;
        let (tell, heard) = unbounded();
        let on_result = move |result: Arc<CalibrationResult>| {
            // Nobody listens any more at the end.
            let _ = tell.send(result);
        };
        let subscription = node.subscribe(
            "calibration",
            Qos::LATCHED,
            SubscriptionExecutor::Shared,
            on_result,
        )?;
        Ok(Self {
            heard,
            shutdown: runtime.shutdown_handle(),
            _subscription: subscription,
            _runtime: runtime,
        })
    }

    /// True once a signal has asked this process to end.
    pub fn is_interrupted(&self) -> bool {
        self.shutdown.is_requested()
    }

    /// Blocks until a signal asks this process to end.
    pub fn until_interrupted(&self) {
        self.shutdown.wait();
    }

    /// The last result after the log, the first that is OK if none was before, and the time of the longest answer, s:
    /// that of a search, as looks at a known place take little. Returns early on a signal.
    pub fn last(&self) -> (Option<Arc<CalibrationResult>>, f64) {
        let mut last: Option<Arc<CalibrationResult>> = None;
        let mut longest_s = 0.0;
        let mut late = Instant::now() + FIRST_ANSWER;
        let is_ok = |last: &Option<Arc<CalibrationResult>>| {
            last.as_ref()
                .is_some_and(|last| last.verdict == CalibrationResult::OK)
        };
        loop {
            // All that has come by now.
            let nap = match is_ok(&last) {
                false => NAP,
                true => Duration::ZERO,
            };
            match self.heard.recv_timeout(nap) {
                Ok(result) => {
                    longest_s = f64::max(longest_s, result.duration_s);
                    last = Some(result);
                    let next = NEXT_ANSWER.as_secs_f64().max(NEXT_ANSWERS * longest_s);
                    late = Instant::now() + Duration::from_secs_f64(next.min(3600.0));
                }
                Err(RecvTimeoutError::Timeout)
                    if !is_ok(&last) && Instant::now() < late && !self.is_interrupted() => {}
                Err(_) => return (last, longest_s),
            }
        }
    }
}
