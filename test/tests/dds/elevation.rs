//! `elevation` at a foreign subscriber that reads it by the rules of grid_map.

use std::time::{Duration, Instant};

use lattice_core::lattice::LatticeKind;
use lattice_nodes::map_projector::ProjectorReport;
use lattice_nodes::report;
use lattice_test::domain::TestDomain;
use lattice_test::maps;
use lattice_test::peer::{Nodes, Script, params};
use lattice_test::python::python;
use serde::Deserialize;

use super::map_driver::MapDriver;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(120);

const ROBOT_M: [f64; 3] = [1.0, 1.0, 0.3];

/// Values of a cell; `None` is no number.
#[derive(Debug, Deserialize)]
struct Values {
    elevation: Option<f64>,
    slope: Option<f64>,
    step: Option<f64>,
    clearance: Option<f64>,
    traversability: Option<f64>,
}

/// A message as the subscriber has read it.
#[derive(Debug, Deserialize)]
struct Shown {
    frame: String,
    resolution: f64,
    lengths: [f64; 2],
    basic: Vec<String>,
    names: Vec<String>,
    values: Vec<Values>,
}

/// Points of a rectangle, 10 cm apart.
fn floor([x0, y0]: [f32; 2], [x1, y1]: [f32; 2], z: f32) -> impl Iterator<Item = [f32; 3]> {
    let along = |low: f32, high: f32| {
        let count = ((high - low) * 10.0).round() as u8;
        (0..count).map(move |i| low + 0.1 * f32::from(i) + 0.05)
    };
    along(x0, x1).flat_map(move |x| along(y0, y1).map(move |y| [x, y, z]))
}

#[test]
fn a_foreign_subscriber_reads_the_layers_by_the_rules_of_grid_map() {
    let Some(python) = python() else {
        return;
    };
    let domain = TestDomain::take();
    let folder = tempfile::tempdir().unwrap();
    let report_file = folder.path().join("report");
    let mut mapper = maps::mapper(maps::options(LatticeKind::Fcc, 0.001));
    // Ground, a terrace in the east that is too high to drive on, and a roof in the north-west.
    let points: Vec<_> = floor([0.0, 0.0], [4.0, 6.0], 0.0)
        .chain(floor([4.0, 0.0], [6.0, 6.0], 0.3))
        .chain(floor([0.5, 3.0], [3.0, 6.0], 2.2))
        .collect();
    maps::insert(&mut mapper, &points);
    mapper.take_update();
    let keyframe = mapper.keyframe();
    // A box is put down.
    let lid: Vec<_> = floor([1.0, 2.0], [2.0, 2.6], 0.5).collect();
    maps::insert(&mut mapper, &lid);
    let update = mapper.take_update();

    let given = format!(
        "update_period_s:=0.1 elevation_length_m:=12.0 report_file:={}",
        report_file.display()
    );
    let nodes = Nodes::start(&domain, &[("map_projector", params(&given))]);
    let driver = MapDriver::start(&domain, &[("base_link", ROBOT_M)]);
    let places = [
        [1.0, 1.0],
        [5.0, 3.0],
        [1.75, 4.5],
        [3.5, 5.0],
        [1.5, 2.3],
        [-4.0, 1.0],
    ];
    let mut args = vec![domain.id().to_string()];
    args.extend(places.iter().flatten().map(f64::to_string));
    let mut subscriber = Script::start(&python, "elevation_peer.py", args);
    // Nobody follows the map before somebody subscribes.
    driver.until_asked(PATIENCE);
    driver.send(&keyframe);
    let begin = Instant::now();
    let mut until = |is_reached: &dyn Fn(&Shown) -> bool| {
        let mut last = subscriber.line::<Shown>();
        while !is_reached(&last) {
            assert!(begin.elapsed() < PATIENCE, "{last:?}");
            last = subscriber.line::<Shown>();
        }
        last
    };
    let near = |value: Option<f64>, expected: f64| {
        value.is_some_and(|value| (value - expected).abs() < 0.03)
    };
    // A message before that is of no robot or of a part of the map.
    let first = until(&|shown| near(shown.values[0].elevation, 0.0));
    assert_eq!(first.frame, "map");
    assert_eq!(first.resolution, f64::from(0.1_f32));
    for length_m in first.lengths {
        assert!((length_m - 12.0).abs() < 0.11, "{length_m}");
    }
    assert_eq!(first.basic, ["elevation"]);
    let names = ["elevation", "slope", "step", "clearance", "traversability"];
    assert_eq!(first.names, names);
    let [ground, terrace, below_roof, beside, lid, outside] = &first.values[..] else {
        panic!("{first:?}");
    };
    for (values, height_m) in [(ground, 0.0), (beside, 0.0), (lid, 0.0)] {
        assert!(
            near(values.elevation, height_m) && near(values.slope, 0.0),
            "{values:?}"
        );
        assert!(
            near(values.step, 0.0) && values.clearance.is_none(),
            "{values:?}"
        );
        assert!(
            values.traversability.is_some_and(|value| value > 0.6),
            "{values:?}"
        );
    }
    assert!(near(terrace.elevation, 0.3), "{terrace:?}");
    assert_eq!(terrace.traversability, None, "never reached");
    assert!(
        near(below_roof.elevation, 0.0) && near(below_roof.clearance, 2.2),
        "{below_roof:?}"
    );
    assert_eq!((outside.elevation, outside.traversability), (None, None));

    for chunk in update {
        driver.updates.publish(chunk).unwrap();
    }
    let second = until(&|shown| near(shown.values[4].elevation, 0.5));
    assert_eq!(second.values[4].traversability, Some(0.0), "{second:?}");
    assert!(near(second.values[0].elevation, 0.0), "{second:?}");
    drop(subscriber);
    nodes.finish();
    let report: ProjectorReport = report::read(&report_file).unwrap();
    assert!(report.counts.elevations_out >= 2, "{report:?}");
    assert_eq!(report.counts.elevations_refused, 0);
}
