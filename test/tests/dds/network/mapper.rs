//! A mapper whose clouds are lost on the way: the number is in its diagnostics and in its report.

use std::process::Command;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};

use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Runtime, SubscriptionExecutor};
use lattice_test::clouds::cloud;
use lattice_test::domain::TestDomain;
use lattice_test::peer::Nodes;
use serde_json::Value;

use super::{End, PATIENCE, ends};
use crate::fresh_clients::Loss;

const TOPIC: &str = "/points_enu";

#[test]
#[ignore = "the driver of the test below, not a test itself"]
fn drives() {
    let Some((_runtime, node)) = ends::node() else {
        return;
    };
    let clouds = node.publisher(TOPIC, Qos::best_effort(100)).unwrap();
    let ended = ends::input_ends();
    let mut stamp_ns = 0;
    while ended.recv_timeout(ends::PERIOD) == Err(RecvTimeoutError::Timeout) {
        stamp_ns += 10_000_000;
        clouds.publish(cloud("map", stamp_ns, &[])).unwrap();
    }
}

#[test]
fn clouds_that_are_lost_are_counted_as_such() {
    let Some(loss) = Loss::new(20) else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("report");
    let domain = TestDomain::take();
    let parameters = vec![format!("report_file:={}", file.display())];
    let mapper = Nodes::start(&domain, &[("lattice_mapper", parameters)]);
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport("peer", args, &domain.transport()).unwrap();
    let node = runtime.node("peer").unwrap();
    let last = Arc::<Mutex<u64>>::default();
    let (shown, (tell, told)) = (Arc::clone(&last), channel());
    let hear = move |all: Arc<DiagnosticArray>| {
        let values = all.status.iter().flat_map(|status| &status.values);
        for value in values.filter(|value| value.key == "clouds_lost_on_network") {
            let count = value.value.parse().unwrap();
            *shown.lock().unwrap() = count;
            let _ = tell.send(count);
        }
    };
    let _diagnostics = node
        .subscribe(
            "/diagnostics",
            Qos::DIAGNOSTICS,
            SubscriptionExecutor::Shared,
            hear,
        )
        .unwrap();
    let mut drives = Command::new(std::env::current_exe().unwrap());
    drives.args(["--exact", "network::mapper::drives", "--ignored"]);
    loss.on(&mut drives);
    let mut drives = End::start(drives, &domain, "LOCALHOST");
    while told.recv_timeout(PATIENCE).unwrap() < 50 {}
    drives.end();
    drives.child.wait().unwrap();
    mapper.finish();
    let report: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    let counted = report["clouds_lost_on_network"].as_u64().unwrap();
    let of_transport = &report["transport"][format!("{TOPIC} lost_on_network")];
    assert_eq!(of_transport.as_u64(), Some(counted), "{report}");
    assert!(counted >= *last.lock().unwrap(), "{report}");
    assert_eq!(report["clouds_inbox_full"], 0, "{report}");
    let came = report["counts"]["clouds_in"].as_u64().unwrap();
    let share = counted as f64 / (counted + came) as f64;
    assert!((0.1..0.35).contains(&share), "{share}: {report}");
}
