//! Clients that have just come get their replies.

use std::process::Command;

use lattice_runtime::env::TransportKind;
use lattice_test::domain::TestDomain;
use lattice_test::python::{python, script};
use serde::Deserialize;

use super::runtime;

#[derive(Debug, Deserialize)]
struct Found {
    lost: usize,
    median_s: f64,
}

fn fresh_clients(count: usize) {
    let Some(python) = python() else {
        return;
    };
    for transport in TransportKind::BUILT_IN {
        let domain = TestDomain::take();
        let server = runtime(&domain, *transport, "server");
        let node = server.node("server").unwrap();
        let _served = node
            .service_trigger("~/reset", || (true, String::new()))
            .unwrap();
        let output = Command::new(&python)
            .arg(script("service_clients.py"))
            .args([&domain.id().to_string(), "server/reset", &count.to_string()])
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{}: {errors}", transport.0);
        let found: Found = serde_json::from_slice(&output.stdout).unwrap();
        println!("{}: {found:?} of {count}", transport.0);
        assert_eq!(found.lost, 0);
        assert!(count < 1000 || found.median_s < 0.05);
    }
}

#[test]
fn a_request_that_overtakes_discovery_is_answered() {
    fresh_clients(10);
}

#[test]
#[ignore = "takes minutes"]
fn a_thousand_requests_that_overtake_discovery_are_answered() {
    fresh_clients(1000);
}
