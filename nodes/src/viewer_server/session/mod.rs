//! Session of a client: its protocol state, what it is offered, and the messages that it publishes.

mod client_session;
mod inputs;
mod offer;
mod session_action;

pub use client_session::ClientSession;
pub use inputs::{Input, InputCounts, InputRefusal, Inputs, Waiting};
pub use offer::{MAX_MESSAGE_BYTES, MESSAGE_HEAD_BYTES, Offer, OpenTopic};
pub use session_action::{BridgeRequest, SessionAction};
