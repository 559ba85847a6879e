//! A house of one room, small enough to know all of it.

use super::*;
use crate::mesh::LabelledMesh;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::registration::SemanticCloud;
use nalgebra::{Isometry3, Point3, Vector3};
use std::collections::BTreeMap;

#[derive(Default)]
struct Boxes {
    vertices_m: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    labels: Vec<u16>,
    instances: Vec<u16>,
    next: u16,
}

impl Boxes {
    fn add(&mut self, label: u16, low: [f32; 3], high: [f32; 3]) {
        let first = self.vertices_m.len() as u32;
        for i in 0..8 {
            let at = |axis: usize| [low, high][i >> axis & 1][axis];
            self.vertices_m.push([0, 1, 2].map(at));
        }
        let [x, y] = [[0, 2, 6, 4], [0, 1, 5, 4]];
        for quad in [[0, 1, 3, 2], [4, 5, 7, 6], y, [2, 3, 7, 6], x, [1, 3, 7, 5]] {
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                self.triangles
                    .push([a, b, c].map(|i: usize| first + quad[i]));
                self.labels.push(label);
                self.instances.push(self.next);
            }
        }
        self.next += 1;
    }
}

fn names() -> BTreeMap<u16, String> {
    let names = "wall floor ceiling tv cabinet desk table chair sofa bookshelf";
    (0..).zip(names.split(' ').map(str::to_owned)).collect()
}

/// A room of 6 x 5 x 2.8 m within walls of 0.1 m.
fn room() -> House {
    let mut boxes = Boxes::default();
    boxes.add(1, [-0.1, -0.1, -0.1], [6.1, 5.1, 0.0]);
    boxes.add(2, [-0.1, -0.1, 2.8], [6.1, 5.1, 2.9]);
    boxes.add(0, [-0.1, -0.1, 0.0], [0.0, 5.1, 2.8]);
    boxes.add(0, [6.0, -0.1, 0.0], [6.1, 5.1, 2.8]);
    boxes.add(0, [0.0, -0.1, 0.0], [6.0, 0.0, 2.8]);
    boxes.add(0, [0.0, 5.0, 0.0], [6.0, 5.1, 2.8]);
    boxes.add(4, [1.0, 4.5, 0.0], [2.6, 5.0, 0.5]);
    boxes.add(3, [1.2, 4.8, 0.6], [2.4, 4.9, 1.3]);
    boxes.add(5, [5.3, 1.0, 0.0], [6.0, 2.4, 0.74]);
    boxes.add(9, [3.6, 4.7, 0.0], [4.6, 5.0, 1.9]);
    boxes.add(6, [1.6, 1.2, 0.7], [2.8, 2.0, 0.75]);
    boxes.add(7, [1.1, 1.4, 0.0], [1.5, 1.8, 0.45]);
    boxes.add(7, [2.9, 1.4, 0.0], [3.3, 1.8, 0.45]);
    let Boxes {
        vertices_m,
        triangles,
        labels,
        instances,
        ..
    } = boxes;
    let mesh = LabelledMesh::new(vertices_m, triangles, labels, instances).unwrap();
    House::from_mesh(mesh, names()).unwrap()
}

fn pose() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(4.0e5, -3.0e3, 21.0), Vector3::z() * 0.7)
}

/// Distance of a point of the house to its surfaces, metres, at most `most_m`.
fn distance_m(house: &House, p: &Point3<f64>, most_m: f64) -> f64 {
    let to = house.mesh().corners_m().map(|corners| {
        let [a, b, c] = corners.map(|p| Point3::from(p.map(f64::from)));
        to_triangle_m(p, a, b, c)
    });
    to.fold(most_m, f64::min)
}

