//! ROS graph of other processes: discovered endpoints and the nodes that own them.

use std::collections::BTreeMap;
use std::sync::Mutex;

use lattice_msgs::cdr::{self, CdrError};
use lattice_msgs::rmw_dds_common::{NodeEntitiesInfo, ParticipantEntitiesInfo};

use crate::config::names;
use crate::sync::lock;
use crate::transport::port::EndpointId;
use crate::transport::remote::{Announced, GraphRole};

/// Limit of stored endpoints.
const MAX_ENDPOINTS: usize = 8192;

/// Longest name of a topic, service or node, bytes.
const MAX_NAME_BYTES: usize = 512;

/// A publisher, subscription or server in the graph of nodes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GraphEndpoint {
    /// Role of the endpoint.
    pub role: GraphRole,
    /// Full name of the topic or service.
    pub name: String,
    /// Full name of its node, or its GUID in hexadecimal if no node claims it.
    pub node: String,
}

/// Publisher, subscription or server of another process, with type and QoS.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemoteEndpoint {
    /// Role, topic and node.
    pub endpoint: GraphEndpoint,
    /// Type and QoS; `None` for a server.
    pub announced: Option<Announced>,
    /// GUID prefix of its participant in hexadecimal, which begins with the id of the DDS vendor; `None` on Zenoh.
    pub participant: Option<String>,
}

/// Discovered endpoints by GUID.
#[derive(Default)]
pub(crate) struct DiscoveredGraph(Mutex<DiscoveredEndpoints>);

#[derive(Default)]
struct DiscoveredEndpoints {
    endpoints: BTreeMap<EndpointId, Known>,
    /// Full node name of each endpoint.
    nodes: BTreeMap<EndpointId, String>,
}

struct Known {
    role: GraphRole,
    name: String,
    announced: Option<Announced>,
    /// True if its identity is a GUID of DDS.
    is_dds: bool,
}

impl DiscoveredGraph {
    /// Adds or updates an endpoint. Transports that know its node are not DDS.
    pub(crate) fn add(
        &self,
        id: EndpointId,
        (role, name): (GraphRole, &str),
        announced: Option<Announced>,
        node: Option<String>,
    ) {
        let known = &mut *lock(&self.0);
        if name.len() > MAX_NAME_BYTES
            || (known.endpoints.len() >= MAX_ENDPOINTS && !known.endpoints.contains_key(&id))
        {
            return;
        }
        let endpoint = Known {
            role,
            name: name.to_owned(),
            announced,
            is_dds: node.is_none(),
        };
        known.endpoints.insert(id, endpoint);
        if let Some(node) = node.filter(|node| node.len() <= MAX_NAME_BYTES) {
            known.nodes.insert(id, node);
        }
    }

    /// Removes endpoints.
    pub(crate) fn remove(&self, gone: impl Fn(&EndpointId) -> bool) {
        let mut known = lock(&self.0);
        known.endpoints.retain(|id, _| !gone(id));
        known.nodes.retain(|id, _| !gone(id));
    }

    /// Handles a message of `ros_discovery_info`. GIDs have 24 bytes up to Humble and 16 bytes since; the two lengths
    /// cannot be confused. A participant's claims apply to its own endpoints only.
    pub(crate) fn on_message(&self, message: &[u8]) -> Result<(), CdrError> {
        match cdr::from_slice::<ParticipantEntitiesInfo<[u8; 16]>>(message) {
            Ok(message) => self.keep(message),
            Err(error) => match cdr::from_slice::<ParticipantEntitiesInfo<[u8; 24]>>(message) {
                Ok(message) => self.keep(message),
                Err(_) => return Err(error),
            },
        }
        Ok(())
    }

