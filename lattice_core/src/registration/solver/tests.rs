//! Registrations of synthetic clouds with a known transform.

use nalgebra::{Point3, Vector3};

use super::*;
use crate::registration::{
    LabelDistribution, LabelUse, Lift, NamedMethod, PrepareOptions, SemanticCloud,
};

/// Distance between two poses, metres, and the angle between them, radians.
fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let apart = (a.translation.vector - b.translation.vector).norm();
    (apart, a.rotation.angle_to(&b.rotation))
}

/// A room's corner with a box and a round pillar, unevenly sampled; each surface is a class.
fn room(n: usize) -> SemanticCloud {
    let fraction = |i: usize, by: f64| ((i + 1) as f64 * by).fract();
    let mut cloud = SemanticCloud::default();
    for i in 0..n {
        let u = fraction(i, 0.618_033_988_749_895);
        let v = fraction(i, 0.754_877_666_246_693);
        let wave = 0.1 * (5.0 * u).sin() * (4.0 * v).cos();
        let (point, class) = match i % 6 {
            0 => (Point3::new(4.0 * u, 3.0 * v, wave), 0),
            1 => (Point3::new(4.0 * u, wave, 2.5 * v), 1),
            2 => (Point3::new(wave, 3.0 * u, 2.5 * v), 2),
            3 => (Point3::new(1.5 + 0.8 * u, 1.0 + 0.5 * v, 0.75), 3),
            4 => (Point3::new(1.5 + 0.8 * u, 1.0, 0.75 * v), 3),
            _ => {
                let (s, c) = (6.0 * u).sin_cos();
                (Point3::new(3.0 + 0.3 * c, 2.2 + 0.3 * s, 2.0 * v), 4)
            }
        };
        cloud.points_m.push(point);
        cloud.labels.push(LabelDistribution::hard(class));
    }
    cloud
}

fn moved(cloud: &SemanticCloud, by: &Isometry3<f64>) -> SemanticCloud {
    SemanticCloud {
        points_m: cloud.points_m.iter().map(|p| by * p).collect(),
        labels: cloud.labels.clone(),
    }
}

fn prepare(cloud: SemanticCloud) -> PreparedCloud {
    PreparedCloud::new(cloud, &PrepareOptions::default()).unwrap()
}

/// Source and target of one room, and what takes the one to the other.
fn pair(n: usize) -> (PreparedCloud, PreparedCloud, Isometry3<f64>) {
    let target_from_source =
        Isometry3::new(Vector3::new(5.0, -2.0, 0.3), Vector3::new(0.1, -0.2, 2.0));
    let target = room(n);
    let source = moved(&target, &target_from_source.inverse());
    (prepare(source), prepare(target), target_from_source)
}

fn off(truth: &Isometry3<f64>, m: f64, rad: f64) -> Isometry3<f64> {
    let phi = Vector3::new(0.3, -0.5, 0.8).normalize() * rad;
    truth * Isometry3::new(Vector3::new(0.6, -0.7, 0.4).normalize() * m, phi)
}

fn precise(options: RegisterOptions<'static>) -> RegisterOptions<'static> {
    RegisterOptions {
        rotation_tolerance_rad: 1e-12,
        translation_tolerance_m: 1e-12,
        max_iterations: 200,
        ..options
    }
}

/// All methods, for a cloud of some thousand points.
fn all_methods() -> Vec<RegisterOptions<'static>> {
    let named = NamedMethod::ALL.iter().map(|method| method.options(1.0));
    let all = named.chain([
        RegisterOptions::semantic_em(1.0, LabelUse::Soft),
        RegisterOptions::semantic(SemanticVariant::AsPrinted, LabelUse::Soft),
    ]);
    all.map(|options| RegisterOptions {
        min_class_points: options.min_class_points.min(50),
        ..options
    })
    .collect()
}

#[test]
fn the_transform_comes_back_to_machine_precision() {
    let (source, target, truth) = pair(3000);
    for options in all_methods() {
        let options = RegisterOptions {
            neighbors: 1,
            ..precise(options)
        };
        let found = register(&source, &target, &off(&truth, 0.03, 0.01), &options);
        let error = distance(&found.target_from_source, &truth);
        let method = options.method;
        assert!(found.converged, "{method:?} {found:?}");
        assert!(error.0 < 1e-10, "{method:?} {error:?}");
        assert!(error.1 < 1e-10, "{method:?} {error:?}");
        assert!(found.rmse_m < 1e-10 && found.inliers > 2500, "{method:?}");
    }
}

#[test]
fn four_candidates_end_close_by() {
    let (source, target, truth) = pair(6000);
    for options in all_methods() {
        let found = register(&source, &target, &off(&truth, 0.03, 0.01), &options);
        let error = distance(&found.target_from_source, &truth);
        let method = (options.method, options.labels);
        assert!(error.0 < 5e-3, "{method:?} {error:?}");
        assert!(error.1 < 3e-3, "{method:?} {error:?}");
    }
}

/// Labels of one region that mean another class in the source drag class-wise pairs after them, while
/// they only cost the normalised variant some pairs.
#[test]
fn wrong_labels_drag_the_class_wise_variant_and_not_the_normalised_one() {
    let (_, target, truth) = pair(6000);
    let mut wrong = moved(&room(6000), &truth.inverse());
    for label in &mut wrong.labels {
        // The pillar is called a box, and half of the wall the floor.
        *label = match label.top() {
            Some(4) => LabelDistribution::hard(3),
            Some(2) => LabelDistribution::hard(0),
            _ => *label,
        };
    }
    let source = prepare(wrong);
    let error = |options: RegisterOptions| {
        let found = register(&source, &target, &off(&truth, 0.03, 0.01), &options);
        distance(&found.target_from_source, &truth).0
    };
    let class_wise = error(RegisterOptions {
        min_class_points: 50,
        ..RegisterOptions::class_wise()
    });
    assert!(class_wise > 0.1, "{class_wise}");
    for labels in [LabelUse::Hard, LabelUse::Soft] {
        let em = error(RegisterOptions::semantic_em(1.0, labels));
        assert!(em < 0.01, "{em}");
    }
}

