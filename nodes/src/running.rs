//! Nodes of a process at work, and those that others manage.

use lattice_runtime::Runtime;
use lattice_runtime::lifecycle::{ChangeRequests, Lifecycle, Step};

use crate::start::{Finish, NodeError, Servers, Start};

/// The nodes of a process, in the order in which data flows.
#[derive(Default)]
pub struct Running {
    nodes: Vec<OneNode>,
    requests: ChangeRequests,
}

/// A node, which is at work if it can be finished.
struct OneNode {
    name: String,
    start: Start,
    finish: Option<Finish>,
    /// Of a managed node.
    lifecycle: Option<Lifecycle>,
}

impl Running {
    /// Starts a node; one whose parameter `managed` is true waits to be configured and activated.
    pub fn start(&mut self, runtime: &Runtime, name: &str, start: Start) -> Result<(), NodeError> {
        let node = runtime.node(name)?;
        let lifecycle = match node.params().bool("managed", false)? {
            true => Some(Lifecycle::serve(&node, self.nodes.len(), &self.requests)?),
            false => None,
        };
        let finish = match lifecycle {
            Some(_) => None,
            None => Some(start(runtime, name)?),
        };
        self.nodes.push(OneNode {
            name: name.to_owned(),
            start,
            finish,
            lifecycle,
        });
        Ok(())
    }

    /// Serves managed nodes until the end is asked for, lets each node work off its inbox and publish the
    /// rest, and leaves.
    pub fn until_stopped(mut self, runtime: &Runtime) -> Result<(), NodeError> {
        while let Some(change) = self.requests.next(&runtime.shutdown_handle()) {
            if let Some(node) = self.nodes.get_mut(change.node)
                && let Some(lifecycle) = node.lifecycle.take()
            {
                lifecycle.change(change, |step| node.take(runtime, step));
                node.lifecycle = Some(lifecycle);
            }
        }
        self.requests.end();
        // In the order in which data flows, so that each still gets what the one before publishes.
        let mut servers = Vec::new();
        for node in &mut self.nodes {
            runtime.work_off();
            servers.extend(node.end(runtime));
        }
        Ok(runtime.spin()?)
    }
}

impl OneNode {
    /// Ends the node if it is at work.
    fn end(&mut self, runtime: &Runtime) -> Option<Servers> {
        let finish = self.finish.take()?;
        if let Ok(node) = runtime.node(&self.name) {
            node.params().close();
        }
        Some(finish())
    }

    fn take(&mut self, runtime: &Runtime, step: Step) -> Result<(), String> {
        match step {
            Step::Configure => {
                let started = (self.start)(runtime, &self.name);
                self.finish = Some(started.map_err(|error| error.to_string())?);
            }
            Step::Cleanup | Step::Shutdown => {
                drop(self.end(runtime));
            }
            Step::Activate | Step::Deactivate => {}
        }
        Ok(())
    }
}
