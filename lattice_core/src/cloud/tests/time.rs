use super::{F32, F64, U32, timed};
use crate::cloud::{CloudError, CloudLimits, NO_TIME_NS, TimeOptions, TimeReference, TimeUnit};

const STAMP_NS: i64 = 1_700_000_000_123_456_789;
const STAMP_S: f64 = 1_700_000_000.0;

type Times = Result<Option<Vec<i64>>, CloudError>;

fn read(
    name: &str,
    datatype: u8,
    times: &[Vec<u8>],
    stamp_ns: i64,
    options: &TimeOptions,
) -> Times {
    let points = vec![[1.0, 2.0, 3.0]; times.len()];
    let (layout, data) = timed(name, datatype, &points, times);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let found = view.point_times(stamp_ns, options);
    found.map(|times| times.times_ns)
}

fn f32s(values: &[f32]) -> Vec<Vec<u8>> {
    values.iter().map(|v| v.to_le_bytes().to_vec()).collect()
}

fn f64s(values: &[f64]) -> Vec<Vec<u8>> {
    values.iter().map(|v| v.to_le_bytes().to_vec()).collect()
}

fn u32s(values: &[u32]) -> Vec<Vec<u8>> {
    values.iter().map(|v| v.to_le_bytes().to_vec()).collect()
}

fn with(unit: Option<TimeUnit>, reference: Option<TimeReference>) -> TimeOptions {
    TimeOptions {
        unit,
        reference,
        ..TimeOptions::default()
    }
}

fn named(name: &str) -> TimeOptions {
    TimeOptions {
        field: Some(name.to_owned()),
        ..TimeOptions::default()
    }
}

fn spanning(max_span_s: f64) -> TimeOptions {
    TimeOptions {
        max_span_s,
        ..TimeOptions::default()
    }
}

fn after(offsets_ns: &[i64]) -> Times {
    Ok(Some(offsets_ns.iter().map(|o| STAMP_NS + o).collect()))
}

/// Velodyne, Ouster, Hesai, Livox, and seconds from the stamp in f64.
#[test]
fn sensors_are_known_by_name_type_and_size() {
    let whole_ns = 1_700_000_000_000_000_000;
    let absolute = |offset_ns| Ok(Some(vec![whole_ns, whole_ns + offset_ns]));
    let check = |name: &str, datatype, times: &[Vec<u8>], expected: Times| {
        let found = read(name, datatype, times, STAMP_NS, &TimeOptions::default());
        assert_eq!(found, expected, "{name}");
    };
    check("time", F32, &f32s(&[-0.5, 0.0]), after(&[-500_000_000, 0]));
    check("t", U32, &u32s(&[0, 99_999, 17]), after(&[0, 99_999, 17]));
    let seconds = [STAMP_S, STAMP_S + 0.0625];
    check("timestamp", F64, &f64s(&seconds), absolute(62_500_000));
    let nanoseconds = [1.7e18, 1.7e18 + 102_400.0];
    check("timestamp", F64, &f64s(&nanoseconds), absolute(102_400));
    check("time_stamp", F64, &f64s(&[-0.0625]), after(&[-62_500_000]));
    let whole = [1_700_000_000_000_000_000_u64, 1_700_000_000_000_102_400];
    let whole = whole.map(|v| v.to_le_bytes().to_vec());
    check("timestamp", 10, &whole, absolute(102_400));
    check("timestamp", 9, &whole, absolute(102_400));
    let negative = [-99_i32, 0].map(|v| v.to_le_bytes().to_vec());
    check("t", 5, &negative, after(&[-99, 0]));
    // The name states the unit.
    check("time_offset_ns", 5, &negative, after(&[-99, 0]));
    check("t_us", F32, &f32s(&[0.0, 100.0]), after(&[0, 100_000]));
    check("timestamp_ms", U32, &u32s(&[7]), after(&[7_000_000]));
    check("ts", F32, &f32s(&[0.5]), after(&[500_000_000]));
    check("intensity", F32, &f32s(&[0.0]), Ok(None));
    // Of a type that is no time.
    check("t", 3, &[vec![0, 0]], Ok(None));
    assert_eq!(read("time", F32, &f32s(&[0.0]), 0, &named("")), Ok(None));
}

