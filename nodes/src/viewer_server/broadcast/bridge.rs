//! Port through which clients reach nodes.

use futures::future::BoxFuture;

use super::outbox::Outgoing;
use crate::viewer_server::session::{BridgeRequest, Input, InputRefusal, Inputs, Offer};

/// Executes requests of clients.
pub trait Bridge: Send + Sync {
    /// Capabilities offered to clients.
    fn offer(&self) -> &Offer;

    /// Executes a request; returns messages for the client. Dropping the future cancels it.
    fn request(&self, request: BridgeRequest) -> BoxFuture<'static, Vec<Outgoing>>;

    /// Queues a client's message for a headset topic without blocking, or returns the reason for its rejection.
    fn take(&self, client: u64, input: Input) -> Result<(), InputRefusal>;

    /// Counters of headset messages.
    fn inputs(&self) -> &Inputs;
}
