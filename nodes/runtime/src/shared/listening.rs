//! The graph of all nodes, of which other participants publish their parts.

use std::sync::Arc;

use super::Shared;
use crate::discovered_graph::GraphEndpoint;
use crate::endpoints::Endpoints;
use crate::port::{GRAPH_TOPIC, SampleReader};
use crate::sync::lock;

impl Shared {
    /// Publishers, subscriptions and servers that are known by now, of all processes. The first call begins
    /// to listen for the names of nodes elsewhere.
    pub(crate) fn graph_of_all(self: &Arc<Self>) -> Vec<GraphEndpoint> {
        if let Some(open) = lock(&self.open).as_mut()
            && open.graph_of_others.is_none()
        {
            open.graph_of_others = match open.transport.graph_reader() {
                None => None,
                Some(Ok(reader)) => self.io.spawn(listen(reader, Arc::clone(&self.endpoints))),
                Some(Err(error)) => {
                    log::warn!("nodes elsewhere have no names: {error}");
                    None
                }
            };
        }
        let mut all = self.graph.all();
        all.extend(self.endpoints.discovered_graph.all());
        all
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
