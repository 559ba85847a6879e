//! Diagnostics and outputs of the built-in network.

use std::sync::Arc;

use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::vision_msgs::LabelInfo;

use crate::camera::LabelSet;
use crate::segmenter::NetworkView;
use crate::start::NodeError;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher};

/// Publishers of the node's own labels.
pub(super) struct Outputs {
    /// State of the network.
    pub view: NetworkView,
    labels: Publisher<Image>,
    confidence: Publisher<Image>,
    label_info: Publisher<LabelInfo>,
}

impl Outputs {
    /// Creates the publishers of a `segmenter`.
    pub fn new(node: &Node, view: NetworkView) -> Result<Self, NodeError> {
        Ok(Self {
            view,
            labels: node.publisher("labels/image", Qos::SCANS)?,
            confidence: node.publisher("labels/confidence", Qos::SCANS)?,
            label_info: node.publisher("labels/label_info", Qos::LATCHED)?,
        })
    }

    /// Publishes labels.
    pub fn publish(&self, set: &LabelSet) {
        let confidence = set.confidence.as_ref();
        let confidence = confidence.map(|c| self.confidence.publish(Arc::clone(c)));
        let labels = self.labels.publish(Arc::clone(&set.labels));
        if let Err(error) = labels.and(confidence.unwrap_or(Ok(()))) {
            log::debug!("not published: {error}");
        }
    }

    /// Publishes and returns the class names; `None` if there are none.
    pub fn publish_names(&self) -> Option<Arc<LabelInfo>> {
        let info = Arc::new(self.view.label_info()?);
        if let Err(error) = self.label_info.publish(Arc::clone(&info)) {
            log::debug!("not published: {error}");
        }
        Some(info)
    }
}
