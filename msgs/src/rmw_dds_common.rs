//! ROS graph, as published by each participant.
//!
//! `G` is the GID type: [`Gid`], or one of another length, as in distributions before Iron.

use serde::{Deserialize, Serialize};

use crate::interface::{MessageVisitor, RosMessage, Schema};

/// GID of an endpoint or a participant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gid {
    /// GUID of the participant or endpoint.
    pub data: [u8; 16],
}

/// A node and its endpoints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NodeEntitiesInfo<G = Gid> {
    /// With the first slash.
    pub node_namespace: String,
    /// Without the namespace.
    pub node_name: String,
    /// GIDs of the subscriptions of the node.
    pub reader_gid_seq: Vec<G>,
    /// GIDs of the publishers of the node.
    pub writer_gid_seq: Vec<G>,
}

/// The nodes of a participant.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParticipantEntitiesInfo<G = Gid> {
    /// The participant.
    pub gid: G,
    /// Nodes of the participant.
    pub node_entities_info_seq: Vec<NodeEntitiesInfo<G>>,
}

macro_rules! messages {
    ($($name:ident [$($dependency:ident),*];)*) => {
        $(impl RosMessage for $name {
            const SCHEMA: &'static Schema = &Schema {
                type_name: concat!("rmw_dds_common/msg/", stringify!($name)),
                text: include_str!(concat!("../definitions/rmw_dds_common/", stringify!($name), ".msg")),
                dependencies: &[$(<$dependency as RosMessage>::SCHEMA),*],
            };
        })*

        pub(crate) fn visit_messages(visitor: &mut impl MessageVisitor) {
            $(visitor.visit::<$name>();)*
        }
    };
}

messages! {
    Gid [];
    NodeEntitiesInfo [Gid];
    ParticipantEntitiesInfo [Gid, NodeEntitiesInfo];
}
