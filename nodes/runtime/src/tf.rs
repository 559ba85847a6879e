//! Broadcasters of transforms.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::tf2_msgs::TFMessage;

use super::error::{PublishError, RuntimeError};
use super::node::Node;
use super::publisher::Publisher;
use super::qos::Qos;
use super::sync::lock;

/// Broadcaster of dynamic transforms, on `/tf`.
#[derive(Clone)]
pub struct TfBroadcaster {
    publisher: Publisher<TFMessage>,
}

impl TfBroadcaster {
    /// Creates a broadcaster on the node's `/tf`.
    pub fn new(node: &Node) -> Result<Self, RuntimeError> {
        Ok(Self {
            publisher: node.publisher("/tf", Qos::TF)?,
        })
    }

    /// Publishes transforms at their stamps.
    pub fn send(&self, transforms: Vec<TransformStamped>) -> Result<(), PublishError> {
        self.publisher.publish(TFMessage { transforms })
    }
}

/// Broadcaster of static transforms, on `/tf_static`: all of them in one latched message.
#[derive(Clone)]
pub struct StaticTfBroadcaster {
    publisher: Publisher<TFMessage>,
    all: Arc<Mutex<BTreeMap<String, TransformStamped>>>,
}

impl StaticTfBroadcaster {
    /// Creates a broadcaster on the node's `/tf_static`. One per node: two would replace each other's message.
    pub fn new(node: &Node) -> Result<Self, RuntimeError> {
        Ok(Self {
            publisher: node.publisher("/tf_static", Qos::TF_STATIC)?,
            all: Arc::default(),
        })
    }

    /// Adds transforms, or replaces those of the same child frame, and publishes all.
    pub fn send(
        &self,
        transforms: impl IntoIterator<Item = TransformStamped>,
    ) -> Result<(), PublishError> {
        let mut all = lock(&self.all);
        all.extend(
            transforms
                .into_iter()
                .map(|t| (t.child_frame_id.clone(), t)),
        );
        let transforms = all.values().cloned().collect();
        self.publisher.publish(TFMessage { transforms })
    }
}
