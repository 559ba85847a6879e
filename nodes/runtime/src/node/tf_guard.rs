//! Frames whose parent another publisher gives: REP 105 allows a frame one parent.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::tf2_msgs::TFMessage;

use super::logical_node::Node;
use crate::communication::subscription::{Subscription, SubscriptionExecutor};
use crate::error::RuntimeError;
use crate::sync::lock;
use crate::transport::qos::Qos;

/// Time after which the last transform of a frame on `/tf` no longer counts: the cache of tf2.
const CACHE_TIME: Duration = Duration::from_secs(10);

/// Limit of stored frames.
const MAX_FRAMES: usize = 10_000;

/// Parameter to set, of a transform and the root of the other publisher's tree.
type Remedy = dyn Fn(&TransformStamped, &str) -> String + Send + Sync;

/// Withholds transforms of a node into frames whose parent another publisher gives. Clones share their state.
#[derive(Clone)]
pub struct TfGuard {
    state: Arc<Mutex<State>>,
    remedy: Arc<Remedy>,
}

#[derive(Default)]
struct State {
    /// Messages of this node that may still be delivered to it.
    own: Vec<Weak<TFMessage>>,
    parents: BTreeMap<String, Parent>,
    /// Frames after their warning.
    logged: BTreeSet<String>,
}

struct Parent {
    frame: String,
    /// Time of the newest transform; `None`: on `/tf_static`.
    newest: Option<Instant>,
}

impl TfGuard {
    /// A guard without transforms of others. `remedy`: the parameter to set, of a withheld transform and the root
    /// of the other tree.
    pub fn new(remedy: impl Fn(&TransformStamped, &str) -> String + Send + Sync + 'static) -> Self {
        Self {
            state: Arc::default(),
            remedy: Arc::new(remedy),
        }
    }

    /// Notes the transforms of a message on `/tf` or `/tf_static`, unless this node has published it.
    pub fn on_message(&self, message: &Arc<TFMessage>, is_static: bool) {
        self.note(message, is_static, Instant::now());
    }

    /// Subscribes to the transforms of others, for a node that needs them for nothing else.
    pub fn subscribe(&self, node: &Node) -> Result<[Subscription; 2], RuntimeError> {
        let subscribe = |topic, qos, is_static| {
            let guard = self.clone();
            let note = move |message: Arc<TFMessage>| guard.on_message(&message, is_static);
            node.subscribe(topic, qos, SubscriptionExecutor::Shared, note)
        };
        Ok([
            subscribe("/tf", Qos::TF, false)?,
            subscribe("/tf_static", Qos::TF_STATIC_LISTENER, true)?,
        ])
    }

    fn note(&self, message: &Arc<TFMessage>, is_static: bool, now: Instant) {
        let mut state = lock(&self.state);
        let published = |own: &Weak<TFMessage>| std::ptr::eq(own.as_ptr(), Arc::as_ptr(message));
        if state.own.iter().any(published) {
            return;
        }
        for transform in &message.transforms {
            let child = name(&transform.child_frame_id);
            let parents = &mut state.parents;
            if parents.len() >= MAX_FRAMES && !parents.contains_key(child) {
                continue;
            }
            let newest = (!is_static).then_some(now);
            let frame = name(&transform.header.frame_id);
            match parents.get_mut(child) {
                Some(parent) if parent.frame == frame => parent.newest = newest,
                _ => {
                    let frame = frame.to_owned();
                    parents.insert(child.to_owned(), Parent { frame, newest });
                }
            }
        }
    }

    /// Notes a message of this node.
    pub(crate) fn own(&self, message: &Arc<TFMessage>) {
        let own = &mut lock(&self.state).own;
        own.retain(|message| message.strong_count() > 0);
        own.push(Arc::downgrade(message));
    }

    /// Withholds transforms into frames of other publishers, with one warning for each frame.
    pub(crate) fn retain(&self, transforms: &mut Vec<TransformStamped>) {
        for line in self.retain_at(transforms, Instant::now()) {
            log::warn!("{line}");
        }
    }

    fn retain_at(&self, transforms: &mut Vec<TransformStamped>, now: Instant) -> Vec<String> {
        let state = &mut *lock(&self.state);
        let mut lines = Vec::new();
        transforms.retain(|transform| {
            let child = name(&transform.child_frame_id);
            let Some(parent) = state.parent(child, now) else {
                return true;
            };
            if !state.logged.contains(child) {
                let ours = name(&transform.header.frame_id);
                let remedy = (self.remedy)(transform, state.root(parent, now));
                lines.push(format!(
                    "{ours} -> {child} is not published: another node publishes {parent} -> {child}, and a frame has \
                     one parent; set {remedy}"
                ));
                state.logged.insert(child.to_owned());
            }
            false
        });
        lines
    }
}

