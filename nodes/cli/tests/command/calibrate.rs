//! `lattice calibrate` as a user runs it.

use std::path::Path;
use std::process::Output;

use nalgebra::{Isometry3, Point3, Vector3};
use serde_json::Value;

use crate::{error, lattice};

fn calibrate(arguments: &[&str]) -> Output {
    lattice(&[&["calibrate"], arguments].concat())
}

fn answer(output: &Output) -> Value {
    let errors = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{errors}"))
}

struct Labelled(Vec<(Point3<f64>, u16)>);

impl Labelled {
    fn boxed(&mut self, low: [f64; 3], high: [f64; 3], label: u16) {
        let step = 0.04;
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let count = |a: usize| ((high[a] - low[a]) / step) as usize;
            for (i, j) in (0..=count(u)).flat_map(|i| (0..=count(v)).map(move |j| (i, j))) {
                for side in [low[axis], high[axis]] {
                    let mut p = [0.0; 3];
                    p[axis] = side;
                    p[u] = low[u] + step * i as f64;
                    p[v] = low[v] + step * j as f64;
                    self.0.push((p.into(), label));
                }
            }
        }
    }

    /// A room of 6 m by 4.5 m with furniture that is nowhere the same.
    fn room() -> Labelled {
        let mut room = Labelled(Vec::new());
        room.boxed([0.0, 0.0, 0.0], [6.0, 4.5, 2.4], 0);
        room.boxed([0.3, 0.2, 0.0], [1.9, 0.9, 0.75], 5);
        room.boxed([4.6, 0.1, 0.0], [5.9, 0.6, 1.9], 9);
        room.boxed([3.2, 3.2, 0.0], [5.0, 4.3, 0.45], 8);
        room.boxed([0.1, 2.9, 0.0], [0.6, 3.6, 1.2], 4);
        room
    }

    fn write(&self, directory: &Path, name: &str, of: impl Fn(&Point3<f64>) -> [f64; 3]) -> String {
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nproperty ushort label\nend_header\n",
            self.0.len()
        );
        for (point, label) in &self.0 {
            let [x, y, z] = of(point);
            text += &format!("{x:.5} {y:.5} {z:.5} {label}\n");
        }
        let path = directory.join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    }
}

fn truth() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(2.6, 2.2, 1.5), Vector3::z() * 2.0)
}

/// Points in front of the headset, within 70 degrees.
fn seen(room: &Labelled) -> Labelled {
    let headset_from_map = truth().inverse();
    let in_view = |p: &Point3<f64>| p.x > 0.3 && p.y.abs() < 0.7 * p.x && p.z < 0.6 * p.x;
    let points = room.0.iter().map(|(p, l)| (headset_from_map * p, *l));
    Labelled(points.filter(|(p, _)| in_view(p)).collect())
}

fn check_pose(answer: &Value) {
    let pose = &answer["map_from_cloud"];
    let expected = truth().translation.vector;
    for axis in 0..3 {
        let found = pose["translation_m"][axis].as_f64().unwrap();
        assert!((found - expected[axis]).abs() < 0.03, "{pose}");
    }
    let yaw_deg = pose["yaw_deg"].as_f64().unwrap();
    assert!((yaw_deg - 2.0_f64.to_degrees()).abs() < 0.7, "{pose}");
}

#[test]
fn a_cloud_is_found_without_a_guess_whatever_its_axes_and_labels_are_learned() {
    let folder = tempfile::tempdir().unwrap();
    let room = Labelled::room();
    let map = room.write(folder.path(), "map.ply", |p| p.coords.into());
    let seen = seen(&room);
    let ros = seen.write(folder.path(), "ros.ply", |p| p.coords.into());
    let unity = seen.write(folder.path(), "unity.ply", |p| [-p.y, p.z, p.x]);
    let names = folder.path().join("classes.yaml");
    std::fs::write(&names, "classes: {0: wall, 8: sofa}").unwrap();
    let names = names.display().to_string();
    let learned = folder.path().join("learned.json");
    let learned_name = learned.display().to_string();

    let arguments = ["--map", &map, "--cloud", &ros, "--labels", &names];
    let more = ["--sensor", "0 0 0", "--confusion", &learned_name, "--json"];
    let output = calibrate(&[&arguments[..], &more].concat());
    let first = answer(&output);
    assert!(output.status.success(), "{first}");
    assert_eq!(first["verdict"], "OK");
    check_pose(&first);
    let classes = first["classes"].as_array().unwrap();
    let wall = classes.iter().find(|c| c["class"] == 0).unwrap();
    assert_eq!(wall["name"], "wall");
    assert!(wall["agreement"].as_f64().unwrap() > 0.8);
    assert_eq!(first["covariance"].as_array().unwrap().len(), 36);

    // The learned confusion is read again.
    assert!(learned.exists());
    let axes = ["--map", &map, "--cloud", &unity, "--axes", "unity_ruf"];
    let more = ["--confusion", &learned_name, "--json"];
    let output = calibrate(&[&axes[..], &more].concat());
    assert!(output.status.success());
    check_pose(&answer(&output));

    let text = calibrate(&["--map", &map, "--cloud", &ros, "--guess", "2.5 2.1 1.5 110"]);
    let text = String::from_utf8(text.stdout).unwrap();
    let lines = "verdict        OK|translation    2.|sigma |log-margin |time ";
    for line in lines.split('|') {
        assert!(text.contains(line), "{text}");
    }
}