#[test]
fn a_weight_of_one_makes_labels_count_for_nothing() {
    let (source, target, truth) = pair(3000);
    let mut bare = room(3000);
    bare.labels.clear();
    let bare_source = prepare(moved(&bare, &truth.inverse()));
    let options = RegisterOptions::semantic_em(1.0, LabelUse::Soft);
    let lift = RegisterOptions {
        // Of no classes: each pair of them weighs 1.
        pair_weight: Some(&Lift::default()),
        ..options
    };
    let start = off(&truth, 0.1, 0.03);
    let with = register(&source, &target, &start, &lift);
    let without = register(&bare_source, &prepare(bare), &start, &options);
    assert_eq!(with, without);
}

#[test]
fn threads_do_not_change_a_bit() {
    let (source, target, truth) = pair(3000);
    for options in all_methods() {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let start = off(&truth, 0.1, 0.03);
            let run = || register(&source, &target, &start, &options);
            pool.build().unwrap().install(run)
        };
        let one = on(1);
        for threads in [2, 4] {
            assert_eq!(on(threads), one, "{:?}", options.method);
        }
    }
}

#[test]
fn a_stride_uses_fewer_points_and_ends_in_the_same_place() {
    let (source, target, truth) = pair(6000);
    let options = RegisterOptions {
        source_stride: 7,
        ..precise(RegisterOptions::gicp(1.0))
    };
    let found = register(&source, &target, &off(&truth, 0.05, 0.02), &options);
    let error = distance(&found.target_from_source, &truth);
    assert!(error.0 < 1e-10, "{error:?}");
    assert_eq!(found.inliers, 6000usize.div_ceil(7));
}

#[test]
fn starts_that_lead_nowhere_end_where_they_began() {
    let (source, target, truth) = pair(600);
    let far = off(&truth, 1e5, 0.0);
    let not_a_number = Isometry3::translation(f64::NAN, 0.0, 0.0);
    for options in all_methods() {
        let options = RegisterOptions {
            gate_m: 1.0,
            ..options
        };
        let found = register(&source, &target, &far, &options);
        assert!(
            !found.converged && found.inliers == 0,
            "{:?}",
            options.method
        );
        assert_eq!(found.target_from_source, far);
        assert!(!register(&source, &target, &not_a_number, &options).converged);
    }
}

#[test]
fn options_beyond_reason_do_no_harm() {
    let (source, target, truth) = pair(600);
    for bad in [f64::NAN, -1.0, 0.0, f64::INFINITY, 1e300] {
        for options in all_methods() {
            let options = RegisterOptions {
                gate_m: bad,
                cauchy_alpha: bad,
                anneal: bad,
                neighbors: 10_000,
                source_stride: 0,
                inner_iterations: 0,
                max_iterations: 5,
                ..options
            };
            let found = register(&source, &target, &truth, &options);
            let homogeneous = found.target_from_source.to_homogeneous();
            assert!(
                homogeneous.iter().all(|v| v.is_finite()),
                "{bad} {options:?}"
            );
        }
    }
}

#[test]
fn clouds_far_from_the_origin_register_as_those_about_it() {
    let truth = Isometry3::new(
        Vector3::new(0.1, -0.05, 0.02),
        Vector3::new(0.005, 0.01, 0.02),
    );
    let target = room(3000);
    let source = moved(&target, &truth.inverse());
    let start = off(&Isometry3::identity(), 0.01, 0.002);
    // Beside the origin, 10 km off, in UTM, and 10,000 km off.
    for far_m in [
        Vector3::new(0.0, 60.0, -50.0),
        Vector3::new(300.0, 0.0, 0.0),
        Vector3::new(0.0, -10_000.0, 0.0),
        Vector3::new(448_000.0, 5_411_000.0, 300.0),
        Vector3::new(-1.0e7, 2.0e6, 1.0e7),
    ] {
        let away = Isometry3::from_parts(far_m.into(), Default::default());
        let prepared = [&source, &target].map(|cloud| prepare(moved(cloud, &away)));
        let [source, target] = &prepared;
        // The same motion of the same points.
        let about = |motion: &Isometry3<f64>| away * motion * away.inverse();
        for method in NamedMethod::ALL {
            let options = RegisterOptions {
                min_class_points: 50,
                ..method.options(1.0)
            };
            let found = register(source, target, &about(&start), &options);
            let error = distance(&about_inverse(&away, &found.target_from_source), &truth);
            let name = method.option;
            assert!(found.converged, "{name} at {far_m:?}: {found:?}");
            assert!(
                error.0 < 3e-3 && error.1 < 2e-3,
                "{name} at {far_m:?}: {error:?}"
            );
        }
        let exact = precise(RegisterOptions::gicp(1.0));
        let exact = RegisterOptions {
            rotation_tolerance_rad: 1e-8,
            translation_tolerance_m: 1e-7,
            ..exact
        };
        let found = register(source, target, &about(&start), &exact);
        let error = distance(&about_inverse(&away, &found.target_from_source), &truth);
        assert!(found.converged && error.0 < 1e-6, "{far_m:?}: {error:?}");
    }
}

/// A motion of points that were moved away, as that of the points before.
fn about_inverse(away: &Isometry3<f64>, motion: &Isometry3<f64>) -> Isometry3<f64> {
    away.inverse() * motion * away
}
