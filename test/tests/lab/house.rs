//! The simulated house: on the mesh of a real one, and as files.

use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::registration::SemanticCloud;
use lattice_core::voxels::file::read_map;
use lattice_lab::datasets::{
    CLASSES_FILE, HeadsetAxes, HouseOptions, MAP_FILE, SceneTruth, write_house,
};
use lattice_lab::mesh::read_mesh;
use lattice_lab::simulate::house::{
    HeadsetTrial, House, LabelDraw, RegionLabels, Scene, Survey, SurveyMap, SurveyOptions,
};
use lattice_nodes::files::classes::read_classes;
use lattice_nodes::files::points::{PointFileOptions, read_points};
use lattice_test::data::shared;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use std::fs;
use std::path::Path;

fn real_house() -> Option<House> {
    let mesh = read_mesh(&shared("house/small_house.ply")?, 1_000_000).unwrap();
    assert_eq!(mesh.len(), 145_233);
    let names = read_classes(&shared("house/classes.yaml")?).unwrap();
    Some(House::from_mesh(mesh, names).unwrap())
}

/// Shortest way from a point to a surface in many directions, metres.
fn near_m(house: &House, p: &Point3<f64>) -> f64 {
    let direction = |i: usize| {
        // Fibonacci's sphere.
        let z = 1.0 - (2.0 * i as f64 + 1.0) / 200.0;
        let angle = i as f64 * 2.399_963_229_728_653;
        let r = (1.0 - z * z).sqrt();
        Vector3::new(r * angle.cos(), r * angle.sin(), z)
    };
    let hits = (0..200).filter_map(|i| house.cast(p, &direction(i), 0.5));
    hits.map(|hit| hit.distance_m).fold(0.5, f64::min)
}

#[test]
fn a_robot_and_headsets_see_the_real_house() {
    let Some(house) = real_house() else { return };
    let survey = Survey::new(&house, &SurveyOptions::default(), 1).unwrap();
    assert!(survey.cloud.len() > 1_000_000);
    let lattice = Lattice::new(LatticeKind::Cubic, 0.05_f64.powi(3)).unwrap();
    let map = SurveyMap::new(&survey, &lattice).unwrap();
    assert!((100_000..400_000).contains(&map.len()));
    let cloud = map.cloud(&RegionLabels::truth(&house));
    let some = cloud.points_m.iter().step_by(101);
    let near = some.filter(|p| near_m(&house, p) < 0.06);
    let share = near.count() as f64 / (cloud.len() as f64 / 101.0);
    assert!(share > 0.95, "{share}");

    for scene in Scene::ALL {
        for seed in 0..3 {
            let trial = HeadsetTrial::new(&house, scene, 1, seed).unwrap();
            let headset_scan = &trial.headset_scans[0];
            let points = headset_scan.points_m.iter().step_by(7);
            let off = points.map(|p| near_m(&house, &(trial.map_from_headset * p)));
            let mut off_m: Vec<f64> = off.collect();
            off_m.sort_by(f64::total_cmp);
            let within = off_m.partition_point(|d| *d < 0.1) as f64 / off_m.len() as f64;
            let object = house.class(scene.object());
            let label = |r: &u16| house.regions().get(usize::from(*r)).map(|r| r.label);
            let of_object = headset_scan.regions.iter().filter(|r| label(r) == object);
            assert!(headset_scan.points_m.len() > 4000);
            assert!(within > 0.9);
            assert!(off_m[off_m.len() / 2] < 0.04);
            assert!(of_object.count() > 200);
            LabelDraw::new(&house, std::slice::from_ref(&trial), 0.5, seed).unwrap();
        }
    }
}

/// The files of `lattice simulate house`, read back.
fn options(out: &Path, overwrite: bool) -> HouseOptions {
    HouseOptions {
        out: out.to_owned(),
        overwrite,
        mesh: None,
        map_from_house: Isometry3::new(Vector3::new(300.0, -80.0, 5.0), Vector3::z() * 2.0),
        seed: 3,
        survey: SurveyOptions {
            width: 64,
            height: 48,
            ..SurveyOptions::default()
        },
        headset_scans: 2,
        flips: 0.4,
        lattice: LatticeKind::Fcc,
        cell_side_m: 0.05,
        axes: HeadsetAxes::Unity,
    }
}

