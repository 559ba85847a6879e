//! Each transport with eProsima Fast DDS, the default of ROS 2: `test/fastdds/peer.cpp`, built by
//! `.ci/dds`.

use std::io::{Write, stderr};
use std::process::{Command, Stdio};

use lattice_runtime::env::TransportKind;
use lattice_test::domain::TestDomain;
use serde::Deserialize;

use super::{Echo, runtime};

/// The peer, which ends with a message after a minute in vain.
fn peer(domain: &TestDomain, args: &[&str]) -> Option<Vec<u8>> {
    let Some(program) = std::env::var_os("LATTICE_FASTDDS") else {
        let _ = writeln!(
            stderr(),
            "SKIPPED Fast DDS: LATTICE_FASTDDS does not name its peer"
        );
        return None;
    };
    let output = Command::new(program)
        .arg(domain.id().to_string())
        .args(args)
        .stderr(Stdio::inherit())
        .output()
        .unwrap();
    assert!(output.status.success(), "{args:?}: {}", output.status);
    Some(output.stdout)
}

#[derive(Debug, PartialEq, Deserialize)]
struct Talked {
    echoed: usize,
    latched: bool,
}

#[test]
fn topics_pass_both_ways() {
    for transport in TransportKind::BUILT_IN {
        let domain = TestDomain::take();
        let _echo = Echo::start(&domain, *transport);
        let Some(line) = peer(&domain, &["talk"]) else {
            return;
        };
        let talked: Talked = serde_json::from_slice(&line).unwrap();
        let whole = Talked {
            echoed: 105,
            latched: true,
        };
        assert_eq!(talked, whole, "{}", transport.0);
    }
}

#[derive(Debug, Deserialize)]
struct Asked {
    median_s: f64,
    max_s: f64,
}

#[test]
fn clients_are_answered() {
    for transport in TransportKind::BUILT_IN {
        let domain = TestDomain::take();
        let server = runtime(&domain, *transport, "server");
        let node = server.node("server").unwrap();
        let reset = || (true, String::new());
        let _served = node.service_trigger("~/reset", reset).unwrap();
        let Some(line) = peer(&domain, &["ask", "5"]) else {
            return;
        };
        let asked: Asked = serde_json::from_slice(&line).unwrap();
        println!("{}: {asked:?}", transport.0);
        assert!(asked.median_s <= asked.max_s);
    }
}
