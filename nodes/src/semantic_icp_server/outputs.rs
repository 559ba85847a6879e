//! Publishers of the node.

use lattice_msgs::lattice::CalibrationResult;
use lattice_msgs::std_msgs::Empty;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher, TfBroadcaster, TfGuard};

use crate::start::NodeError;

/// Publishers of the node.
pub(super) struct Outputs {
    pub calibration: Publisher<CalibrationResult>,
    pub tf: TfBroadcaster,
    pub request: Publisher<Empty>,
}

impl Outputs {
    /// `mapper` receives keyframe requests.
    pub(super) fn open(node: &Node, mapper: &str, guard: &TfGuard) -> Result<Self, NodeError> {
        Ok(Self {
            calibration: node.publisher("calibration", Qos::latched(1))?,
            tf: TfBroadcaster::new(node, guard)?,
            request: node.publisher(&format!("{mapper}/request_keyframe"), Qos::DEFAULT)?,
        })
    }
}
