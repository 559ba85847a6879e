//! Preparing clouds.

use super::*;

fn options(neighbors: usize) -> PrepareOptions {
    PrepareOptions {
        neighbors,
        min_points: 3,
        ..PrepareOptions::default()
    }
}

/// Two walls and a floor, unevenly sampled.
fn corner(n: usize) -> Vec<Point3<f64>> {
    let fraction = |i: usize, by: f64| (i as f64 * by).fract() * 3.0;
    let place = |i| {
        let (u, v) = (fraction(i, 0.618_033_988_7), fraction(i, 0.754_877_666_2));
        match i % 3 {
            0 => Point3::new(u, v, 0.0),
            1 => Point3::new(u, 0.0, v),
            _ => Point3::new(0.0, u, v),
        }
    };
    (0..n).map(place).collect()
}

#[test]
fn normals_and_covariances_are_those_of_the_planes() {
    let labels: Vec<_> = (0..3000)
        .map(|i| LabelDistribution::hard(i as u16 % 3))
        .collect();
    let cloud = SemanticCloud {
        points_m: corner(3000),
        labels,
    };
    let prepared = PreparedCloud::new(cloud.clone(), &PrepareOptions::default()).unwrap();
    let axes = [Vector3::z(), Vector3::y(), Vector3::x()];
    let mut checked = 0;
    for (i, covariance) in prepared.covariances_m2().enumerate() {
        let point = prepared.points_m()[i];
        let original = prepared.order()[i] as usize;
        assert_eq!(cloud.points_m[original], point);
        assert_eq!(cloud.label(original), prepared.label(i));
        if point.coords.iter().filter(|c| **c > 0.6).count() == 2 {
            let axis = axes[original % 3];
            let expected: Matrix3<f64> = Matrix3::identity() - 0.999 * axis * axis.transpose();
            assert!((covariance - expected).norm() < 1e-12, "{covariance}");
            checked += 1;
        }
    }
    assert!(checked > 1500);
}

#[test]
fn threads_do_not_change_a_bit() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let cloud = SemanticCloud::unlabelled(corner(20_000));
        pool.install(|| PreparedCloud::new(cloud, &options(10)).unwrap())
    };
    let one = on(1);
    for threads in [2, 4] {
        let many = on(threads);
        assert_eq!(many.points_m(), one.points_m());
        assert_eq!(many.normals(), one.normals());
        assert_eq!(many.order(), one.order());
    }
}

#[test]
fn nearest_respects_the_gate() {
    let prepared =
        PreparedCloud::new(SemanticCloud::unlabelled(corner(300)), &options(10)).unwrap();
    let above = prepared.points_m()[17] - Vector3::new(0.5, 0.5, 0.5);
    let (index, squared) = prepared.nearest(&above, 10.0).unwrap();
    let distance = |p: &Point3<f64>| nalgebra::distance_squared(p, &above);
    let least = prepared
        .points_m()
        .iter()
        .map(distance)
        .fold(f64::MAX, f64::min);
    assert!((squared - least).abs() < 1e-15);
    assert!((distance(&prepared.points_m()[index]) - least).abs() < 1e-15);
    assert_eq!(prepared.nearest(&above, 0.9 * least.sqrt()), None);
    for gate in [f64::NAN, -1.0] {
        assert_eq!(prepared.nearest(&above, gate), None);
    }
    let mut found = Neighbors::default();
    prepared.nearest_k(&above, 5, f64::INFINITY, &mut found);
    assert_eq!(found.len(), 5);
    assert_eq!(found.iter().next(), Some((index, squared)));
}

#[test]
fn clouds_that_cannot_be_registered_are_refused() {
    let refused = |points_m: Vec<Point3<f64>>| {
        PreparedCloud::new(SemanticCloud::unlabelled(points_m), &options(10)).err()
    };
    use RegistrationError as E;
    let (points, least) = (0, 3);
    assert_eq!(refused(vec![]), Some(E::TooFewPoints { points, least }));
    let with = |x: f64| {
        let mut points_m = corner(50);
        points_m[41].y = x;
        points_m
    };
    for bad in [f64::NAN, f64::INFINITY, -1e300] {
        assert_eq!(refused(with(bad)), Some(E::NotFinite { index: 41 }));
    }
    let equal = vec![Point3::new(1e6, 2.3, -0.1); 100];
    assert_eq!(refused(equal), Some(E::Collinear));
    let line =
        |i: i32| Point3::new(1e3, -7.0, 0.1) + 0.3 * f64::from(i) * Vector3::new(0.1, 0.7, -0.3);
    assert_eq!(refused((0..100).map(line).collect()), Some(E::Collinear));
    let mut cloud = SemanticCloud::unlabelled(corner(50));
    cloud.labels = vec![LabelDistribution::hard(1); 49];
    let error = PreparedCloud::new(cloud, &options(10)).err();
    let (labels, points) = (49, 50);
    assert_eq!(error, Some(E::LabelCount { labels, points }));
    let asked = |options| PreparedCloud::new(SemanticCloud::unlabelled(corner(50)), &options).err();
    assert!(matches!(asked(options(2)), Some(E::Neighbors { .. })));
    assert!(matches!(asked(options(65)), Some(E::Neighbors { .. })));
    let plane_epsilon = f64::NAN;
    let flat = PrepareOptions {
        plane_epsilon,
        ..options(10)
    };
    assert!(matches!(asked(flat), Some(E::PlaneEpsilon { .. })));
}

#[test]
fn repeated_points_are_fine() {
    let mut points_m = corner(60);
    points_m.extend(vec![points_m[7]; 500]);
    let prepared = PreparedCloud::new(SemanticCloud::unlabelled(points_m), &options(20)).unwrap();
    let unit = |n: &Vector3<f64>| (n.norm() - 1.0).abs() < 1e-12;
    assert!(prepared.normals().iter().all(unit));
}
