//! Publishers of the node.

use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher};

use crate::start::NodeError;

/// The topics that the node speaks on.
pub(super) struct Outputs {
    pub map: Publisher<LatticeMap>,
    pub updates: Publisher<LatticeMapUpdate>,
    pub centers: Publisher<PointCloud2>,
    pub free: Option<Publisher<LatticeMap>>,
}

impl Outputs {
    pub(super) fn open(node: &Node, has_free: bool) -> Result<Self, NodeError> {
        let free = has_free.then(|| node.publisher("free", Qos::MAP));
        Ok(Self {
            map: node.publisher("map", Qos::MAP)?,
            updates: node.publisher("map_updates", Qos::DELTAS)?,
            centers: node.publisher("map_centers", Qos::LATCHED)?,
            free: free.transpose()?,
        })
    }
}
