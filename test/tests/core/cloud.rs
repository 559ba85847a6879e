//! Clouds: any layout reads back, any lie is refused, deskew equals the plain formula.

use lattice_core::cloud::{
    CloudLayout, CloudLimits, LayoutNote, NO_TIME_NS, PointField, Precision, RangeLimits,
    RecordFormat, Records, TimeOptions, TimeReference, TimeUnit, transform_records,
};
use nalgebra::{Isometry3, Point3, Vector3};
use proptest::prelude::*;
use std::convert::Infallible;

const LIMITS: CloudLimits = CloudLimits { max_points: 10_000 };

fn config() -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(1024)
    }
}

fn bytes(value: f64, wide: bool, big: bool) -> Vec<u8> {
    match (wide, big) {
        (true, true) => value.to_be_bytes().to_vec(),
        (true, false) => value.to_le_bytes().to_vec(),
        (false, true) => (value as f32).to_be_bytes().to_vec(),
        (false, false) => (value as f32).to_le_bytes().to_vec(),
    }
}

fn field(name: &str, offset: u32, datatype: u8) -> PointField {
    PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    }
}

/// Coordinates of records that hold nothing else.
fn points_m(records: &Records) -> Vec<Vector3<f64>> {
    let numbers = records
        .data
        .chunks(8)
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()));
    numbers
        .collect::<Vec<_>>()
        .chunks(3)
        .map(Vector3::from_column_slice)
        .collect()
}

