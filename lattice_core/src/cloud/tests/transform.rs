use nalgebra::{Isometry3, Point3, Vector3};
use std::convert::Infallible;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{U32, timed};
use crate::cloud::{
    CloudLayout, CloudLimits, NO_TIME_NS, RangeLimits, TimeOptions, Transformed, transform_points,
};

/// A machine that drives east at 10 m/s while it turns.
fn pose(stamp_ns: i64) -> Isometry3<f64> {
    let t = stamp_ns as f64 * 1.0e-9;
    Isometry3::new(Vector3::new(10.0 * t, 0.0, 2.0), Vector3::new(0.0, 0.0, t))
}

/// `columns` times, each seen by `rings` points, ring after ring.
fn spinning(rings: usize, columns: usize) -> (CloudLayout, Vec<u8>) {
    let mut points = Vec::new();
    let mut times = Vec::new();
    for ring in 0..rings {
        for column in 0..columns {
            let angle = column as f32 / columns as f32 * std::f32::consts::TAU;
            points.push([10.0 * angle.cos(), 10.0 * angle.sin(), ring as f32 * 0.1]);
            times.push((column as u32 * 48_828).to_le_bytes().to_vec());
        }
    }
    timed("t", U32, &points, &times)
}

#[test]
fn each_point_has_the_pose_of_its_time() {
    let (layout, data) = spinning(16, 1024);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let stamp_ns = 5_000_000_000;
    let times = view
        .point_times(stamp_ns, &TimeOptions::default())
        .unwrap()
        .times_ns
        .unwrap();
    let asked = AtomicUsize::new(0);
    let found = transform_points(
        &view,
        stamp_ns,
        Some(&times),
        &RangeLimits::default(),
        |at| {
            asked.fetch_add(1, Ordering::Relaxed);
            Ok::<_, Infallible>(pose(at))
        },
    )
    .unwrap();
    assert_eq!(found.points_m.len(), view.len());
    for (i, p) in found.points_m.iter().enumerate() {
        let expected = pose(times[i]) * Point3::from(view.xyz(i));
        assert_eq!(*p, expected.coords);
    }
    assert!(asked.into_inner() < 2 * 1024, "times of a row come again");
}

#[test]
fn a_cloud_without_times_has_the_pose_of_its_stamp() {
    let (layout, data) = spinning(2, 2000);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let found = transform_points(&view, 7, None, &RangeLimits::default(), |at| {
        assert_eq!(at, 7);
        Ok::<_, Infallible>(Isometry3::translation(0.0, 0.0, 100.0))
    })
    .unwrap();
    assert_eq!(
        found.points_m[0],
        view.xyz(0) + Vector3::new(0.0, 0.0, 100.0)
    );
}

#[test]
fn what_is_kept_out_is_counted_and_needs_no_pose() {
    let points = [
        [f32::NAN, 0.0, 0.0],
        [f32::INFINITY, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.5, 0.0, 0.0],
        [200.0, 0.0, 0.0],
        [5.0, 0.0, 0.0],
        [6.0, 0.0, 0.0],
    ];
    let times: Vec<Vec<u8>> = (0..7_u32).map(|i| i.to_le_bytes().to_vec()).collect();
    let (layout, data) = timed("t", U32, &points, &times);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let mut times_ns = vec![1; 6];
    times_ns[5] = NO_TIME_NS;
    times_ns.push(42);
    let range = RangeLimits {
        min_range_m: 1.0,
        max_range_m: 100.0,
    };
    let only_42 = |at| {
        if at == 42 {
            Ok(Isometry3::identity())
        } else {
            Err(at)
        }
    };
    let found = transform_points(&view, 0, Some(&times_ns), &range, only_42).unwrap();
    assert_eq!(
        found,
        Transformed {
            points_m: vec![Vector3::new(6.0, 0.0, 0.0)],
            not_finite: 2,
            out_of_range: 3,
            no_time: 1,
            left_out: (0..6).collect(),
        }
    );
    // Times that are too few are no times.
    let found = transform_points(&view, 0, Some(&[]), &range, only_42).unwrap();
    assert_eq!((found.points_m.len(), found.no_time), (0, 2));
}

#[test]
fn the_first_missing_pose_is_the_error_on_any_number_of_threads() {
    let (layout, data) = spinning(8, 4000);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let times: Vec<i64> = (0..view.len() as i64).collect();
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let refused = pool.install(|| {
            transform_points(&view, 0, Some(&times), &RangeLimits::default(), |at| {
                if at >= 12_345 { Err(at) } else { Ok(pose(at)) }
            })
        });
        assert_eq!(refused, Err(12_345));
    }
}
