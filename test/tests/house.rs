//! The simulated house on the mesh of a real one.

use std::time::Instant;

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::simulate::house::{
    HeadsetOptions, HeadsetTrial, House, LabelModel, RegionLabels, Scene, Survey, SurveyMap,
    SurveyOptions,
};
use lattice_nodes::files::classes::read_classes;
use lattice_nodes::files::points::read_mesh;
use lattice_test::data::shared;
use nalgebra::{Point3, Vector3};

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
    let start = Instant::now();
    let Some(house) = real_house() else { return };
    println!(
        "house read and sorted in {:?}, {} regions",
        start.elapsed(),
        house.regions().len()
    );

    let start = Instant::now();
    let survey = Survey::new(&house, &SurveyOptions::default(), 1).unwrap();
    println!(
        "survey of {} points in {:?}",
        survey.cloud.len(),
        start.elapsed()
    );
    assert!(survey.cloud.len() > 1_000_000);
    let lattice = Lattice::new(LatticeKind::Cubic, 0.05_f64.powi(3)).unwrap();
    let start = Instant::now();
    let map = SurveyMap::new(&survey, &lattice).unwrap();
    println!("{} voxels in {:?}", map.len(), start.elapsed());
    assert!((100_000..400_000).contains(&map.len()));
    let start = Instant::now();
    let cloud = map.cloud(&RegionLabels::truth(&house));
    println!("relabelled in {:?}", start.elapsed());
    let near = cloud
        .points_m
        .iter()
        .step_by(101)
        .filter(|p| near_m(&house, p) < 0.06);
    let share = near.count() as f64 / (cloud.len() as f64 / 101.0);
    println!("{share:.3} of the map within 6 cm of a surface");
    assert!(share > 0.95);

    for scene in Scene::ALL {
        for seed in 0..8 {
            let start = Instant::now();
            let options = HeadsetOptions::default();
            let trial = HeadsetTrial::new(&house, scene, &options, seed).unwrap();
            let took = start.elapsed();
            let gaze = &trial.gazes[0];
            let points = gaze.points_m.iter().step_by(7);
            let off = points.map(|p| near_m(&house, &(trial.map_from_headset * p)));
            let mut off_m: Vec<f64> = off.collect();
            off_m.sort_by(f64::total_cmp);
            let within = off_m.partition_point(|d| *d < 0.1) as f64 / off_m.len() as f64;
            let object = house.class(scene.object());
            let label = |r: &u16| house.regions().get(usize::from(*r)).map(|r| r.label);
            let of_object = gaze.regions.iter().filter(|r| label(r) == object).count();
            let draw = LabelModel::flips(0.5).draw(&house, &trial, seed).unwrap();
            println!(
                "{} {seed}: {} points, {:.2} of the object, {within:.3} within 10 cm, median {:.3} m, 90 % {:.3} m, {} triangles, q 0.5 -> {:.2}, {took:?}",
                scene.name(),
                off_m.len() * 7,
                of_object as f64 / gaze.regions.len() as f64,
                off_m[off_m.len() / 2],
                off_m[off_m.len() * 9 / 10],
                trial.mesh.len(),
                draw.different_share,
            );
            assert!(gaze.points_m.len() > 4000);
            assert!(within > 0.9);
            assert!(off_m[off_m.len() / 2] < 0.04);
            assert!(of_object > 200);
        }
    }
}
