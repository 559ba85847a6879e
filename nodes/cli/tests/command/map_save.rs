//! `lattice map save`: the map of a running mapper.

use std::process::Output;
use std::time::Instant;

use lattice_core::voxels::file::MapContents;
use lattice_runtime::LoopbackDomain;
use lattice_runtime::qos::Qos;
use wait_timeout::ChildExt;

use crate::PATIENCE;
use crate::health::cloud;
use crate::names::peer;
use crate::record::{signal, start};

fn save(domain: &LoopbackDomain, arguments: &[&str]) -> (Output, String) {
    let child = start(domain, &[&["map", "save", "--from"], arguments].concat());
    let output = child.wait_with_output().unwrap();
    let said = [&output.stdout[..], &output.stderr].concat();
    (output, String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn a_running_mapper_writes_its_map_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let map_dir = format!("map_dir:={}", folder.path().display());
    let reliable = "qos./points_enu.reliability:=reliable";
    let parameters = ["-p", map_dir.as_str(), "-p", reliable];
    let node = ["node", "lattice_mapper", "--ros-args"];
    let mut mapper = start(&domain, &[&node[..], &parameters].concat());
    let peer = peer(&domain);
    let clouds = peer.node("sensor").unwrap();
    let points = clouds.publisher("points_enu", Qos::latched(1)).unwrap();
    points.publish(cloud("map")).unwrap();
    let begin = Instant::now();
    loop {
        let (output, said) = save(&domain, &["lattice_mapper", "site.lattice"]);
        if output.status.success() && said.starts_with("1 voxels: ") {
            break;
        }
        assert!(begin.elapsed() < PATIENCE, "{said}");
        // A volatile subscription may have come later.
        points.publish(cloud("map")).unwrap();
    }
    let file = std::fs::read(folder.path().join("site.lattice")).unwrap();
    let map = MapContents::read(&file[..], usize::MAX).unwrap();
    assert_eq!(map.keys().len(), 1);

    let (output, said) = save(&domain, &["/lattice_mapper", "../other.lattice"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said.contains("/lattice_mapper: ") && said.contains("other.lattice"),
        "{said}"
    );
    let (output, said) = save(&domain, &["/nobody", "a", "--timeout", "1"]);
    assert_eq!(output.status.code(), Some(1));
    let remedy = "--from names a running node with save_map";
    assert!(
        said.contains("/nobody/save_map") && said.contains(remedy),
        "{said}"
    );
    signal(&mapper, "-INT");
    assert!(mapper.wait_timeout(PATIENCE).unwrap().unwrap().success());
}
