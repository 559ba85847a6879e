//! HTTP subset for static files and one WebSocket, without I/O.

mod files;
mod head;
mod request_auth;

pub use head::{Head, HeadError, MAX_HEAD_BYTES};
pub use request_auth::{Decision, RequestAuth, Response};
