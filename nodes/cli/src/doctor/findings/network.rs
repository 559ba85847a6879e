//! Domain, discovery range, multicast and middleware.

use std::collections::{BTreeMap, BTreeSet};

use super::super::facts::{Facts, Process, Range};
use super::Severity::{Error, Info, Warn};
use super::{Finding, list};

/// Ids of DDS vendors at the beginning of a GUID.
const CYCLONE: &str = "0110";
const FAST_DDS: &str = "010f";

pub fn findings(facts: &Facts) -> Vec<Finding> {
    let mut found = Vec::new();
    let warnings = facts.network.warnings.iter();
    found.extend(warnings.map(|warning| {
        let remedy = "set the variable to a value that docs/transport.md names, or unset it";
        Finding::new(Warn, "environment", warning, remedy)
    }));
    found.extend(facts.network.error.iter().map(|error| {
        let remedy = "enable a network interface; on this machine alone: export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST; \
            check CYCLONEDDS_URI or the configuration of Zenoh";
        Finding::new(Error, "transport", error, remedy)
    }));
    if facts.network.is_dds() {
        found.extend(multicast(facts));
        found.extend(ranges(facts));
    }
    found.extend(transports(facts));
    found.extend(vendors(facts));
    found.extend(fast_dds_settings(facts));
    if facts.endpoints.is_empty() {
        found.extend(alone(
            facts,
            found.iter().any(|finding| finding.severity == Error),
        ));
    }
    found
}

/// No other node: where others are, if that is known.
fn alone(facts: &Facts, is_explained: bool) -> Option<Finding> {
    let (domain, range) = (facts.network.domain, facts.network.range);
    if range == Range::Off {
        return Some(Finding::new(
            Error,
            "discovery range",
            "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF: no node of another process is discovered",
            "export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET, or LOCALHOST for this machine alone",
        ));
    }
    let mut others: BTreeMap<u16, BTreeSet<String>> = BTreeMap::new();
    let processes = facts.machine.processes.iter();
    for process in processes.filter(|of| of.domain != domain) {
        others
            .entry(process.domain)
            .or_default()
            .insert(process.title());
    }
    for (other, senders) in &facts.machine.other_domains {
        let senders = senders
            .iter()
            .map(|sender| format!("a participant at {sender}"));
        others.entry(*other).or_default().extend(senders);
    }
    let is_here = facts.machine.processes.iter().any(|of| of.domain == domain);
    if let (Some((first, _)), false) = (others.first_key_value(), is_here) {
        let each = others
            .iter()
            .map(|(domain, who)| format!("{domain}: {}", list(who.iter().map(String::as_str))));
        return Some(Finding::new(
            Error,
            "domain",
            format!(
                "no node of another process in domain {domain} (`ROS_DOMAIN_ID`), but in domain {}",
                each.collect::<Vec<_>>().join("; ")
            ),
            format!("export ROS_DOMAIN_ID={first} in this shell, or {domain} for the others"),
        ));
    }
    (!is_explained).then(|| {
        Finding::new(
            Error,
            "peers",
            format!("no node of another process in domain {domain}, range {}", range.name()),
            "start the nodes; compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and RMW_IMPLEMENTATION of both sides, \
             and let the firewall pass UDP",
        )
    })
}

/// Processes of the same domain with another discovery range.
fn ranges(facts: &Facts) -> Option<Finding> {
    let network = &facts.network;
    let ours = network.range;
    let differs = |process: &&Process| {
        let theirs = process.range.as_deref();
        process.domain == network.domain
            && match ours {
                Range::Subnet => matches!(theirs, Some("LOCALHOST" | "OFF")),
                Range::Localhost => {
                    matches!(theirs, None | Some("SUBNET" | "SYSTEM_DEFAULT" | "OFF"))
                }
                Range::Off => false,
            }
            && process.pid.is_some()
    };
    let others: Vec<&Process> = facts.machine.processes.iter().filter(differs).collect();
    let theirs = others.first()?.range.as_deref().unwrap_or("SUBNET");
    let titles: Vec<String> = others.iter().map(|process| process.title()).collect();
    let (severity, effect) = match facts.endpoints.is_empty() {
        true => (Error, "they do not discover each other"),
        false => (Warn, "not all of them discover each other"),
    };
    Some(Finding::new(
        severity,
        "discovery range",
        format!(
            "ROS_AUTOMATIC_DISCOVERY_RANGE is {} here and {theirs} in {}: {effect}",
            ours.name(),
            list(titles.iter().map(String::as_str))
        ),
        "give all processes of a robot the same ROS_AUTOMATIC_DISCOVERY_RANGE",
    ))
}

