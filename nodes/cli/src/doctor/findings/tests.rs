mod time;

use lattice_msgs::hash_of;
use lattice_runtime::GraphRole::{self, Publisher, Subscriber};

use super::*;
use crate::doctor::facts::{
    Endpoint, Frame, Interface, Machine, MapDir, NetworkFacts, Process, Range, Stamps, TimeFacts,
};

const CLOUD: &str = "sensor_msgs/msg/PointCloud2";
const MAP: &str = "lattice_msgs/msg/LatticeMap";

/// GUID prefixes of a participant of Cyclone, another, and one of Fast DDS.
const A: &str = "0110aaaaaaaaaaaaaaaaaaaa";
const B: &str = "0110bbbbbbbbbbbbbbbbbbbb";
const FAST: &str = "010fcccccccccccccccccccc";

fn endpoint(role: GraphRole, topic: &str, node: &str, type_name: &str) -> Endpoint {
    Endpoint {
        role,
        topic: topic.to_owned(),
        node: node.to_owned(),
        participant: Some(A.to_owned()),
        type_name: Some(type_name.to_owned()),
        type_hash: hash_of(type_name).map(str::to_owned),
        is_reliable: false,
        is_transient_local: false,
    }
}

/// A lidar and a mapper that work.
fn sound() -> Facts {
    let eth = Interface {
        name: "eth0".to_owned(),
        is_loopback: false,
        has_multicast: true,
    };
    Facts {
        version: "0.1.0".to_owned(),
        network: NetworkFacts {
            transport: "rmw_cyclonedds_cpp".to_owned(),
            ..NetworkFacts::default()
        },
        machine: Machine {
            interfaces: vec![eth],
            rmem_max: Some(32 << 20),
            ..Machine::default()
        },
        endpoints: vec![
            endpoint(Publisher, "/points", "/lidar", CLOUD),
            endpoint(Subscriber, "/points", "/lattice_mapper", CLOUD),
            endpoint(Publisher, "/voxel_map", "/lattice_mapper", MAP),
            endpoint(Publisher, "/tf", "/odometry", "tf2_msgs/msg/TFMessage"),
        ],
        time: TimeFacts {
            stamps: vec![stamps("/points", -0.1)],
            frames: vec![frame("base_link", -0.05)],
            ..TimeFacts::default()
        },
        map_dirs: vec![MapDir {
            node: "/lattice_mapper".to_owned(),
            path: "/maps".into(),
            free_bytes: Some(1 << 40),
        }],
    }
}

fn stamps(topic: &str, offset_s: f64) -> Stamps {
    Stamps {
        topic: topic.to_owned(),
        offset_s,
    }
}

fn frame(child: &str, offset_s: f64) -> Frame {
    Frame {
        child: child.to_owned(),
        parents: ["odom".to_owned()].into(),
        offset_s: Some(offset_s),
    }
}

fn process(domain: u16, range: Option<&str>) -> Process {
    Process {
        pid: Some(12),
        name: "talker".to_owned(),
        domain,
        range: range.map(str::to_owned),
        ..Process::default()
    }
}

/// The one finding after a change of the sound facts.
#[track_caller]
fn only(change: impl FnOnce(&mut Facts)) -> Finding {
    let mut facts = sound();
    change(&mut facts);
    let mut all = findings(&facts);
    assert_eq!(all.len(), 1, "{all:#?}");
    all.remove(0)
}

/// The one finding has this severity and check, and its problem these words.
#[track_caller]
fn names(change: impl FnOnce(&mut Facts), severity: Severity, check: &str, words: &[&str]) {
    let finding = only(change);
    assert_eq!(
        (finding.severity, finding.check),
        (severity, check),
        "{finding:?}"
    );
    for words in words {
        assert!(
            finding.problem.contains(words),
            "{words}: {}",
            finding.problem
        );
    }
    assert!(!finding.remedy.is_empty());
}

