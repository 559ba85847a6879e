//! Counters of hostile clients: the same in the diagnostics of `viewer_server` and in its report.

use std::io::Write;
use std::net::TcpStream;
use std::sync::mpsc::channel;
use std::time::Duration;

use async_tungstenite::tungstenite::stream::MaybeTlsStream;
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};
use serde_json::Value;

use crate::PATIENCE;
use crate::viewer::Viewer;
use crate::viewer_writing::socket;

#[test]
fn what_hostile_clients_cost_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let report = folder.path().join("report");
    let report_file = format!("report_file:={}", report.display());
    let command = ["node", "viewer_server", "--ros-args", "-p", "port:=0", "-p"];
    let viewer = Viewer::start_in(&domain, &[&command[..], &[&report_file]].concat());
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let runtime = Runtime::with_transport("peer", RosArgs::default(), &network).unwrap();
    let node = runtime.node("peer").unwrap();
    let (tell, told) = channel();
    let hear = move |all: std::sync::Arc<DiagnosticArray>| {
        for value in all.status.iter().flat_map(|status| &status.values) {
            let _ = tell.send((value.key.clone(), value.value.clone()));
        }
    };
    let diagnostics = node.subscribe(
        "/diagnostics",
        Qos::DIAGNOSTICS,
        SubscriptionExecutor::Shared,
        hear,
    );
    let _diagnostics = diagnostics.unwrap();
    let until = |key: &str, value: &str| {
        while told.recv_timeout(PATIENCE).unwrap() != (key.to_owned(), value.to_owned()) {}
    };
    // A client that pings and takes nothing.
    let hostile = socket(&viewer.url);
    let MaybeTlsStream::Plain(stream) = hostile.get_ref() else {
        panic!("no plain stream");
    };
    let mut stream = stream.try_clone().unwrap();
    let second = Some(Duration::from_secs(1));
    stream.set_write_timeout(second).unwrap();
    let pings = [&[0x89, 0xfd, 0, 0, 0, 0][..], &[7; 125]]
        .concat()
        .repeat(8000);
    // Its end is the server's.
    loop {
        match stream.write(&pings) {
            Ok(_) => {}
            Err(error) if matches!(error.kind(), std::io::ErrorKind::WouldBlock) => {}
            Err(_) => break,
        }
    }
    until("clients_stalled", "1");
    // Of 100 from one address 16 are held.
    let address = viewer.url.strip_prefix("http://").unwrap();
    let crowd: Vec<_> = (0..100)
        .map(|_| TcpStream::connect(address).unwrap())
        .collect();
    until("connections_displaced", "84");
    drop(crowd);
    viewer.end();
    let report: Value = serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap();
    let counts = &report["counts"];
    for (key, count) in [
        ("clients_in", 1),
        ("clients_stalled", 1),
        ("connections_displaced", 84),
    ] {
        assert_eq!(counts[key], count, "{key}: {report}");
    }
}
