//! Results of calibrations, as a node of the demo hears them.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, unbounded};
use lattice_msgs::calibration::CalibrationResult;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Load, LoopbackDomain, Runtime, Subscription};

use crate::CliResult;

/// Time for an answer after the last look.
const LAST_ANSWER: Duration = Duration::from_secs(60);

/// Node of this process that hears of calibrations.
pub struct Results {
    heard: Receiver<Arc<CalibrationResult>>,
    _subscription: Subscription,
    _runtime: Runtime,
}

impl Results {
    /// Starts the node.
    pub fn listen(domain: Option<&LoopbackDomain>) -> CliResult<Self> {
        let mut network = Network::from_env()?;
        network.localhost_only = true;
        if let Some(domain) = domain {
            network.domain_id = domain.id();
        }
        let args = RosArgs::parse(["--ros-args".to_owned()])?;
        let runtime = Runtime::with_transport("lattice_demo", args, &network)?;
        let node = runtime.node("lattice_demo")?;
        let (tell, heard) = unbounded();
        let on_result = move |result: Arc<CalibrationResult>| {
            // Nobody listens any more at the end.
            let _ = tell.send(result);
        };
        let subscription = node.subscribe("calibration", Qos::LATCHED, Load::Small, on_result)?;
        Ok(Self {
            heard,
            _subscription: subscription,
            _runtime: runtime,
        })
    }

    /// The last result after the log, the first that is OK if none was before, and the time of the longest answer, s:
    /// that of a search, as looks at a known place take little.
    pub fn last(&self) -> (Option<Arc<CalibrationResult>>, f64) {
        let mut last: Option<Arc<CalibrationResult>> = None;
        let mut longest_s = 0.0;
        let late = Instant::now() + LAST_ANSWER;
        let is_ok = |last: &Option<Arc<CalibrationResult>>| {
            last.as_ref()
                .is_some_and(|last| last.verdict == CalibrationResult::OK)
        };
        loop {
            // All that has come by now.
            let news = match is_ok(&last) {
                false => self.heard.recv_deadline(late).ok(),
                true => self.heard.try_recv().ok(),
            };
            let Some(result) = news else {
                return (last, longest_s);
            };
            longest_s = f64::max(longest_s, result.duration_s);
            last = Some(result);
        }
    }
}