#[test]
fn a_sound_graph_has_no_findings() {
    assert_eq!(findings(&sound()), []);
}

#[test]
fn the_domain_of_others_is_named() {
    let wrong = |facts: &mut Facts| {
        facts.endpoints.clear();
        facts.network.domain = 7;
        facts.machine.processes = vec![process(0, None)];
        let sender = ["10.0.0.2".to_owned()].into();
        facts.machine.other_domains = [(3, sender)].into();
    };
    let words = [
        "domain 7",
        "0: talker (process 12)",
        "3: a participant at 10.0.0.2",
    ];
    names(wrong, Severity::Error, "domain", &words);
    let remedy = "export ROS_DOMAIN_ID=0 in this shell, or 7 for the others";
    assert_eq!(only(wrong).remedy, remedy);
    // Other domains are no finding where nodes are found.
    let mut facts = sound();
    facts.machine.processes = vec![process(5, None)];
    assert_eq!(findings(&facts), []);
    let alone = |facts: &mut Facts| facts.endpoints.clear();
    names(alone, Severity::Error, "peers", &["domain 0, range SUBNET"]);
}

#[test]
fn discovery_ranges_differ() {
    for (ours, theirs, shown) in [
        (
            Range::Subnet,
            Some("LOCALHOST"),
            "SUBNET here and LOCALHOST in talker",
        ),
        (
            Range::Localhost,
            None,
            "LOCALHOST here and SUBNET in talker",
        ),
    ] {
        let differ = |facts: &mut Facts| {
            facts.network.range = ours;
            facts.machine.processes = vec![process(0, theirs)];
        };
        names(differ, Severity::Warn, "discovery range", &[shown]);
        let apart = |facts: &mut Facts| {
            differ(facts);
            facts.endpoints.clear();
        };
        let words = [shown, "do not discover each other"];
        names(apart, Severity::Error, "discovery range", &words);
    }
    let off = |facts: &mut Facts| {
        facts.network.range = Range::Off;
        facts.endpoints.clear();
    };
    names(off, Severity::Error, "discovery range", &["OFF"]);
}

#[test]
fn without_multicast_other_machines_are_not_discovered() {
    let none = |facts: &mut Facts| facts.machine.interfaces.clear();
    names(
        none,
        Severity::Error,
        "multicast",
        &["no network interface"],
    );
    let refused = |facts: &mut Facts| {
        facts.machine.multicast_error = Some("Network is unreachable".to_owned());
        facts.endpoints.clear();
    };
    names(
        refused,
        Severity::Error,
        "multicast",
        &["Network is unreachable"],
    );
    let failed = |facts: &mut Facts| {
        facts.network.error = Some("no interface".to_owned());
        facts.endpoints.clear();
    };
    names(failed, Severity::Error, "transport", &["no interface"]);
    let with_peers = |facts: &mut Facts| {
        none(facts);
        facts.network.static_peers = vec!["10.0.0.2".to_owned()];
    };
    names(
        with_peers,
        Severity::Info,
        "multicast",
        &["no network interface"],
    );
    let mut facts = sound();
    none(&mut facts);
    facts.network.range = Range::Localhost;
    assert_eq!(findings(&facts), []);
}

#[test]
fn incompatible_qos_is_named_with_its_policy() {
    let reliable = |facts: &mut Facts| facts.endpoints[1].is_reliable = true;
    let words =
        "/points: /lattice_mapper requests reliable, /lidar offers best_effort (RELIABILITY)";
    names(reliable, Severity::Error, "QoS", &[words]);
    assert!(
        only(reliable)
            .remedy
            .contains("-p qos./points.reliability:=best_effort")
    );
    let latched = |facts: &mut Facts| facts.endpoints[1].is_transient_local = true;
    let words = "requests transient_local, /lidar offers volatile (DURABILITY)";
    names(latched, Severity::Error, "QoS", &[words]);
    let mut zenoh = sound();
    zenoh.network.transport = "rmw_zenoh_cpp".to_owned();
    reliable(&mut zenoh);
    assert_eq!(findings(&zenoh), [], "Zenoh has no incompatible QoS");
}