proptest! {
    #![proptest_config(config())]

    /// Written with any padding, alignment, order of fields, width and byte order.
    #[test]
    fn any_honest_layout_reads_back(
        width in 1..9_u32, height in 1..9_u32,
        pads in prop::array::uniform4(0..7_u32), row_pad in 0..33_u32, tail in 0..9_usize,
        wide in any::<bool>(), big in any::<bool>(),
        order in Just([0_usize, 1, 2, 3]).prop_shuffle(),
        values in prop::collection::vec(-1.0e6..1.0e6_f64, 8 * 8 * 3),
    ) {
        let size = if wide { 8 } else { 4 };
        let names = ["x", "y", "z", "time"];
        let mut fields = Vec::new();
        let mut offset = 0;
        for (slot, &which) in order.iter().enumerate() {
            offset += pads[slot];
            let (datatype, step) = if which == 3 { (6, 4) } else if wide { (8, size) } else { (7, size) };
            fields.push(field(names[which], offset, datatype));
            offset += step;
        }
        let point_step = offset + pads[0];
        let row_step = width * point_step + row_pad;
        let layout = CloudLayout { width, height, point_step, row_step, is_bigendian: big, fields };
        let at = |name: &str| layout.fields.iter().find(|f| f.name == name).unwrap().offset as usize;
        let mut data = vec![0xC5; (height * row_step) as usize + tail];
        let points = (width * height) as usize;
        for i in 0..points {
            let start = (i / width as usize) * row_step as usize + (i % width as usize) * point_step as usize;
            for (axis, name) in names.iter().take(3).enumerate() {
                let value = bytes(values[3 * i + axis], wide, big);
                data[start + at(name)..][..value.len()].copy_from_slice(&value);
            }
            let time = i as u32 * 1_000;
            let time = if big { time.to_be_bytes() } else { time.to_le_bytes() };
            data[start + at("time")..][..4].copy_from_slice(&time);
        }
        let view = layout.view(&data, &LIMITS).unwrap();
        prop_assert_eq!(view.len(), points);
        for i in 0..points {
            let expected = Vector3::from_fn(|axis, _| {
                let v = values[3 * i + axis];
                if wide { v } else { f64::from(v as f32) }
            });
            prop_assert_eq!(view.xyz(i), expected);
        }
        let times = view.point_times(50, &TimeOptions::default()).unwrap().times_ns.unwrap();
        let expected: Vec<i64> = (0..points as i64).map(|i| 50 + 1_000 * i).collect();
        prop_assert_eq!(times, expected);
    }

    /// No layout, however false, makes the reader panic or read beyond the data.
    #[test]
    fn any_lie_is_refused_or_harmless(
        width in prop_oneof![0..5_u32, any::<u32>()],
        height in prop_oneof![0..5_u32, any::<u32>()],
        point_step in prop_oneof![0..40_u32, any::<u32>()],
        row_step in prop_oneof![0..200_u32, any::<u32>()],
        is_bigendian in any::<bool>(),
        fields in prop::collection::vec(
            (prop::sample::select(vec!["x", "y", "z", "t", "time", "timestamp", ""]),
             prop_oneof![0..40_u32, any::<u32>()], 0..13_u8, prop_oneof![0..3_u32, any::<u32>()]), 0..7),
        data in prop::collection::vec(prop_oneof![4 => Just(0), 1 => any::<u8>()], 0..=850),
        stamp_ns in any::<i64>(),
        unit in prop::option::of(prop::sample::select(vec![TimeUnit::Seconds, TimeUnit::Nanoseconds])),
        reference in prop::option::of(prop::sample::select(vec![
            TimeReference::StampStart, TimeReference::StampEnd, TimeReference::Absolute])),
    ) {
        let honest = fields.iter().map(|(name, offset, datatype, count)| PointField {
            name: (*name).to_owned(), offset: *offset, datatype: *datatype, count: *count }).collect();
        // First the lie as it is, then one whose extent and coordinates are sound, so that
        // the times are reached.
        let mut layout = CloudLayout { width, height, point_step, row_step, is_bigendian, fields: honest };
        for sound in [false, true] {
            if sound {
                layout.width = width % 5;
                layout.height = height % 5;
                layout.point_step = 12 + point_step % 28;
                layout.row_step = layout.width * layout.point_step + row_step % 10;
                layout.fields.retain(|f| f.name.starts_with('t'));
                for f in &mut layout.fields {
                    f.offset %= layout.point_step - 7;
                    f.datatype = 1 + f.datatype % 11;
                    f.count = 1;
                }
                layout.fields.sort_by(|a, b| a.name.cmp(&b.name));
                layout.fields.dedup_by(|a, b| a.name == b.name);
                layout.fields.extend([field("x", 0, 7), field("y", 4, 7), field("z", 8, 7)]);
                prop_assert!(layout.view(&data, &LIMITS).is_ok() || data.len() < 800);
            }
            // What is mended is honest about its extent, and nothing is left to mend.
            let mut mended = layout.clone();
            mended.mend(data.len());
            let again = mended.clone().mend(data.len());
            let is_of_no_point = |note: &LayoutNote| matches!(note, LayoutNote::DataWithoutPoints { .. });
            prop_assert!(again.iter().all(is_of_no_point));
            if layout.view(&data, &LIMITS).is_ok() {
                prop_assert!(mended.view(&data, &LIMITS).is_ok());
            }
            let Ok(view) = mended.view(&data, &LIMITS) else { continue };
            prop_assert!(view.len() <= LIMITS.max_points);
            for i in [0, view.len() / 2, view.len(), usize::MAX] {
                let p = view.xyz(i);
                prop_assert!(i < view.len() || p.x.is_nan());
            }
            let options = TimeOptions { unit, reference, ..TimeOptions::default() };
            let times = view.point_times(stamp_ns, &options).ok().and_then(|times| times.times_ns);
            if let Some(times) = &times {
                prop_assert_eq!(times.len(), view.len());
                let known = || times.iter().filter(|t| **t != NO_TIME_NS);
                if let (Some(a), Some(b)) = (known().min(), known().max()) {
                    prop_assert!(i128::from(*b) - i128::from(*a) < 1_000_000_000);
                }
            }
            let format = RecordFormat::new(&view, &[], Some(Precision::Float64), false);
            let all = transform_records(&view, stamp_ns, times.as_deref(), &RangeLimits::default(),
                &format, |_| Ok::<_, Infallible>(Isometry3::identity())).unwrap();
            prop_assert_eq!(
                all.points + all.not_finite + all.out_of_range + all.no_time, view.len());
            let points_m = points_m(&all);
            prop_assert_eq!(points_m.len(), all.points);
            prop_assert!(points_m.iter().flatten().all(|v| v.is_finite()));
        }
    }

    /// Bit for bit the plain formula, for any number of threads.
    #[test]
    fn deskew_equals_the_plain_formula(
        seed in prop::collection::vec((-50.0..50.0_f32, -50.0..50.0_f32, 0..40_000_000_u32), 1..60),
        repeat in 1..150_usize, threads in 1..5_usize,
        min_range_m in 0.0..20.0_f64, max_range_m in 20.0..80.0_f64,
    ) {
        let mut data = Vec::new();
        for _ in 0..repeat {
            for (x, y, t) in &seed {
                for v in [*x, *y, x - y] {
                    data.extend_from_slice(&v.to_le_bytes());
                }
                data.extend_from_slice(&t.to_le_bytes());
            }
        }
        let points = (data.len() / 16) as u32;
        let layout = CloudLayout {
            width: points, height: 1, point_step: 16, row_step: 16 * points, is_bigendian: false,
            fields: vec![field("x", 0, 7), field("y", 4, 7), field("z", 8, 7), field("t", 12, 6)],
        };
        let view = layout.view(&data, &LIMITS).unwrap();
        let stamp_ns = 1_700_000_000_000_000_000;
        let times = view.point_times(stamp_ns, &TimeOptions::default()).unwrap().times_ns.unwrap();
        let pose = |at: i64| {
            let t = (at - stamp_ns) as f64 * 1.0e-9;
            Isometry3::new(Vector3::new(9.0 * t, 1.0, 5.0), Vector3::new(0.1, 0.0, 20.0 * t))
        };
        let range = RangeLimits { min_range_m, max_range_m };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let format = RecordFormat::new(&view, &[], Some(Precision::Float64), false);
        let found = pool.install(|| transform_records(&view, stamp_ns, Some(&times), &range, &format,
            |at| Ok::<_, Infallible>(pose(at)))).unwrap();
        let plain: Vec<Vector3<f64>> = (0..view.len())
            .map(|i| (view.xyz(i), times[i]))
            .filter(|(p, _)| p.norm() > min_range_m && p.norm() <= max_range_m)
            .map(|(p, at)| (pose(at) * Point3::from(p)).coords)
            .collect();
        prop_assert_eq!(found.out_of_range, view.len() - plain.len());
        prop_assert_eq!(points_m(&found), plain);
    }
}
