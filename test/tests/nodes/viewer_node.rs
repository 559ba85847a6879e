//! The viewer server and the calibration server as nodes: attempts to start that fail leave no thread.

use std::net::{Ipv4Addr, TcpListener};
use std::time::{Duration, Instant};

use lattice_nodes::{semantic_icp_server, viewer_server};
use lattice_runtime::Runtime;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::domain::TestDomain;

/// Threads of this process whose names begin so.
fn threads(name: &str) -> usize {
    let tasks = std::fs::read_dir("/proc/self/task").unwrap();
    let names =
        tasks.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("comm")).ok());
    names.filter(|found| found.starts_with(name)).count()
}

/// Waits until a number of such threads holds; they take their names, and end, by themselves.
fn until_threads(name: &str, holds: impl Fn(usize) -> bool) {
    let late = Instant::now() + Duration::from_secs(20);
    while !holds(threads(name)) {
        assert!(Instant::now() < late, "{} threads of {name}", threads(name));
        std::thread::yield_now();
    }
}

fn assert_they_end(name: &str) {
    until_threads(name, |n| n == 0);
}

fn runtime(domain: &TestDomain, arguments: &[&str]) -> Runtime {
    let arguments = [&["--ros-args"], arguments].concat();
    let args = RosArgs::parse(arguments.into_iter().map(str::to_owned)).unwrap();
    Runtime::with_transport("failing", args, &domain.transport()).unwrap()
}

#[test]
fn a_viewer_whose_port_is_taken_leaves_no_thread() {
    let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = format!("port:={}", taken.local_addr().unwrap().port());
    let domain = TestDomain::take();
    let runtime = runtime(&domain, &["-p", &port]);
    for _ in 0..5 {
        let Err(error) = viewer_server::node::start(&runtime, "taken") else {
            panic!("two servers on one port");
        };
        assert!(
            error.to_string().contains("choose one by `port`"),
            "{error}"
        );
    }
    assert_they_end("taken");
    drop(taken);
    let finish = viewer_server::node::start(&runtime, "taken").unwrap();
    until_threads("taken", |n| n > 0);
    finish();
    assert_they_end("taken");
}

#[test]
fn a_calibration_server_that_cannot_subscribe_leaves_no_thread() {
    let domain = TestDomain::take();
    let runtime = runtime(&domain, &["-p", "qos.headset/points.reliability:=perhaps"]);
    for _ in 0..5 {
        let Err(error) = semantic_icp_server::node::start(&runtime, "icp") else {
            panic!("a quality of service that there is not");
        };
        assert!(error.to_string().contains("perhaps"), "{error}");
    }
    assert_they_end("icp");
}
