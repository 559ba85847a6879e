//! The action `compute_path_to_pose` at a foreign client, with the layouts of two distributions.

use std::ffi::OsStr;
use std::fs;
use std::time::Duration;

use lattice_core::lattice::LatticeKind;
use lattice_nodes::map_projector::{PlanCounts, ProjectorReport};
use lattice_nodes::report;
use lattice_test::domain::TestDomain;
use lattice_test::maps;
use lattice_test::peer::{Nodes, Script, params};
use lattice_test::python::python;
use serde::Deserialize;
use serde_json::json;

use super::map_driver::MapDriver;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(120);

const SUCCEEDED: u8 = 4;
const CANCELED: u8 = 5;
const ABORTED: u8 = 6;

/// End of a goal.
#[derive(Debug, Deserialize)]
struct Ended {
    status: u8,
    code: u16,
    text: Option<String>,
    frame: String,
    seconds: f64,
    /// x, y, z and yaw of each pose.
    path: Vec<[f64; 4]>,
}

/// Points of a floor of 6 m by 6 m with a wall to two thirds of its depth, and of an island.
fn points() -> Vec<[f32; 3]> {
    let side = |i: u8| 0.1 * f32::from(i) + 0.05;
    let floor =
        |from: f32| (0..60).flat_map(move |x| (0..60).map(move |y| [from + side(x), side(y), 0.0]));
    let wall = (0..40).flat_map(|y| (0..20).map(move |z| [3.0, side(y), side(z)]));
    floor(0.0).chain(wall).chain(floor(20.0)).collect()
}

#[test]
fn a_foreign_client_of_nav2s_action_gets_paths_and_refusals() {
    let Some(python) = python() else {
        return;
    };
    for distribution in ["kilted", "jazzy"] {
        let domain = TestDomain::take();
        let folder = tempfile::tempdir().unwrap();
        let [report_file, scenario] = ["report", "goals"].map(|name| folder.path().join(name));
        let goals = json!([
            {"at": [5, 1, 0], "yaw": 2.0},
            {"at": [5, 1, 0.2], "start": [5, 5, 0.2]},
            {"at": [-5, 1, 0], "frame": "site"},
            {"at": [23, 3, 0]},
            {"at": [100, 0, 0]},
            {"at": [5, 1, 0], "start": [-50, 0, 0]},
            {"at": [-0.1, -0.1, 0.2]},
            {"at": [0, 0, 0], "frame": "nowhere"},
        ]);
        fs::write(&scenario, goals.to_string()).unwrap();
        let mut mapper = maps::mapper(maps::options(LatticeKind::Fcc, 0.008));
        maps::insert(&mut mapper, &points());
        let file = report_file.display();
        let given = format!("plan:=true update_period_s:=0.1 report_file:={file}");
        let nodes = Nodes::start(&domain, &[("map_projector", params(&given))]);
        let places = [("base_link", [1.0, 1.0, 0.3]), ("site", [10.0, 0.0, 0.0])];
        let driver = MapDriver::start(&domain, &places);
        let id = domain.id().to_string();
        let args = [
            OsStr::new(&id),
            OsStr::new(distribution),
            scenario.as_os_str(),
        ];
        let mut client = Script::start(&python, "plan_peer.py", args);
        // A goal has the node follow the map; it is canceled before that has come.
        driver.until_asked(PATIENCE);
        assert_eq!(client.line::<[u16; 3]>(), [0, u16::from(CANCELED), 0]);
        driver.send(&mapper.keyframe());
        let (ended, plans): (Vec<Ended>, Vec<usize>) = client.line();
        drop(client);
        nodes.finish();

        let (found, failed) = ended.split_at(3);
        for ended in found {
            assert_eq!((ended.status, ended.code), (SUCCEEDED, 0), "{ended:?}");
            assert_eq!(ended.frame, "map");
            assert!((1e-6..3.0).contains(&ended.seconds), "{ended:?}");
            let [x, y, ..] = ended.path.last().unwrap();
            assert!((x - 5.0).abs() < 0.2 && (y - 1.0).abs() < 0.2, "{ended:?}");
            let near_wall = ended.path.iter().filter(|[x, ..]| (x - 3.0).abs() < 0.3);
            assert!(near_wall.clone().all(|[_, y, ..]| *y > 4.2), "{ended:?}");
            assert_eq!(near_wall.count() == 0, ended.path[0][0] > 4.0);
            assert!(ended.path.iter().all(|[_, _, z, _]| z.abs() < 0.05));
            for pair in ended.path.windows(2) {
                let along = (pair[1][1] - pair[0][1]).atan2(pair[1][0] - pair[0][0]);
                assert!((pair[0][3] - along).sin().abs() < 1e-6, "{pair:?}");
            }
        }
        assert!((found[0].path.last().unwrap()[3] - 2.0).abs() < 1e-6);
        let lengths: Vec<usize> = found.iter().map(|ended| ended.path.len()).collect();
        assert_eq!(plans, lengths, "published on plan");
        // NO_VALID_PATH, GOAL_OUTSIDE_MAP, START_OUTSIDE_MAP, GOAL_OCCUPIED, TF_ERROR.
        let codes: Vec<u16> = failed.iter().map(|ended| ended.code).collect();
        assert_eq!(codes, [208, 204, 203, 206, 202], "{failed:?}");
        let texts = [
            "not among",
            "outside of the map",
            "start",
            "no room",
            "from nowhere to map",
        ];
        for (ended, text) in failed.iter().zip(texts) {
            assert!(
                ended.status == ABORTED && ended.path.is_empty(),
                "{ended:?}"
            );
            let said = ended.text.as_deref();
            assert_eq!(said.is_some(), distribution == "kilted");
            let is_said = said.is_none_or(|said| said.contains(text));
            assert!(is_said, "{ended:?}");
        }
        let report: ProjectorReport = report::read(&report_file).unwrap();
        let expected = PlanCounts {
            plans_out: 3,
            plans_failed: 5,
            plans_canceled: 1,
        };
        assert_eq!(report.plans, expected);
        assert_eq!(report.counts.grids_out, 0, "nobody subscribes to the grid");
    }
}