#[test]
fn overrides_are_obeyed() {
    let check = |name, datatype, times: &[Vec<u8>], options, expected: Times| {
        assert_eq!(read(name, datatype, times, STAMP_NS, &options), expected);
    };
    let micros = with(Some(TimeUnit::Microseconds), None);
    check("t", U32, &u32s(&[0, 9]), micros, after(&[0, 9_000]));
    let times = u32s(&[10, 110]);
    let end = with(None, Some(TimeReference::StampEnd));
    check("t", U32, &times, end, after(&[-100, 0]));
    let absolute = with(None, Some(TimeReference::Absolute));
    check("t", U32, &times, absolute, Ok(Some(vec![10, 110])));
    let millis = TimeOptions {
        unit: Some(TimeUnit::Milliseconds),
        ..named("when")
    };
    let times = [vec![7, 0], vec![0, 0]];
    check("when", 4, &times, millis, after(&[7_000_000, 0]));
}

#[test]
fn a_free_running_clock_needs_and_takes_an_override() {
    let times = f64s(&[523.5, 523.25]);
    let read = |options| read("timestamp", F64, &times, STAMP_NS, &options);
    let refused = read(TimeOptions::default());
    assert!(matches!(
        refused,
        Err(CloudError::TimeOffset {
            offset_s: 523.5,
            ..
        })
    ));
    let start = with(None, Some(TimeReference::StampStart));
    assert_eq!(read(start), after(&[250_000_000, 0]));
}

#[test]
fn tai_is_distinguished_from_utc_unless_insisted_on() {
    let times = f64s(&[STAMP_S + 37.0, STAMP_S + 37.0625]);
    let stamp_ns = 1_700_000_000_000_000_000;
    let read = |options| read("timestamp", F64, &times, stamp_ns, &options);
    let error = read(TimeOptions::default()).unwrap_err().to_string();
    assert!(
        error.contains("absolute s are 37 s from the stamp"),
        "{error}"
    );
    let insist = with(None, Some(TimeReference::Absolute));
    let expected = [37_000_000_000, 37_062_500_000].map(|ns| stamp_ns + ns);
    assert_eq!(read(insist), Ok(Some(expected.to_vec())));
}

#[test]
fn a_span_of_a_second_is_refused() {
    let (almost, second) = (u32s(&[0, 999_999_999]), u32s(&[0, 1_000_000_000]));
    let read = |times: &[Vec<u8>], max_span_s| read("t", U32, times, 0, &spanning(max_span_s));
    assert!(read(&almost, TimeOptions::default().max_span_s).is_ok());
    let error = read(&second, TimeOptions::default().max_span_s).unwrap_err();
    assert!(
        error.to_string().contains("span 1 s, not within 0..1 s"),
        "{error}"
    );
    assert!(read(&second, 2.0).is_ok());
    assert!(read(&almost, f64::NAN).is_err());
}

#[test]
fn named_fields_must_be_there_and_have_a_unit() {
    let missing = read("t", U32, &u32s(&[0]), 0, &named("when"));
    assert!(matches!(missing, Err(CloudError::MissingTimeField { .. })));
    let error = read("t", 4, &[vec![0, 0]], 0, &named("t")).unwrap_err();
    assert!(error.to_string().contains("'t' is UINT16[1]"), "{error}");
}

#[test]
fn points_that_are_no_returns_have_no_say() {
    let x = [1.0, f32::NAN, 0.0, 2.0, 3.0];
    let times = f64s(&[STAMP_S, 0.0, 0.0, f64::NAN, STAMP_S + 0.25]);
    let (layout, data) = timed("timestamp", F64, &x.map(|x| [x, 0.0, 0.0]), &times);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    let found = view.point_times(STAMP_NS, &TimeOptions::default());
    let found = found.map(|times| times.times_ns);
    let (first, last) = (1_700_000_000_000_000_000, 1_700_000_000_250_000_000);
    assert_eq!(
        found,
        Ok(Some(vec![first, NO_TIME_NS, NO_TIME_NS, NO_TIME_NS, last]))
    );
}

