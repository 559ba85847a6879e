//! Publishers of the node besides those of the map.

use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher};

use crate::start::NodeError;

/// Publishers of further topics.
pub(super) struct Outputs {
    pub centers: Publisher<PointCloud2>,
    pub free: Option<Publisher<LatticeMap>>,
}

impl Outputs {
    pub(super) fn open(node: &Node, has_free: bool) -> Result<Self, NodeError> {
        let free = has_free.then(|| node.publisher("free", Qos::MAP));
        Ok(Self {
            centers: node.publisher("map_centers", Qos::LATCHED)?,
            free: free.transpose()?,
        })
    }
}