impl State {
    /// Parent of a frame by another publisher.
    fn parent(&self, child: &str, now: Instant) -> Option<&str> {
        let parent = self.parents.get(child)?;
        let age = parent.newest.map(|newest| now.duration_since(newest));
        age.is_none_or(|age| age < CACHE_TIME)
            .then_some(&*parent.frame)
    }

    /// Root of the tree of others above a frame.
    fn root<'a>(&'a self, frame: &'a str, now: Instant) -> &'a str {
        let mut root = frame;
        // Bounded in a cycle.
        for _ in 0..self.parents.len() {
            match self.parent(root, now) {
                Some(parent) => root = parent,
                None => break,
            }
        }
        root
    }
}

/// Name of a frame without the slash of tf.
fn name(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transform(parent: &str, child: &str) -> TransformStamped {
        let mut transform = TransformStamped::default();
        transform.header.frame_id = parent.to_owned();
        transform.child_frame_id = child.to_owned();
        transform
    }

    fn message(parent: &str, child: &str) -> Arc<TFMessage> {
        Arc::new(TFMessage {
            transforms: vec![transform(parent, child)],
        })
    }

    fn guard() -> TfGuard {
        TfGuard::new(|of, root| format!("{} below {root}", of.child_frame_id))
    }

    /// True if `map` -> `child` is published, and the lines of the log.
    fn sent(guard: &TfGuard, child: &str, now: Instant) -> (bool, Vec<String>) {
        let mut transforms = vec![transform("map", child)];
        let lines = guard.retain_at(&mut transforms, now);
        (!transforms.is_empty(), lines)
    }

    #[test]
    fn nothing_is_published_into_the_tree_of_another_and_it_is_logged_once() {
        let (guard, now) = (guard(), Instant::now());
        assert_eq!(sent(&guard, "base_link", now), (true, vec![]));
        guard.note(&message("odom", "base_footprint"), false, now);
        guard.note(&message("/base_footprint", "/base_link"), true, now);
        let line = "map -> base_link is not published: another node publishes base_footprint -> base_link, and a \
            frame has one parent; set base_link below odom";
        assert_eq!(
            sent(&guard, "base_link", now),
            (false, vec![line.to_owned()])
        );
        assert_eq!(sent(&guard, "base_link", now), (false, vec![]));
        assert_eq!(sent(&guard, "odom", now), (true, vec![]));
        // The same edge is a second publisher of it.
        guard.note(&message("map", "odom"), false, now);
        assert!(!sent(&guard, "odom", now).0);
    }

    #[test]
    fn messages_of_this_node_are_its_own() {
        let (guard, now) = (guard(), Instant::now());
        let (own, same) = (message("map", "base_link"), message("map", "base_link"));
        guard.own(&own);
        guard.own(&message("map", "odom"));
        guard.note(&own, false, now);
        guard.note(&own, false, now);
        assert!(sent(&guard, "base_link", now).0);
        guard.note(&same, false, now);
        assert!(!sent(&guard, "base_link", now).0);
        assert_eq!(lock(&guard.state).own.len(), 2);
        guard.own(&same);
        assert_eq!(
            lock(&guard.state).own.len(),
            2,
            "delivered ones are dropped"
        );
    }

    #[test]
    fn a_publisher_that_has_ended_counts_as_long_as_the_cache_of_tf2() {
        let (guard, now) = (guard(), Instant::now());
        guard.note(&message("odom", "base_link"), false, now);
        guard.note(&message("world", "map"), true, now);
        assert!(!sent(&guard, "base_link", now + CACHE_TIME / 2).0);
        assert!(sent(&guard, "base_link", now + CACHE_TIME).0);
        assert!(!sent(&guard, "map", now + CACHE_TIME).0, "static");
    }

    #[test]
    fn cycles_and_many_frames_are_bounded() {
        let (guard, now) = (guard(), Instant::now());
        guard.note(&message("a", "b"), false, now);
        guard.note(&message("b", "a"), false, now);
        assert!(!sent(&guard, "a", now).0);
        for i in 0..=MAX_FRAMES {
            guard.note(&message("a", &i.to_string()), false, now);
        }
        assert_eq!(lock(&guard.state).parents.len(), MAX_FRAMES);
    }
}
