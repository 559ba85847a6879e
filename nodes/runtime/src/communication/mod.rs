//! Publishers, subscriptions, services and actions, independent of the node that owns them.

pub(crate) mod action;
pub(crate) mod lifecycle_gate;
pub(crate) mod publisher;
pub(crate) mod service;
pub(crate) mod subscription;