#[test]
fn what_is_not_ok_fails_and_is_printed_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let room = Labelled::room();
    let map = room.write(folder.path(), "map.ply", |p| p.coords.into());
    // A piece of bare floor is everywhere.
    let of_floor = room
        .0
        .iter()
        .filter(|(p, _)| p.z == 0.0 && p.x < 1.0 && p.y < 1.0);
    let floor = Labelled(of_floor.copied().collect());
    let floor = floor.write(folder.path(), "floor.ply", |p| p.coords.into());
    let output = calibrate(&["--map", &map, "--cloud", &floor, "--json"]);
    let verdict = answer(&output)["verdict"].as_str().unwrap().to_owned();
    assert_ne!(verdict, "OK");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && errors.lines().count() == 1);
    assert!(errors.contains(&verdict), "{errors}");
}

#[test]
fn single_registrations_start_from_the_guess() {
    let folder = tempfile::tempdir().unwrap();
    let room = Labelled::room();
    let map = room.write(folder.path(), "map.ply", |p| p.coords.into());
    let cloud = seen(&room).write(folder.path(), "cloud.ply", |p| p.coords.into());
    let guess = "2.65 2.15 1.5 116";
    let common = ["--map", &map, "--cloud", &cloud, "--guess", guess];
    for method in ["gicp", "gicp-se3", "semantic-published", "class-wise"] {
        let output = calibrate(&[&common[..], &["--json", "--method", method]].concat());
        let answer = answer(&output);
        assert!(output.status.success(), "{answer}");
        assert_eq!(
            (&answer["verdict"], &answer["converged"]),
            (&Value::Null, &Value::Bool(true))
        );
        check_pose(&answer);
    }
}

#[test]
fn faults_are_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let room = Labelled::room();
    let map = room.write(folder.path(), "map.ply", |p| p.coords.into());
    let none = Labelled(Vec::new()).write(folder.path(), "none.ply", |p| p.coords.into());
    let nan = folder.path().join("nan.xyz").display().to_string();
    std::fs::write(&nan, "nan 0 0\n0 inf 1\n").unwrap();
    let common = ["--map", &map, "--cloud", &map];
    for (arguments, message) in [
        (vec!["--map", "/no/such", "--cloud", &map], "/no/such: "),
        (vec!["--map", &map, "--cloud", "/no/such"], "/no/such: "),
        (
            vec!["--map", &none, "--cloud", &map],
            "none.ply: the file has no points",
        ),
        (
            vec!["--map", &nan, "--cloud", &map],
            "nan.xyz: none of its 2 points is finite",
        ),
        (
            vec!["--map", &map, "--cloud", &nan],
            "nan.xyz: none of its 2 points is finite",
        ),
        (
            [&common[..], &["--cell", "1e-9"]].concat(),
            "or more (`--cell`)",
        ),
        (
            [&common[..], &["--min-inliers", "40"]].concat(),
            "--min-inliers 40 is outside 0 to 1",
        ),
        ([&common[..], &["--labels", &map]].concat(), "map.ply: "),
        ([&common[..], &["--confusion", &map]].concat(), "map.ply: "),
        (
            [&common[..], &["--cell", "0"]].concat(),
            "--cell 0 is not above 0",
        ),
    ] {
        let text = error(&[&["calibrate"], &arguments[..]].concat());
        assert!(text.contains(message), "{text}");
    }
    // Those of the command line itself come with the usage.
    let output = calibrate(&[&common[..], &["--guess", "1 2 3"]].concat());
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("3 numbers instead of 4 or 7"), "{text}");
}