#[test]
fn extreme_values_do_not_overflow() {
    use TimeReference::{Absolute, StampEnd, StampStart};
    for value in [f64::MAX, f64::MIN, 1.0e300, -1.0e300, f64::MIN_POSITIVE] {
        for stamp_ns in [i64::MIN, 0, i64::MAX] {
            for reference in [None, Some(StampStart), Some(StampEnd), Some(Absolute)] {
                let options = with(None, reference);
                let found = read("timestamp", F64, &f64s(&[value; 2]), stamp_ns, &options);
                if let Ok(Some(found)) = found {
                    assert_eq!((found.len(), found[0]), (2, found[1]));
                }
            }
        }
    }
}

#[test]
fn a_cloud_without_times_says_why() {
    let source = |name: &str, datatype, times: &[Vec<u8>]| {
        let (layout, data) = timed(name, datatype, &[[1.0, 2.0, 3.0]; 2], times);
        let view = layout.view(&data, &CloudLimits::default()).unwrap();
        let found = view.point_times(STAMP_NS, &TimeOptions::default());
        format!("{:?}", found.unwrap().source)
    };
    let none = source("curvature", F32, &f32s(&[0.0, 50.0]));
    assert_eq!(none, "NoField { candidates: \"curvature\" }");
    let none = source("ring", 4, &[vec![1, 0], vec![2, 0]]);
    assert_eq!(none, "NoField { candidates: \"\" }");
    let none = source("time", F32, &f32s(&[f32::NAN; 2]));
    assert!(none.starts_with("NotFinite"), "{none}");
    let found = source("t", U32, &u32s(&[5, 25]));
    assert!(found.contains("StampStart, span_ns: 20"), "{found}");
}

#[test]
fn a_few_absurd_times_cost_their_points_only() {
    let absurd = [0.0, 1e300, -1e300, STAMP_S + 1e6, STAMP_S - 5.0];
    let mut seconds: Vec<f64> = (0..20)
        .map(|i| STAMP_S + f64::from(i) * 0.0625 / 20.0)
        .collect();
    let first = (STAMP_S * 1e9) as i64;
    for value in absurd {
        let good = seconds.len();
        seconds.push(value);
        let found = read(
            "timestamp",
            F64,
            &f64s(&seconds),
            first,
            &TimeOptions::default(),
        );
        let found = found.unwrap().unwrap();
        assert_eq!(found[0], first);
        let none = found.iter().filter(|t| **t == NO_TIME_NS).count();
        assert_eq!(
            (none, found[good]),
            (seconds.len() - 20, NO_TIME_NS),
            "{value}"
        );
    }
    // Of as many absurd as sound ones, neither are believed.
    let doubtful: Vec<f64> = (0..20).map(|i| STAMP_S + f64::from(i % 2) * 1e6).collect();
    assert!(
        read(
            "timestamp",
            F64,
            &f64s(&doubtful),
            first,
            &TimeOptions::default()
        )
        .is_err()
    );
    // A long sweep is no matter of a few.
    let long: Vec<f32> = (0..20).map(|i| i as f32 * 0.075).collect();
    assert!(read("time", F32, &f32s(&long), first, &TimeOptions::default()).is_err());
}

#[test]
fn an_error_proposes_the_unit_that_fits() {
    let error = read(
        "time",
        F32,
        &f32s(&[0.0, 99_900.0]),
        0,
        &TimeOptions::default(),
    );
    let error = error.unwrap_err().to_string();
    assert!(error.contains("span 99900 s"), "{error}");
    assert!(
        error.contains("read as us they span 0.099900 s: set `time.unit: us`"),
        "{error}"
    );
}