/// Ericson, Real-Time Collision Detection, 5.1.5.
fn to_triangle_m(p: &Point3<f64>, a: Point3<f64>, b: Point3<f64>, c: Point3<f64>) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let normal = ab.cross(&ac);
    let n2 = normal.norm_squared();
    if n2 > 0.0 {
        let v = ap.cross(&ac).dot(&normal) / n2;
        let w = ab.cross(&ap).dot(&normal) / n2;
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return ap.dot(&normal).abs() / n2.sqrt();
        }
    }
    let to_edge = |a: Point3<f64>, b: Point3<f64>| {
        let ab = b - a;
        let t = ((p - a).dot(&ab) / ab.norm_squared().max(1e-300)).clamp(0.0, 1.0);
        (p - (a + ab * t)).norm()
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

fn small() -> SurveyOptions {
    SurveyOptions {
        views: 64,
        width: 48,
        height: 36,
    }
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    crate::pool(threads).unwrap().install(work)
}

#[test]
fn a_survey_is_the_same_on_any_number_of_threads_and_lies_on_the_surfaces() {
    let house = room().placed(pose());
    let survey = on_threads(1, || Survey::new(&house, &small(), 3).unwrap());
    assert!(on_threads(4, || Survey::new(&house, &small(), 3).unwrap()) == survey);
    assert!(Survey::new(&house, &small(), 4).unwrap() != survey);
    assert_eq!(survey.sensors_m.len(), 64);
    let house_from_map = pose().inverse();
    let mut near = 0;
    let mut right = 0;
    let sample: Vec<usize> = (0..survey.cloud.len()).step_by(37).collect();
    for &i in &sample {
        let p = house_from_map * Point3::from(survey.cloud.point_m(i));
        near += usize::from(distance_m(&house, &p, 1.0) < 0.04);
        let label = house.regions()[usize::from(survey.regions[i])].label;
        let of_label = house.mesh().labels().iter().zip(house.mesh().corners_m());
        let of_label = of_label.filter(|(l, _)| **l == label);
        let to = of_label.map(|(_, t)| {
            let [a, b, c] = t.map(|p| Point3::from(p.map(f64::from)));
            to_triangle_m(&p, a, b, c)
        });
        right += usize::from(to.fold(f64::INFINITY, f64::min) < 0.1);
    }
    let [near, right] = [near, right].map(|n| n as f64 / sample.len() as f64);
    assert!(near > 0.97 && right > 0.95, "{near} {right}");
}

#[test]
fn the_headset_cloud_lies_where_the_truth_says() {
    let house = room().placed(pose());
    for scene in Scene::ALL {
        for seed in 0..3 {
            let scans = 1 + seed as usize % 2;
            let trial = HeadsetTrial::new(&house, scene, scans, seed).unwrap();
            let house_from_headset = pose().inverse() * trial.map_from_headset;
            let mut off_m = Vec::new();
            for headset_scan in &trial.headset_scans {
                assert_eq!(headset_scan.points_m.len(), headset_scan.regions.len());
                for p in headset_scan.points_m.iter().step_by(11) {
                    off_m.push(distance_m(&house, &(house_from_headset * p), 1.0));
                }
            }
            off_m.sort_by(f64::total_cmp);
            let within = off_m.partition_point(|d| *d < 0.1) as f64 / off_m.len() as f64;
            let median_m = off_m[off_m.len() / 2];
            assert!(trial.headset_scans[0].points_m.len() > 4000);
            assert!(within > 0.9, "{within}");
            assert!((0.002..0.04).contains(&median_m), "{median_m}");
            let up = trial.map_from_headset.rotation * Vector3::z();
            assert!(up.angle(&Vector3::z()).to_degrees() <= 0.5 + 1e-6);
            let object = house.class(scene.object());
            let of_object = trial.headset_scans[0]
                .regions
                .iter()
                .filter(|r| house.regions().get(usize::from(**r)).map(|r| r.label) == object);
            assert!(of_object.count() > 200, "{} is not looked at", scene.name());
        }
    }
}

#[test]
fn trials_depend_on_the_seed_alone() {
    let house = room();
    let trial = |seed| HeadsetTrial::new(&house, Scene::Desk, 1, seed).unwrap();
    let (a, b, c) = (trial(5), trial(5), trial(6));
    assert!(a.headset_scans == b.headset_scans);
    assert_eq!(a.map_from_headset, b.map_from_headset);
    assert!(a.headset_scans != c.headset_scans);
}

#[test]
fn flips_hit_the_share_asked_for() {
    let house = room();
    let trial = HeadsetTrial::new(&house, Scene::Tv, 1, 1).unwrap();
    let trials = [trial];
    let seen = &trials[0].headset_scans[0].regions;
    let regions = 0..house.regions().len() as u16;
    let count = |region: u16| seen.iter().filter(|r| **r == region).count();
    let largest = regions.map(count).max().unwrap() as f64 / seen.len() as f64;
    for q in [0.0, 0.2, 0.5, 0.8, 1.0] {
        for seed in 0..40 {
            let draw = LabelDraw::new(&house, &trials, q, seed).unwrap();
            assert!(draw == LabelDraw::new(&house, &trials, q, seed).unwrap());
            let share = draw.different_share;
            assert!((share - q).abs() <= largest / 2.0 + 0.05, "{q} {share}");
        }
    }
    let truth = RegionLabels::truth(&house);
    let draw = LabelDraw::new(&house, &trials, 1.0, 9).unwrap();
    assert!(draw.map != truth && draw.headset != truth);
    assert!(LabelDraw::new(&house, &trials, 1.5, 0).is_err());
}

#[test]
fn the_map_of_a_survey_is_relabelled_as_inserting_it_anew_would() {
    let house = room().placed(pose());
    let survey = Survey::new(&house, &small(), 1).unwrap();
    let trial = HeadsetTrial::new(&house, Scene::Dining, 1, 1).unwrap();
    let lattice = Lattice::new(LatticeKind::Fcc, 0.05_f64.powi(3)).unwrap();
    let map = SurveyMap::new(&survey, &lattice).unwrap();
    let draw = LabelDraw::new(&house, &[trial], 0.6, 4).unwrap();
    for labels in [&RegionLabels::truth(&house), &draw.map] {
        let list = survey.voxels(&lattice, labels).unwrap();
        assert!(map.cloud(labels) == SemanticCloud::from_voxels(&list));
    }
}

#[test]
fn our_own_house_has_rooms_and_all_four_scenes() {
    let house = House::generated(1).unwrap();
    assert!(House::generated(1).unwrap().mesh() == house.mesh());
    assert!(House::generated(2).unwrap().mesh() != house.mesh());
    let upper = [(3.0, 8.6), (8.0, 9.5), (11.0, 10.4), (18.0, 9.2)];
    let lower = [(4.0, 1.5), (9.0, 4.0), (17.0, 4.0), (10.0, 7.2)];
    for (x, y) in upper.into_iter().chain(lower) {
        let near = |cell: &[f64; 2]| (cell[0] - x).hypot(cell[1] - y) < 0.7;
        assert!(house.free.cells_m.iter().any(near), "no place at {x} {y}");
    }
    let inside = |[x, y]: &[f64; 2]| *x > 0.0 && *x < 20.0 && *y > 0.0 && *y < 12.0;
    assert!(house.free.cells_m.iter().all(inside));
    let outside = |[x, y]: &[f64; 2]| *x > 15.6 && *y > 11.0;
    assert!(!house.free.cells_m.iter().any(outside));
    for scene in Scene::ALL {
        for seed in 0..4 {
            let trial = HeadsetTrial::new(&house, scene, 1, seed).unwrap();
            let headset_scan = &trial.headset_scans[0];
            let object = house.class(scene.object());
            let label = |r: &&u16| house.regions().get(usize::from(**r)).map(|r| r.label);
            let seen = headset_scan
                .regions
                .iter()
                .filter(|r| label(r) == object)
                .count();
            let near = headset_scan
                .points_m
                .iter()
                .step_by(29)
                .filter(|p| distance_m(&house, &(trial.map_from_headset * **p), 1.0) < 0.1);
            let share = near.count() as f64 / (headset_scan.points_m.len().div_ceil(29) as f64);
            assert!(seen > 200 && share > 0.9);
        }
    }
}
