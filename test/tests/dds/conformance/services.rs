//! Clients that have just come get their replies.

use std::process::Command;

use lattice_msgs::cdr;
use lattice_msgs::rcl_interfaces::{
    GetParameters, GetParametersRequest, GetParametersResponse, ParameterValue,
};
use lattice_runtime::env::TransportKind;
use lattice_test::domain::TestDomain;
use lattice_test::python::{python, script};
use serde::Deserialize;

use super::{PATIENCE, pairs, runtime};

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
fn requests_and_answers_of_many_datagrams_arrive() {
    for (asking, serving) in pairs() {
        let domain = TestDomain::take();
        let server = runtime(&domain, serving, "server");
        let node = server.node("server").unwrap();
        let lengths = |asked: GetParametersRequest| GetParametersResponse {
            values: asked
                .names
                .iter()
                .map(|_| ParameterValue::default())
                .collect(),
        };
        let _served = node.service::<GetParameters>("~/count", lengths).unwrap();
        let client = runtime(&domain, asking, "client");
        let client = client.node("client").unwrap();
        let client = client.client::<GetParameters>("/server/count").unwrap();
        // Whole and in fragments.
        for count in [1, 300] {
            let names = vec!["0123456789".to_owned(); count];
            let request = cdr::to_vec(&GetParametersRequest { names }).unwrap();
            let answer = smol::block_on(client.call(request, PATIENCE)).unwrap();
            let answer: GetParametersResponse = cdr::from_slice(&answer).unwrap();
            assert_eq!(answer.values.len(), count, "{} {}", asking.0, serving.0);
        }
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
