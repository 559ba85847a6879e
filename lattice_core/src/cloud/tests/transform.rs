use nalgebra::{Isometry3, Point3, Vector3};
use std::convert::Infallible;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{U32, timed};
use crate::cloud::{
    CloudLayout, CloudLimits, CloudView, NO_TIME_NS, Precision, RangeLimits, RecordFormat, Records,
    TimeOptions, transform_records,
};

/// Transforms with coordinates in double precision.
fn transform<E: Send>(
    view: &CloudView,
    stamp_ns: i64,
    times: Option<&[i64]>,
    range: &RangeLimits,
    map_from_sensor: impl Fn(i64) -> Result<Isometry3<f64>, E> + Sync,
) -> Result<Records, E> {
    let format = RecordFormat::new(view, &[], Some(Precision::Float64), false);
    transform_records(view, stamp_ns, times, range, &format, map_from_sensor)
}

/// Vectors of f64 at an offset of each record.
fn vectors(records: &Records, offset: usize) -> Vec<Vector3<f64>> {
    let step = records.data.len() / records.points.max(1);
    let number = |b: &[u8]| f64::from_le_bytes(b.try_into().unwrap());
    let vector = |r: &[u8]| Vector3::from_iterator(r[offset..offset + 24].chunks(8).map(number));
    records.data.chunks(step.max(1)).map(vector).collect()
}

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
    let found = transform(
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
    assert_eq!(found.points, view.len());
    for (i, p) in vectors(&found, 0).iter().enumerate() {
        let expected = pose(times[i]) * Point3::from(view.xyz(i));
        assert_eq!(*p, expected.coords);
    }
    assert!(asked.into_inner() < 2 * 1024, "times of a row come again");
}

#[test]
fn a_cloud_without_times_has_the_pose_of_its_stamp() {
    let (layout, data) = spinning(2, 2000);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let found = transform(&view, 7, None, &RangeLimits::default(), |at| {
        assert_eq!(at, 7);
        Ok::<_, Infallible>(Isometry3::translation(0.0, 0.0, 100.0))
    })
    .unwrap();
    assert_eq!(
        vectors(&found, 0)[0],
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
    let found = transform(&view, 0, Some(&times_ns), &range, only_42).unwrap();
    assert_eq!(vectors(&found, 0), [Vector3::new(6.0, 0.0, 0.0)]);
    let left_out = (found.not_finite, found.out_of_range, found.no_time);
    assert_eq!(left_out, (2, 3, 1));
    // Times that are too few are no times.
    let found = transform(&view, 0, Some(&[]), &range, only_42).unwrap();
    assert_eq!((found.points, found.no_time), (0, 2));
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
            transform(&view, 0, Some(&times), &RangeLimits::default(), |at| {
                if at >= 12_345 { Err(at) } else { Ok(pose(at)) }
            })
        });
        assert_eq!(refused, Err(12_345));
    }
}

#[test]
fn a_record_has_the_fields_asked_for() {
    let (layout, data) = spinning(4, 3000);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let times: Vec<i64> = (0..view.len() as i64).map(|i| i % 3000 * 48_828).collect();
    let range = RangeLimits {
        max_range_m: 10.0002,
        ..RangeLimits::default()
    };
    let format = RecordFormat::new(&view, &["t".into()], Some(Precision::Float64), true);
    let (fields, bytes) = format.fields(Precision::Float64);
    let names: Vec<_> = fields.iter().map(|f| (f.name.as_str(), f.offset)).collect();
    let expected = [
        ("x", 0),
        ("y", 8),
        ("z", 16),
        ("t", 24),
        ("vp_x", 28),
        ("vp_y", 36),
        ("vp_z", 44),
    ];
    assert_eq!((names.as_slice(), bytes), (&expected[..], 52));
    let known = |at| Ok::<_, Infallible>(pose(at));
    let found = transform_records(&view, 0, Some(&times), &range, &format, known).unwrap();
    // Of each ring after the first all points are too far.
    assert_eq!((found.points, found.out_of_range), (3000, 9000));
    let viewpoints = vectors(&found, 28);
    for (i, record) in found.data.chunks(bytes).enumerate() {
        assert_eq!(record[24..28], (i as u32 * 48_828).to_le_bytes());
        assert_eq!(viewpoints[i], pose(times[i]).translation.vector);
    }
    // Times that hardly repeat are looked up one by one, to the same coordinates.
    let numbers: Vec<i64> = (0..view.len() as i64).collect();
    let by_number = |i| known(times[i as usize]);
    let one_by_one = transform_records(&view, 0, Some(&numbers), &range, &format, by_number);
    assert_eq!(one_by_one, Ok(found));
}

#[test]
fn points_far_from_the_origin_are_given_in_double_precision() {
    let points = [[100.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let times = [vec![0; 4], vec![0; 4]];
    let (layout, data) = timed("t", U32, &points, &times);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let format = RecordFormat::new(&view, &[], None, false);
    let at_east = |east_m: f64| {
        let pose = move |_| Ok::<_, Infallible>(Isometry3::translation(east_m, 0.0, 0.0));
        transform_records(&view, 0, None, &RangeLimits::default(), &format, pose).unwrap()
    };
    for (east_m, expected, bytes) in [
        (16_283.0, Precision::Float32, 24),
        (16_285.0, Precision::Float64, 48),
        (16_385.0, Precision::Float64, 48),
        (-16_385.0, Precision::Float64, 48),
    ] {
        let found = at_east(east_m);
        assert_eq!(
            (found.precision, found.data.len()),
            (expected, bytes),
            "{east_m}"
        );
    }
    let single = at_east(0.0).data;
    assert_eq!(
        single,
        [[100.0_f32, 0.0, 0.0], [0.0, 1.0, 0.0]]
            .as_flattened()
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect::<Vec<_>>()
    );
    assert!((f64::from(16_383.25_f32 + 4e-4) - (16_383.25 + 4e-4)).abs() < 5e-4);
}
