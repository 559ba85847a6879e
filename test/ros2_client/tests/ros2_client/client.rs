//! Nodes and messages of ros2-client, as a peer of the runtime.

use std::time::Duration;

use lattice_runtime::LoopbackDomain;
use lattice_runtime::env::Network;
use ros2_client::qos::WhenFull;
use ros2_client::{Context, Message, Node, NodeName, NodeOptions, QosProfile, ServiceMapping};
use rustdds::DomainParticipantBuilder;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Long enough for a loaded machine; a test that passes does not wait for it.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A domain on loopback that no other test uses while this lives.
pub struct Domain(LoopbackDomain);

impl Domain {
    pub fn take() -> Self {
        Self(LoopbackDomain::take().unwrap())
    }

    pub fn network(&self) -> Network {
        Network {
            domain_id: self.0.id(),
            localhost_only: true,
            ..Network::from_env().unwrap()
        }
    }
}

/// Gives one of our messages to ros2-client.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Foreign<M>(pub M);

impl<M: Serialize + DeserializeOwned> Message for Foreign<M> {}

/// A node of ros2-client with its spinner running.
pub fn peer(domain: &Domain) -> Node {
    let participant = DomainParticipantBuilder::new(domain.0.id())
        .with_only_networks([std::net::Ipv4Addr::LOCALHOST])
        .build()
        .unwrap();
    let context = Context::from_domain_participant(participant).unwrap();
    let options = NodeOptions::new().start_parameter_services(false);
    let name = NodeName::new("/", "peer").unwrap();
    let mut node = context.new_node(name, options).unwrap();
    let spinner = node.spinner().unwrap();
    smol::spawn(spinner.spin()).detach();
    node
}

/// Quality of service of clients.
pub fn reliable() -> QosProfile {
    QosProfile::publisher_default().reliability_reliable(WhenFull::Fail)
}

/// Forms of requests.
pub const MAPPINGS: [ServiceMapping; 2] = [ServiceMapping::Enhanced, ServiceMapping::Cyclone];