#[test]
fn types_and_versions_differ() {
    let other = |facts: &mut Facts| {
        facts.endpoints[1].type_name = Some("sensor_msgs/msg/LaserScan".to_owned());
        facts.endpoints[1].type_hash = None;
    };
    let words = ["/points has 2 types", "LaserScan (/lattice_mapper)"];
    names(other, Severity::Error, "types", &words);
    let hash = |index: usize| {
        move |facts: &mut Facts| {
            facts.endpoints[index].type_hash = Some(format!("RIHS01_{}", "a".repeat(64)));
        }
    };
    let words = [
        "lattice_msgs/msg/LatticeMap of /lattice_mapper",
        "another version of Lattice",
    ];
    names(hash(2), Severity::Error, "version", &words);
    names(
        hash(0),
        Severity::Error,
        "version",
        &["another definition of the message"],
    );
}

#[test]
fn two_nodes_of_one_name() {
    let twice = |facts: &mut Facts| {
        let mut second = facts.endpoints[2].clone();
        second.participant = Some(B.to_owned());
        facts.endpoints.push(second);
    };
    names(
        twice,
        Severity::Error,
        "names",
        &["2 nodes have the name /lattice_mapper"],
    );
}

#[test]
fn a_subscription_is_shown_the_topic_of_its_type() {
    let renamed = |facts: &mut Facts| facts.endpoints[0].topic = "/velodyne".to_owned();
    let words = [
        "/points of /lattice_mapper has no publisher",
        "/velodyne of the same type",
    ];
    names(renamed, Severity::Warn, "topics", &words);
    let mut facts = sound();
    renamed(&mut facts);
    facts.endpoints[0].node = "/lattice_mapper".to_owned();
    assert_eq!(findings(&facts), [], "its own output");
}

#[test]
fn middleware_is_mixed() {
    let mixed = |facts: &mut Facts| {
        facts.endpoints[0].participant = Some(FAST.to_owned());
        facts.endpoints[3].participant = Some(B.to_owned());
    };
    let words = ["Fast DDS (/lidar) and Cyclone (/odometry) in one graph"];
    names(mixed, Severity::Warn, "middleware", &words);
    let mut beside = sound();
    beside.endpoints[0].participant = Some(FAST.to_owned());
    assert_eq!(findings(&beside), [], "Lattice beside Fast DDS");
    let settings = |facts: &mut Facts| {
        facts.network.fast_dds_settings = vec!["ROS_DISCOVERY_SERVER".to_owned()];
    };
    names(
        settings,
        Severity::Warn,
        "middleware",
        &["ROS_DISCOVERY_SERVER is set for Fast DDS"],
    );
    let zenoh = |facts: &mut Facts| {
        let mut of = process(0, None);
        of.rmw_implementation = Some("rmw_zenoh_cpp".to_owned());
        facts.machine.processes = vec![of];
    };
    names(
        zenoh,
        Severity::Error,
        "transport",
        &["DDS and Zenoh are not connected"],
    );
}

#[test]
fn the_most_severe_comes_first() {
    let mut facts = sound();
    facts.machine.rmem_max = Some(1);
    facts.endpoints[0].topic = "/velodyne".to_owned();
    facts.map_dirs[0].free_bytes = Some(0);
    let checks: Vec<&str> = findings(&facts).iter().map(|of| of.check).collect();
    assert_eq!(checks, ["disk", "topics", "buffers"]);
}

#[test]
fn lists_are_short() {
    assert_eq!(list(["a", "b"]), "a, b");
    assert_eq!(
        list(["a", "b", "c", "d", "e", "f"]),
        "a, b, c, d and 2 more"
    );
}
