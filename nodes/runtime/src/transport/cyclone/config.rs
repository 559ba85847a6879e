//! Configuration of Cyclone from the settings of ROS and `CYCLONEDDS_URI`.

use std::process;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::config::env::Network;
use crate::transport::port::RECEIVE_BUFFER_BYTES;

/// Participant indices to probe on a host without multicast. Other implementations probe fewer, but answer
/// any probe.
const MAX_PARTICIPANTS: u32 = 120;

/// Period of participant announcements (SPDP). A participant suspended for longer than its lease is
/// rediscovered within this time.
const ANNOUNCEMENT_PERIOD: &str = "2s";

/// Delay of a reader's first ACKNACK after the match. Cyclone's default of 10 ms dominates the latency of a
/// request that arrives before discovery has finished.
const FIRST_QUESTION: &str = "1ms";

/// Longest wait of a deleted writer for acknowledgements, one writer after the other. Those that are to be sent are
/// waited for before; Cyclone's default is 1 s.
const LINGER_TIME: &str = "50ms";

/// Argument of `dds_create_domain`: comma-separated fragments, of which later ones override earlier ones.
pub(super) fn config(network: &Network, cyclonedds_uri: Option<&str>) -> String {
    let general = match network.localhost_only {
        true => {
            "<General><Interfaces><NetworkInterface address=\"127.0.0.1\" multicast=\"false\"/>\
             </Interfaces><AllowMulticast>false</AllowMulticast></General>"
        }
        false => "",
    };
    let mut peers: Vec<&str> = network.static_peers.iter().map(String::as_str).collect();
    if network.localhost_only && !network.discovery_off {
        peers.push("127.0.0.1");
    }
    let peers: String = peers
        .iter()
        .map(|peer| format!("<Peer Address=\"{peer}\"/>"))
        .collect();
    // Without an index any port is used; a separate tag keeps other participants out.
    let (index, tag) = match network.discovery_off {
        true => ("none", format!("<Tag>{}</Tag>", own_tag())),
        false => ("auto", String::new()),
    };
    let ours = format!(
        "<CycloneDDS><Domain id=\"any\">{general}<Discovery>\
         <ParticipantIndex>{index}</ParticipantIndex>{tag}\
         <MaxAutoParticipantIndex>{}</MaxAutoParticipantIndex>\
         <SPDPInterval>{ANNOUNCEMENT_PERIOD}</SPDPInterval><Peers>{peers}</Peers></Discovery>\
         <Internal><PreEmptiveAckDelay>{FIRST_QUESTION}</PreEmptiveAckDelay>\
         <WriterLingerDuration>{LINGER_TIME}</WriterLingerDuration>\
         <SocketReceiveBufferSize max=\"{RECEIVE_BUFFER_BYTES}B\"/></Internal>\
         </Domain></CycloneDDS>",
        MAX_PARTICIPANTS - 1
    );
    match cyclonedds_uri.filter(|uri| !uri.is_empty()) {
        Some(uri) => format!("{ours},{uri}"),
        None => ours,
    }
}

/// Discovery tag unique to this process.
fn own_tag() -> String {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
    let nanoseconds = since_1970.unwrap_or_default().as_nanos();
    format!("lattice_{}_{nanoseconds}", process::id())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::env::TransportKind;
    use crate::config::env::ZenohSettings;

    #[test]
    fn the_environment_decides_on_interfaces_and_peers() {
        let network = |localhost_only, static_peers: &[&str]| Network {
            domain_id: 0,
            localhost_only,
            discovery_off: false,
            static_peers: static_peers.iter().map(ToString::to_string).collect(),
            transport: TransportKind::Dds,
            security: None,
            zenoh: ZenohSettings::default(),
            warnings: vec![],
            notes: vec![],
        };
        let local = config(&network(true, &[]), None);
        assert!(local.contains("address=\"127.0.0.1\"") && local.contains("Address=\"127.0.0.1\""));
        let subnet = config(&network(false, &["10.0.0.7"]), Some("file:///robot.xml"));
        assert!(!subnet.contains("127.0.0.1") && subnet.contains("Address=\"10.0.0.7\""));
        assert!(subnet.ends_with("</CycloneDDS>,file:///robot.xml"));
        let off = Network {
            discovery_off: true,
            ..network(true, &[])
        };
        let off = config(&off, None);
        assert!(off.contains("<ParticipantIndex>none<") && off.contains("<Tag>lattice_"));
        assert!(!off.contains("<Peer "));
    }
}
