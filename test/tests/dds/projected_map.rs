//! `projected_map` and its updates at foreign subscribers with the QoS of Nav2: they end up with the array of the map.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use lattice_core::lattice::LatticeKind;
use lattice_nodes::lattice_mapper::LatticeMapper;
use lattice_nodes::map_projector::{MapProjector, MapProjectorOptions, Projected, ProjectorReport};
use lattice_nodes::report;
use lattice_test::domain::TestDomain;
use lattice_test::maps;
use lattice_test::peer::{Nodes, Script, params};
use lattice_test::python::{python, ros_pythons};
use serde::Deserialize;

use super::map_driver::MapDriver;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(120);

const ROBOT_M: [f64; 3] = [1.0, 1.0, 0.3];

/// Messages that a subscriber has taken.
#[derive(Debug, Deserialize)]
struct Taken {
    grids: u64,
    updates: u64,
    resolution: f64,
    frame: String,
}

/// Points of a floor and of a wall across it.
fn points(wall: bool) -> Vec<[f32; 3]> {
    let side = |i: u8| 0.1 * f32::from(i) + 0.05;
    let floor = (0..60).flat_map(|x| (0..60).map(move |y| [side(x), side(y), 0.0]));
    let wall =
        (0..if wall { 60 } else { 0 }).flat_map(|y| (0..20).map(move |z| [3.0, side(y), side(z)]));
    floor.chain(wall).collect()
}

/// Writes the known cells of the grid of a map.
fn write_expected(mapper: &mut LatticeMapper, file: &Path) {
    let mut machine = MapProjector::new(MapProjectorOptions::default());
    machine.set_robot(ROBOT_M.into());
    for chunk in mapper.keyframe() {
        machine.on_map(&chunk).unwrap();
    }
    let Some(Projected::Grid(grid)) = machine.take_change() else {
        panic!("no grid");
    };
    let info = &grid.info;
    let corner = [info.origin.position.x, info.origin.position.y]
        .map(|origin| (origin / f64::from(info.resolution)).round() as i32);
    let width = info.width as usize;
    let known = grid
        .data
        .iter()
        .enumerate()
        .filter(|(_, value)| **value != -1);
    let mut cells: Vec<[i32; 3]> = known
        .map(|(i, value)| {
            [
                corner[0] + (i % width) as i32,
                corner[1] + (i / width) as i32,
                i32::from(*value),
            ]
        })
        .collect();
    cells.sort_unstable();
    assert!(cells.len() > 300);
    let bytes = cells.iter().flatten().flat_map(|value| value.to_le_bytes());
    fs::write(file, bytes.collect::<Vec<u8>>()).unwrap();
}

#[test]
fn foreign_subscribers_rebuild_the_grid_from_grids_and_updates() {
    let mut pythons: Vec<(PathBuf, &str)> = python()
        .into_iter()
        .map(|python| (python, "cyclone"))
        .collect();
    pythons.extend(ros_pythons().into_iter().map(|python| (python, "rclpy")));
    if pythons.is_empty() {
        return;
    }
    let domain = TestDomain::take();
    let folder = tempfile::tempdir().unwrap();
    let files = ["first", "second"].map(|name| folder.path().join(name));
    let report_file = folder.path().join("report");
    let mut mapper = maps::mapper(maps::options(LatticeKind::Fcc, 0.008));
    maps::insert(&mut mapper, &points(false));
    mapper.take_update();
    let keyframe = mapper.keyframe();
    write_expected(&mut mapper, &files[0]);
    maps::insert(&mut mapper, &points(true));
    let update = mapper.take_update();
    write_expected(&mut mapper, &files[1]);

    let given = format!(
        "update_period_s:=0.1 report_file:={}",
        report_file.display()
    );
    let nodes = Nodes::start(&domain, &[("map_projector", params(&given))]);
    let driver = MapDriver::start(&domain, &[("base_link", ROBOT_M)]);
    let start = |(python, kind): &(PathBuf, &str)| {
        let domain = domain.id().to_string();
        let args = [OsStr::new(kind), OsStr::new(&domain)];
        let files = files.iter().map(|file| file.as_os_str());
        Script::start(python, "grid_peer.py", args.into_iter().chain(files))
    };
    let mut subscribers: Vec<Script> = pythons.iter().map(start).collect();
    // Nobody follows the map before somebody subscribes to the grid.
    driver.until_asked(PATIENCE);
    driver.send(&keyframe);
    let first: Vec<Taken> = subscribers.iter_mut().map(Script::line).collect();
    update
        .iter()
        .for_each(|chunk| driver.updates.publish(chunk.clone()).unwrap());
    let second: Vec<Taken> = subscribers.iter_mut().map(Script::line).collect();
    for (((_, kind), first), second) in pythons.iter().zip(&first).zip(&second) {
        println!("{kind}: {first:?}, then {second:?}");
        assert_eq!(
            (second.frame.as_str(), second.resolution),
            ("map", f64::from(0.2_f32))
        );
        match *kind {
            "cyclone" => assert!(second.updates > 0, "{second:?}"),
            _ => assert!(
                second.updates == 0 && second.grids > first.grids,
                "{second:?}"
            ),
        }
    }
    drop(subscribers);
    nodes.finish();
    let report: ProjectorReport = report::read(&report_file).unwrap();
    assert!(
        report.counts.updates_out > 0 && report.cells[0] > 200,
        "{report:?}"
    );
    assert_eq!(
        report.counts.grids_refused + report.counts.messages_refused,
        0
    );
    assert_eq!(report.counts.elevations_out, 0, "nobody subscribes to it");
}