fn multicast(facts: &Facts) -> Option<Finding> {
    let (network, machine) = (&facts.network, &facts.machine);
    if network.range != Range::Subnet {
        return None;
    }
    let mut usable = machine
        .interfaces
        .iter()
        .filter(|of| of.has_multicast && !of.is_loopback);
    let problem = match (usable.next(), &machine.multicast_error) {
        (Some(_), None) => return None,
        (None, _) => "no network interface that is up has multicast".to_owned(),
        (Some(_), Some(error)) => format!("a multicast datagram to 239.255.0.1 fails: {error}"),
    };
    let severity = match network.static_peers.is_empty() {
        true => Error,
        false => Info,
    };
    Some(Finding::new(
        severity,
        "multicast",
        format!("{problem}; other machines are not discovered without it"),
        "connect the network, or name the other machines: export ROS_STATIC_PEERS='10.0.0.2;10.0.0.3'; on this \
         machine alone: export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST",
    ))
}

/// Processes of this machine over Zenoh while this shell is on DDS.
fn transports(facts: &Facts) -> Option<Finding> {
    let is_zenoh = |process: &&Process| {
        let name = process.rmw_implementation.as_deref();
        name.is_some_and(|name| name.contains("zenoh"))
    };
    let is_dds = |process: &&Process| process.domain == facts.network.domain && !is_zenoh(process);
    let processes = facts.machine.processes.iter();
    let others: Vec<&Process> = match facts.network.is_dds() {
        true => processes.filter(is_zenoh).collect(),
        false => processes.filter(is_dds).collect(),
    };
    let titles: Vec<String> = others.iter().map(|process| process.title()).collect();
    (!titles.is_empty()).then(|| {
        Finding::new(
            Error,
            "transport",
            format!(
                "{} here, and another in {}: DDS and Zenoh are not connected",
                facts.network.transport,
                list(titles.iter().map(String::as_str))
            ),
            "give all processes the same RMW_IMPLEMENTATION",
        )
    })
}

/// Fast DDS and Cyclone in one graph: their services do not answer each other.
fn vendors(facts: &Facts) -> Option<Finding> {
    let nodes = |vendor: &str| -> BTreeSet<&str> {
        let of_vendor = facts.endpoints.iter().filter(|of| {
            let participant = of.participant.as_deref().unwrap_or_default();
            participant.starts_with(vendor) && !is_ours(facts, participant)
        });
        of_vendor.map(|of| of.node.as_str()).collect()
    };
    let (fast_dds, cyclone) = (nodes(FAST_DDS), nodes(CYCLONE));
    (!fast_dds.is_empty() && !cyclone.is_empty()).then(|| {
        Finding::new(
            Warn,
            "middleware",
            format!(
                "Fast DDS ({}) and Cyclone ({}) in one graph: topics connect, services between the two do not answer \
                 (those of Lattice nodes answer both)",
                list(fast_dds),
                list(cyclone)
            ),
            "give all nodes the same RMW_IMPLEMENTATION: rmw_cyclonedds_cpp or rmw_fastrtps_cpp",
        )
    })
}

/// True for a participant with nodes of Lattice.
fn is_ours(facts: &Facts, participant: &str) -> bool {
    facts.endpoints.iter().any(|of| {
        let name = of.node.rsplit('/').next().unwrap_or_default();
        let type_name = of.type_name.as_deref().unwrap_or_default();
        of.participant.as_deref() == Some(participant)
            && (crate::node::names().contains(&name)
                || name.starts_with("lattice_")
                || type_name.starts_with("lattice_msgs/"))
    })
}

/// Settings of Fast DDS that Cyclone does not read.
fn fast_dds_settings(facts: &Facts) -> Option<Finding> {
    let network = &facts.network;
    let names = list(network.fast_dds_settings.iter().map(String::as_str));
    (!names.is_empty() && network.is_dds()).then(|| {
        Finding::new(
            Warn,
            "middleware",
            format!("{names} is set for Fast DDS; Lattice is on Cyclone DDS, which does not read it"),
            "repeat the setting for Cyclone by CYCLONEDDS_URI or ROS_STATIC_PEERS; a discovery server of Fast DDS is \
             not available to Cyclone",
        )
    })
}