    fn keep<const N: usize>(&self, message: ParticipantEntitiesInfo<[u8; N]>) {
        let id = |gid: &[u8; N]| gid.first_chunk().copied().map(EndpointId);
        let Some(participant) = id(&message.gid) else {
            return;
        };
        let nodes = &mut lock(&self.0).nodes;
        nodes.retain(|id, _| !id.same_participant(&participant));
        for node in &message.node_entities_info_seq {
            let NodeEntitiesInfo {
                node_name,
                node_namespace,
                reader_gid_seq,
                writer_gid_seq,
            } = node;
            let name = names::fully_qualified(node_name, node_namespace);
            let ids = reader_gid_seq.iter().chain(writer_gid_seq).filter_map(id);
            for id in ids.filter(|id| id.same_participant(&participant)) {
                if nodes.len() < MAX_ENDPOINTS && name.len() <= MAX_NAME_BYTES {
                    nodes.insert(id, name.clone());
                }
            }
        }
    }

    /// All known endpoints.
    pub(crate) fn all(&self) -> Vec<GraphEndpoint> {
        let all = self.all_announced();
        all.into_iter().map(|of| of.endpoint).collect()
    }

    /// All discovered endpoints with type and QoS.
    pub(crate) fn all_announced(&self) -> Vec<RemoteEndpoint> {
        let known = lock(&self.0);
        let endpoint = |(id, of): (&EndpointId, &Known)| RemoteEndpoint {
            endpoint: GraphEndpoint {
                role: of.role,
                name: of.name.clone(),
                node: known.nodes.get(id).cloned().unwrap_or_else(|| id.hex()),
            },
            announced: of.announced.clone(),
            participant: of.is_dds.then(|| id.hex().chars().take(24).collect()),
        };
        known.endpoints.iter().map(endpoint).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WRITER: EndpointId = EndpointId([7; 16]);

    fn message(participant: u8, endpoint: [u8; 16]) -> Vec<u8> {
        of_identities([participant; 16], endpoint)
    }

    fn of_identities<G: serde::Serialize>(participant: G, endpoint: G) -> Vec<u8> {
        let node = NodeEntitiesInfo {
            node_namespace: "/robot".to_owned(),
            node_name: "mapper".to_owned(),
            reader_gid_seq: Vec::new(),
            writer_gid_seq: vec![endpoint],
        };
        cdr::to_vec(&ParticipantEntitiesInfo {
            gid: participant,
            node_entities_info_seq: vec![node],
        })
        .unwrap()
    }

    #[test]
    fn endpoints_are_of_the_nodes_that_their_participant_names() {
        let all = DiscoveredGraph::default();
        all.add(WRITER, (GraphRole::Publisher, "/map"), None, None);
        assert_eq!(all.all()[0].node, "07".repeat(16));
        all.on_message(&message(9, WRITER.0)).unwrap();
        assert_eq!(all.all()[0].node, "07".repeat(16), "said by another");
        all.on_message(&message(7, WRITER.0)).unwrap();
        let expected = GraphEndpoint {
            role: GraphRole::Publisher,
            name: "/map".to_owned(),
            node: "/robot/mapper".to_owned(),
        };
        assert_eq!(all.all(), std::slice::from_ref(&expected));
        all.on_message(&message(7, [8; 16])).unwrap();
        assert_eq!(all.all()[0].node, "07".repeat(16), "no longer its own");
        // As Humble says it.
        all.on_message(&of_identities([7_u8; 24], [7; 24])).unwrap();
        assert_eq!(all.all(), [expected]);
        all.remove(|id| *id == WRITER);
        assert!(all.all().is_empty());
    }

    #[test]
    fn what_is_sent_is_bounded_and_may_be_cut() {
        let all = DiscoveredGraph::default();
        let whole = message(7, WRITER.0);
        for length in 0..whole.len() {
            assert!(all.on_message(&whole[..length]).is_err(), "{length}");
        }
        let long = "x".repeat(MAX_NAME_BYTES + 1);
        all.add(WRITER, (GraphRole::Publisher, &long), None, None);
        assert!(all.all().is_empty());
        for i in 0..=MAX_ENDPOINTS as u128 {
            all.add(
                EndpointId(i.to_le_bytes()),
                (GraphRole::Subscriber, "/a"),
                None,
                None,
            );
        }
        assert_eq!(all.all().len(), MAX_ENDPOINTS);
    }
}
