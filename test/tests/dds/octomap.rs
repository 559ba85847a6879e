//! Services under the names and types of octomap_server.

use std::time::Duration;

use lattice_msgs::octomap_msgs::{BoundingBoxQuery, BoundingBoxQueryRequest};
use lattice_msgs::std_srvs::{Empty, EmptyRequest};
use lattice_msgs::{RosMessage, RosService, cdr};
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Runtime};
use lattice_test::domain::TestDomain;
use lattice_test::peer::{Nodes, params};

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

#[track_caller]
fn call<S: RosService>(node: &Node, name: &str, request: &S::Request) {
    let client = node.client::<S>(name).unwrap();
    let request = cdr::to_vec(request).unwrap();
    let answer = smol::block_on(client.call(request, PATIENCE)).unwrap();
    let answer = cdr::from_slice::<S::Response>(&answer);
    assert!(answer.is_ok(), "{name}: no {}", S::Response::TYPE);
}

#[test]
fn clients_of_octomap_server_are_answered() {
    let domain = TestDomain::take();
    let mapper = ("lattice_mapper", params("octomap_services:=true"));
    let nodes = Nodes::start(&domain, &[mapper]);
    let args = RosArgs::parse([]).unwrap();
    let runtime = Runtime::with_transport("client", args, &domain.transport()).unwrap();
    let node = runtime.node("client").unwrap();
    for service in ["clear_bbox", "clear_bbx"] {
        let name = format!("/lattice_mapper/{service}");
        call::<BoundingBoxQuery>(&node, &name, &BoundingBoxQueryRequest::default());
    }
    call::<Empty>(&node, "/lattice_mapper/reset", &EmptyRequest::default());
    nodes.finish();
}
