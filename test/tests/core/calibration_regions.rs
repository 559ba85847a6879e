//! Parts of a view that the map does not explain: what is new in the room, and what is gone.

use lattice_core::registration::{
    Calibration, CalibrationMap, CalibrationOptions, CalibrationRequest, SourceCloud,
    UnexplainedKind, Verdict, register_global,
};
use lattice_lab::simulate::rooms::{Flat, LOOKS};
use nalgebra::{Isometry3, Point3, Vector3};

/// A box in sight of the first look, and its midst.
const CORNER: [f64; 2] = [1.3, 1.2];
const SIZE: [f64; 3] = [0.6, 0.6, 1.0];
const MIDST: Point3<f64> = Point3::new(1.6, 1.5, 0.5);

/// The answer to the first look into a flat, given the map of another.
fn ask(seen: &Flat, mapped: &Flat) -> Calibration {
    let (found, truth) = ask_by(seen, mapped, &CalibrationOptions::default());
    assert_eq!(found.verdict, Verdict::Ok, "{}", found.reason);
    let off_m = (found.target_from_source.translation.vector - truth.translation.vector).norm();
    assert!(off_m < 0.03, "{off_m}");
    found
}

/// The same by options, with the truth.
fn ask_by(
    seen: &Flat,
    mapped: &Flat,
    options: &CalibrationOptions,
) -> (Calibration, Isometry3<f64>) {
    let truth = Isometry3::new(Vector3::new(2.0, 4.0, 1.5), Vector3::z() * 2.5);
    let (eye, yaw) = LOOKS[0];
    let eye = Point3::from(eye);
    let scan = SourceCloud {
        cloud: seen.look(eye, yaw, &truth),
        sensor_m: Some(truth.inverse() * eye),
    };
    let map = CalibrationMap::new(mapped.map(), 0.05).unwrap();
    let request = CalibrationRequest {
        source_clouds: &[scan],
        start: None,
        confusion: None,
    };
    (register_global(&map, &request, options, &()), truth)
}

fn with_box() -> Flat {
    Flat::default().with_box(CORNER, SIZE)
}

#[test]
fn a_view_of_what_was_mapped_is_explained() {
    let fit = ask(&Flat::default(), &Flat::default()).fit;
    assert!(fit.unexplained.is_empty(), "{:?}", fit.unexplained);
    assert!(fit.chi_square < 1.0 && fit.floating < 0.02 && fit.blocked < 0.05);
}

#[test]
fn a_box_that_is_new_is_listed_with_its_place() {
    let found = ask(&with_box(), &Flat::default());
    let new = found.fit.unexplained.iter();
    let new: Vec<_> = new
        .filter(|p| p.kind == UnexplainedKind::Floating)
        .collect();
    let apart = |place: &Point3<f64>| nalgebra::distance(&place.xy(), &MIDST.xy());
    assert!(
        new.iter().any(|part| apart(&part.place_m) < 0.6),
        "{:?}",
        found.fit
    );
    assert!(found.fit.floating > 0.05, "{:?}", found.fit);
    assert!(found.reason.contains("not explained"), "{}", found.reason);
}

#[test]
fn a_box_that_is_gone_is_seen_through() {
    let found = ask(&Flat::default(), &with_box());
    let gone = found.fit.unexplained.iter();
    assert!(
        gone.clone().any(|p| p.kind == UnexplainedKind::Hidden),
        "{:?}",
        found.fit
    );
    assert!(found.fit.blocked > 0.05, "{:?}", found.fit);
}

#[test]
fn a_view_that_the_map_contradicts_is_refused() {
    let strict = CalibrationOptions {
        max_contradicted: 0.05,
        ..CalibrationOptions::default()
    };
    let flats = [Flat::default(), with_box()];
    for [seen, mapped] in [[0, 1], [1, 0]] {
        let (found, _) = ask_by(&flats[seen], &flats[mapped], &strict);
        assert_eq!(found.verdict, Verdict::NoOverlap, "{}", found.reason);
        assert!(found.reason.contains("contradicts"), "{}", found.reason);
    }
    let (same, _) = ask_by(&flats[0], &flats[0], &strict);
    assert_eq!(same.verdict, Verdict::Ok, "{}", same.reason);
}
