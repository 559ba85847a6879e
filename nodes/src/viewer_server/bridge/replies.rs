//! Replies of nodes.

use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_runtime::CallError;

/// Timeout of a node's reply.
pub(super) const PATIENCE: Duration = Duration::from_secs(5);

/// Text of an error.
pub(super) fn words(error: impl ToString) -> String {
    error.to_string()
}

/// Decoded reply of a call.
pub(super) async fn answer<M: RosMessage>(
    call: impl Future<Output = Result<Vec<u8>, CallError>>,
) -> Result<M, String> {
    let cdr = call.await.map_err(words)?;
    lattice_msgs::cdr::from_slice(&cdr).map_err(words)
}
