//! Broadcasters of transforms.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::tf2_msgs::TFMessage;

use super::logical_node::Node;
use super::tf_guard::TfGuard;
use crate::communication::publisher::Publisher;
use crate::error::{PublishError, RuntimeError};
use crate::sync::lock;
use crate::transport::qos::Qos;

/// Broadcaster of dynamic transforms, on `/tf`.
#[derive(Clone)]
pub struct TfBroadcaster {
    publisher: Publisher<TFMessage>,
    guard: TfGuard,
}

impl TfBroadcaster {
    /// Creates a broadcaster on the node's `/tf`.
    pub fn new(node: &Node, guard: &TfGuard) -> Result<Self, RuntimeError> {
        Ok(Self {
            publisher: node.publisher("/tf", Qos::TF)?,
            guard: guard.clone(),
        })
    }

    /// Publishes transforms at their stamps, except those into frames whose parent another node publishes.
    pub fn send(&self, mut transforms: Vec<TransformStamped>) -> Result<(), PublishError> {
        self.guard.retain(&mut transforms);
        publish(&self.publisher, &self.guard, transforms)
    }
}

/// Broadcaster of static transforms, on `/tf_static`: all of them in one latched message.
#[derive(Clone)]
pub struct StaticTfBroadcaster {
    publisher: Publisher<TFMessage>,
    guard: TfGuard,
    all: Arc<Mutex<BTreeMap<String, TransformStamped>>>,
}

impl StaticTfBroadcaster {
    /// Creates a broadcaster on the node's `/tf_static`. One per node: two would replace each other's message.
    pub fn new(node: &Node, guard: &TfGuard) -> Result<Self, RuntimeError> {
        Ok(Self {
            publisher: node.publisher("/tf_static", Qos::TF_STATIC)?,
            guard: guard.clone(),
            all: Arc::default(),
        })
    }

    /// Adds transforms, or replaces those of the same child frame, and publishes all, except those into frames
    /// whose parent another node publishes.
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
        let mut transforms = all.values().cloned().collect();
        self.guard.retain(&mut transforms);
        publish(&self.publisher, &self.guard, transforms)
    }
}

/// Publishes transforms, if any, as a message of this node.
fn publish(
    publisher: &Publisher<TFMessage>,
    guard: &TfGuard,
    transforms: Vec<TransformStamped>,
) -> Result<(), PublishError> {
    if transforms.is_empty() {
        return Ok(());
    }
    let message = Arc::new(TFMessage { transforms });
    guard.own(&message);
    publisher.publish(message)
}
