//! Waits for changes of the graph.

use std::error::Error;

use ros2_client::Context;

/// Waits until a node is in the graph, or is not.
pub fn wait(context: &Context, node: &str, expected: bool) -> Result<(), Box<dyn Error>> {
    // Before the first look, so that no change is missed.
    let changes = context.graph_event_stream();
    while context.node_names().iter().any(|name| name == node) != expected {
        changes.recv_blocking()?;
    }
    Ok(())
}
