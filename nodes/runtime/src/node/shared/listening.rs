//! Graph of all nodes, from the messages of other participants.

use std::sync::Arc;

use super::Shared;
use crate::graph::discovered_graph::{GraphEndpoint, RemoteEndpoint};
use crate::graph::endpoints::Endpoints;
use crate::sync::lock;
use crate::transport::port::{GRAPH_TOPIC, SampleReader};

impl Shared {
    /// Known publishers, subscriptions and servers of all processes. The first call subscribes to the node lists
    /// of other processes.
    pub(crate) fn graph_of_all(self: &Arc<Self>) -> Vec<GraphEndpoint> {
        self.listen_to_graph();
        let mut all = self.graph.all();
        all.extend(self.endpoints.discovered_graph.all());
        all
    }

    /// Known endpoints of other processes; otherwise as [`Shared::graph_of_all`].
    pub(crate) fn remote_endpoints(self: &Arc<Self>) -> Vec<RemoteEndpoint> {
        self.listen_to_graph();
        self.endpoints.discovered_graph.all_announced()
    }

    fn listen_to_graph(self: &Arc<Self>) {
        if let Some(open) = lock(&self.open).as_mut()
            && open.graph_of_others.is_none()
        {
            open.graph_of_others = match open.transport.graph_reader() {
                None => None,
                Some(Ok(reader)) => self.io.spawn(listen(reader, Arc::clone(&self.endpoints))),
                Some(Err(error)) => {
                    log::warn!("node names of other processes are unavailable: {error}");
                    None
                }
            };
        }
    }
}

async fn listen(reader: Box<dyn SampleReader>, endpoints: Arc<Endpoints>) {
    loop {
        let heard = match reader.next().await {
            Ok(_) => {
                let heard = endpoints.discovered_graph.on_message(&reader.bytes());
                heard.map_err(|error| error.to_string())
            }
            Err(error) => Err(error),
        };
        if let Err(error) = heard {
            log::debug!("{GRAPH_TOPIC}: {error}");
        }
    }
}
