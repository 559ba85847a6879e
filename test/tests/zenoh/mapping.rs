//! A cloud becomes a map over Zenoh, with services and parameters beside.

use lattice_msgs::rcl_interfaces::{GetParameters, GetParametersRequest, GetParametersResponse};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_srvs::{Empty, EmptyRequest};
use lattice_msgs::{RosService, cdr};
use lattice_runtime::Node;
use lattice_runtime::qos::Qos;
use lattice_test::clouds::cloud;
use lattice_test::peer::{Nodes, params};
use lattice_test::python::zenoh_python;

use super::{PATIENCE, Site, hear};

pub fn call<S: RosService>(node: &Node, name: &str, request: &S::Request) -> S::Response {
    let client = node.client::<S>(name).unwrap();
    let request = cdr::to_vec(request).unwrap();
    let answer = smol::block_on(client.call(request, PATIENCE)).unwrap();
    cdr::from_slice(&answer).unwrap()
}

#[test]
fn a_mapper_maps_and_answers_and_late_joiners_get_the_map() {
    let Some(python) = zenoh_python() else { return };
    let site = Site::start(&python);
    let mapper = params("centers_period_s:=0.05 octomap_services:=true");
    let nodes = Nodes::start_on(&site.network(), &[("lattice_mapper", mapper)]);
    let driver = site.runtime("driver");
    let driver = driver.node("driver").unwrap();
    let points = driver.publisher("/points_enu", Qos::reliable(10)).unwrap();
    let (sender, joined) = std::sync::mpsc::channel();
    points.on_subscriber_joined(move || {
        let _ = sender.send(());
    });
    joined.recv_timeout(PATIENCE).unwrap();
    let wall: Vec<[f32; 3]> = (0..100).map(|i| [10.0, i as f32, 1.0]).collect();
    points.publish(cloud("map", 1_000_000_000, &wall)).unwrap();

    let centers = |node: &Node| {
        let (subscription, heard) = hear::<PointCloud2>(node, "/map_centers", Qos::LATCHED);
        let mapped = loop {
            let cloud = heard.recv_timeout(PATIENCE).unwrap();
            if cloud.width > 0 {
                break cloud.width;
            }
        };
        drop(subscription);
        mapped
    };
    let mapped = centers(&driver);
    assert!(mapped >= 90, "{mapped} voxels of 100 points a metre apart");
    // Who joins now has what was said before.
    let late = site.runtime("late");
    let late = late.node("late").unwrap();
    assert_eq!(centers(&late), mapped);

    let names = vec!["octomap_services".to_owned(), "centers_period_s".to_owned()];
    let asked = GetParametersRequest { names };
    let answer: GetParametersResponse =
        call::<GetParameters>(&late, "/lattice_mapper/get_parameters", &asked);
    assert!(answer.values[0].bool_value);
    assert_eq!(answer.values[1].double_value, 0.05);
    call::<Empty>(&late, "/lattice_mapper/reset", &EmptyRequest::default());
    nodes.finish();
}