#[test]
fn the_folder_of_a_house_holds_a_map_and_clouds_that_the_truth_brings_together() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("house");
    let mut heard = Vec::new();
    let summary = write_house(&options(&out, false), &mut |done| heard.push(done)).unwrap();
    assert!(heard.is_sorted() && heard.last() == Some(&1.0));
    assert!((summary.different_share - 0.4).abs() < 0.15, "{summary}");
    let names = read_classes(&out.join(CLASSES_FILE)).unwrap();
    assert_eq!(names[&9], "bookshelf");

    let bytes = fs::read(out.join(MAP_FILE)).unwrap();
    let map = read_map(bytes.as_slice(), 10_000_000).unwrap();
    assert!(map.payload().labels);
    assert_eq!(map.len(), summary.voxels);
    let cloud = SemanticCloud::from_voxels(&map);
    assert!(cloud.labels.iter().all(|label| label.top().is_some()));
    for scene in Scene::ALL {
        let text = fs::read_to_string(out.join(format!("{}.json", scene.name()))).unwrap();
        let truth: SceneTruth = serde_json::from_str(&text).unwrap();
        assert_eq!(truth.axes, HeadsetAxes::Unity);
        assert_eq!(truth.headset_scans.len(), 2);
        let [x, y, z, w] = truth.map_from_headset.rotation_xyzw;
        let map_from_headset = Isometry3::from_parts(
            Translation3::from(Vector3::from(truth.map_from_headset.translation_m)),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        );
        for headset_scan in &truth.headset_scans {
            let file =
                read_points(&out.join(&headset_scan.cloud), &PointFileOptions::default()).unwrap();
            assert_eq!(
                file.points_m.len(),
                summary.headset_points[&headset_scan.cloud]
            );
            assert_eq!(file.labels.len(), file.points_m.len());
            let known = |label: &&u16| names.contains_key(label);
            let labelled = file.labels.iter().filter(known).count();
            assert!(labelled as f64 > 0.9 * file.labels.len() as f64);
            // Left-handed to ROS axes, then where the truth says: on occupied cells or beside them.
            let in_map = |[x, y, z]: [f64; 3]| map_from_headset * Point3::new(z, -x, y);
            let sampled = file.points_m.iter().step_by(13);
            let sampled: Vec<_> = sampled.map(|p| in_map(*p)).collect();
            let hit = sampled.iter().filter(|p| {
                let key = |d: Vector3<f64>| map.lattice().quantize(&(p.coords + d - map.datum_m()));
                let steps = (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1].map(f64::from));
                steps.map(|d| Vector3::from(d) * 0.06).any(|d| {
                    let key = key(d).and_then(MortonKey::pack);
                    key.is_some_and(|key| map.contains(key))
                })
            });
            let share = hit.count() as f64 / sampled.len() as f64;
            assert!(share > 0.6, "{}: {share}", headset_scan.cloud);
            let sensor = in_map(headset_scan.sensor_m);
            assert!((sensor.z - 5.0 - 1.62).abs() < 0.2, "{sensor}");
        }
    }

    let again = write_house(&options(&out, false), &mut |_| {}).unwrap_err();
    assert!(again.to_string().contains("overwrite"), "{again}");
    let first = fs::read(out.join("desk.ply")).unwrap();
    write_house(&options(&out, true), &mut |_| {}).unwrap();
    assert!(fs::read(out.join("desk.ply")).unwrap() == first);
    assert!(fs::read(out.join(MAP_FILE)).unwrap() == bytes);
}

#[test]
fn a_mesh_that_is_no_house_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("cube.ply");
    let classes = folder.path().join("classes.yaml");
    fs::write(&classes, "classes: {0: wall}\n").unwrap();
    let corners = "0 0 0\n1 0 0\n0 1 0\n";
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    for (face, message) in [
        ("3 0 1 2\n", "no free floor within walls"),
        ("3 0 1 7\n", "triangle 0 refers to vertex 7"),
        ("2 0 1\n", "a polygon of 2 corners"),
    ] {
        fs::write(&mesh, format!("{head}{corners}{face}")).unwrap();
        let options = HouseOptions {
            mesh: Some((mesh.clone(), classes.clone())),
            ..options(&folder.path().join("out"), false)
        };
        let fault = write_house(&options, &mut |_| {}).unwrap_err().to_string();
        assert!(fault.contains(message), "{fault}");
    }
}
