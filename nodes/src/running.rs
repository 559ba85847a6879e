//! Running nodes of a process, managed ones included.

use lattice_runtime::Runtime;
use lattice_runtime::lifecycle::{ChangeRequests, Lifecycle, Step};
use lattice_runtime::params::Params;

use crate::start::{Declare, Finish, NodeError, Servers, Start, check_topics};

/// Nodes of a process in the order of data flow.
#[derive(Default)]
pub struct Running {
    nodes: Vec<OneNode>,
    requests: ChangeRequests,
}

/// A node; it is active if it can be finished.
struct OneNode {
    name: String,
    start: Start,
    declare: Option<Declare>,
    finish: Option<Finish>,
    /// Lifecycle of a managed node.
    lifecycle: Option<Lifecycle>,
}

impl Running {
    /// Starts a node; one with the parameter `managed` waits to be configured and activated.
    ///
    /// Until then its parameters can be set; `declare` declares them.
    pub fn start(
        &mut self,
        runtime: &Runtime,
        name: &str,
        start: Start,
        declare: Option<Declare>,
    ) -> Result<(), NodeError> {
        let node = runtime.node(name)?;
        let lifecycle = match node.params().bool("managed", false)? {
            true => Some(Lifecycle::serve(&node, self.nodes.len(), &self.requests)?),
            false => None,
        };
        let mut one = OneNode {
            name: name.to_owned(),
            start,
            declare,
            finish: None,
            lifecycle,
        };
        match one.lifecycle {
            Some(_) => {
                if let Some(Err(error)) = declare.map(|declare| declare(node.params())) {
                    log::warn!("{name} cannot be configured until this is corrected: {error}");
                }
                one.wait(runtime);
            }
            None => one.finish = Some(start(runtime, name)?),
        }
        self.nodes.push(one);
        Ok(())
    }

    /// Serves managed nodes until a shutdown request, then lets each node process its inbox, publish the
    /// results and end.
    pub fn until_stopped(mut self, runtime: &Runtime) -> Result<(), NodeError> {
        self.check_topics(runtime)?;
        while let Some(change) = self.requests.next(&runtime.shutdown_handle()) {
            if let Some(node) = self.nodes.get_mut(change.node)
                && let Some(lifecycle) = node.lifecycle.take()
            {
                lifecycle.change(change, |step| node.take(runtime, step));
                node.lifecycle = Some(lifecycle);
            }
        }
        self.requests.end();
        // In the order of data flow, so that each node receives the last messages of its predecessor.
        let mut servers = Vec::new();
        for node in &mut self.nodes {
            runtime.work_off();
            servers.extend(node.end(runtime));
        }
        Ok(runtime.spin()?)
    }

    /// Rejects `qos` parameters of topics that no node has.
    fn check_topics(&self, runtime: &Runtime) -> Result<(), NodeError> {
        let nodes = self.nodes.iter().map(|node| runtime.node(&node.name));
        let nodes = nodes.collect::<Result<Vec<_>, _>>()?;
        // An unconfigured managed node has no topics yet.
        let waits = self.nodes.iter().any(|node| node.finish.is_none());
        let has = |name: &str| waits || nodes.iter().any(|node| node.params().has(name));
        let at_work = self.nodes.iter().zip(&nodes);
        for (_, node) in at_work.filter(|(one, _)| one.finish.is_some()) {
            check_topics(node.params(), has)?;
        }
        Ok(())
    }
}

impl OneNode {
    /// Makes parameters settable while the node is not configured: they are checked now and used later.
    fn wait(&self, runtime: &Runtime) {
        if let (Ok(node), Some(declare)) = (runtime.node(&self.name), self.declare) {
            let check = move |wanted: &Params| declare(wanted).map_err(|error| error.to_string());
            node.params().open(check);
        }
    }

    /// Makes parameters read-only while they are read or the node ends.
    fn freeze(&self, runtime: &Runtime) {
        if let Ok(node) = runtime.node(&self.name) {
            node.params().close();
        }
    }

    /// Ends an active node.
    fn end(&mut self, runtime: &Runtime) -> Option<Servers> {
        let finish = self.finish.take()?;
        self.freeze(runtime);
        Some(finish())
    }

    fn take(&mut self, runtime: &Runtime, step: Step) -> Result<(), String> {
        match step {
            Step::Configure => {
                self.freeze(runtime);
                match (self.start)(runtime, &self.name) {
                    Ok(finish) => self.finish = Some(finish),
                    Err(error) => {
                        self.wait(runtime);
                        return Err(error.to_string());
                    }
                }
            }
            Step::Cleanup => {
                drop(self.end(runtime));
                self.wait(runtime);
            }
            Step::Shutdown => {
                self.freeze(runtime);
                drop(self.end(runtime));
            }
            Step::Activate | Step::Deactivate => {}
        }
        Ok(())
    }
}