#[test]
fn axes_and_scale_that_are_wrong_are_told_and_thresholds_can_be_set() {
    let folder = tempfile::tempdir().unwrap();
    let room = Labelled::room();
    let map = room.write(folder.path(), "map.ply", |p| p.coords.into());
    let seen = seen(&room);
    let ros = seen.write(folder.path(), "ros.ply", |p| p.coords.into());
    let small = seen.write(folder.path(), "small.ply", |p| (p.coords * 0.95).into());
    let ask = |cloud: &str, more: &[&str]| {
        let common = [
            "--map", &map, "--cloud", cloud, "--sensor", "0 0 0", "--json",
        ];
        let output = calibrate(&[&common[..], more].concat());
        let found = answer(&output);
        assert_eq!(output.status.success(), found["verdict"] == "OK", "{found}");
        found
    };
    let reason = |found: &Value| found["reason"].as_str().unwrap().to_owned();
    for axes in ["unity_ruf", "optical"] {
        let found = ask(&ros, &["--axes", axes]);
        assert_eq!(found["verdict"], "REJECTED_INPUT");
        let said = "fits as ros_flu: the cloud was converted twice";
        assert!(reason(&found).contains(said), "{found}");
    }
    let found = ask(&ros, &["--axes", "unity_ruf", "--trust-axes"]);
    assert!(!reason(&found).contains("fits as"), "{found}");
    assert_eq!(ask(&ros, &["--trust-axes"])["verdict"], "OK");
    let found = ask(&small, &[]);
    assert_eq!(found["verdict"], "REJECTED_INPUT");
    assert!(reason(&found).contains("multiplied by 1.05"), "{found}");
    let found = ask(&small, &["--estimate-scale"]);
    assert_eq!(found["verdict"], "OK", "{found}");
    assert!((found["scale"].as_f64().unwrap() - 1.0 / 0.95).abs() < 0.005);
    check_pose(&found);
    assert_eq!(ask(&small, &["--max-scale-error", "0.2"])["verdict"], "OK");
    let found = ask(&ros, &["--profile", "depth_camera"]);
    assert_eq!(
        (&found["verdict"], &found["profile"]),
        (&"OK".into(), &"depth_camera".into())
    );
    assert_eq!(ask(&ros, &["--from", "lidar"])["profile"], "lidar");
    let found = ask(&ros, &["--max-p-wrong", "1e-12"]);
    let is_sure = found["p_wrong"].as_f64().unwrap() <= 1e-12;
    assert_eq!(found["verdict"], if is_sure { "OK" } else { "AMBIGUOUS" });
    let output = calibrate(&["--map", &map, "--cloud", &ros, "--max-p-wrong", "0.9"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !output.status.success() && said.contains("--max-p-wrong"),
        "{said}"
    );
    let found = ask(&ros, &["--min-inliers", "1"]);
    assert!(found["verdict"] == "OK" || reason(&found).contains("below 100 %"));
}

#[test]
fn maps_and_clouds_in_utm_are_registered_as_those_about_their_origin() {
    let folder = tempfile::tempdir().unwrap();
    let (room, utm) = (
        Labelled::room(),
        Vector3::new(448_007.4, 5_410_997.1, 298.5),
    );
    // Doubles: single precision has steps of half a metre there.
    let write = |of: &Labelled, name: &str, by: Vector3<f64>| {
        let path = of.write(folder.path(), name, |p| (p + by).coords.into());
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("float", "double")).unwrap();
        path
    };
    let seen = seen(&room);
    let (map, cloud) = ("map.ply", "cloud.ply");
    let near = [
        write(&room, map, Vector3::zeros()),
        write(&seen, cloud, Vector3::zeros()),
    ];
    let far = [
        write(&room, "far_map.ply", utm),
        write(&seen, "far_cloud.ply", utm),
    ];
    let found = |map: &str, cloud: &str, more: &[&str]| {
        let arguments = ["--map", map, "--cloud", cloud, "--cell", "0.08", "--json"];
        let output = calibrate(&[&arguments[..], more].concat());
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{map} {cloud} {more:?}: {errors}");
        answer(&output)
    };
    let pose = |answer: &Value| {
        let list = |key: &str| -> Vec<f64> {
            serde_json::from_value(answer["map_from_cloud"][key].clone()).unwrap()
        };
        let (t, q) = (list("translation_m"), list("rotation_xyzw"));
        let turn = nalgebra::Quaternion::new(q[3], q[0], q[1], q[2]);
        Isometry3::from_parts(
            Vector3::from_column_slice(&t).into(),
            nalgebra::UnitQuaternion::from_quaternion(turn),
        )
    };
    let middle = truth().inverse() * Point3::new(3.0, 2.0, 1.0);
    let far_guess = Isometry3::from_parts(utm.into(), Default::default()) * truth();
    let words = |pose: &Isometry3<f64>| {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
    };
    let both = far_guess * nalgebra::Translation3::from(-utm);
    let (one_far, both_far) = (words(&far_guess), words(&both));
    let gicp = |guess| ["--method", "gicp", "--gate", "0.3", "--guess", guess];
    for (files, shift, guess) in [
        ([&far[0], &near[1]], Vector3::zeros(), one_far.as_str()),
        ([&far[0], &far[1]], utm, both_far.as_str()),
    ] {
        for more in [&[][..], &["--guess", guess], &gicp(guess)] {
            let answer = found(files[0], files[1], more);
            let error = pose(&answer) * (middle + shift) - (truth() * middle + utm);
            assert!(error.norm() < 0.03, "{more:?}: {error:?}");
            assert_eq!(
                answer["cloud_middle_m"].is_null(),
                shift == Vector3::zeros()
            );
        }
    }
    let error = error(&[
        "calibrate",
        "--map",
        &far[0],
        "--cloud",
        &near[1],
        "--cell",
        "0.00001",
    ]);
    assert!(
        error.contains("is 6.0 m long: use 1.2e-5 m or more"),
        "{error}"
    );
}
