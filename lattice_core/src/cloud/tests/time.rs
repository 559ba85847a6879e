use super::{F32, F64, U32, timed};
use crate::cloud::{CloudError, CloudLimits, NO_TIME_NS, TimeOptions, TimeReference, TimeUnit};

const STAMP_NS: i64 = 1_700_000_000_123_456_789;
const STAMP_S: f64 = 1_700_000_000.0;

fn read(
    name: &str,
    datatype: u8,
    times: &[Vec<u8>],
    stamp_ns: i64,
    options: &TimeOptions,
) -> Result<Option<Vec<i64>>, CloudError> {
    let points = vec![[1.0, 2.0, 3.0]; times.len()];
    let (layout, data) = timed(name, datatype, &points, times);
    layout
        .view(&data, &CloudLimits::default())
        .unwrap()
        .point_times(stamp_ns, options)
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

fn after_stamp(offsets_ns: &[i64]) -> Result<Option<Vec<i64>>, CloudError> {
    Ok(Some(offsets_ns.iter().map(|o| STAMP_NS + o).collect()))
}

#[test]
fn velodyne_seconds_before_the_stamp() {
    let times = f32s(&[-0.5, -0.25, 0.0]);
    assert_eq!(
        read("time", F32, &times, STAMP_NS, &TimeOptions::default()),
        after_stamp(&[-500_000_000, -250_000_000, 0])
    );
}

#[test]
fn ouster_nanoseconds_after_the_stamp() {
    let times = u32s(&[0, 99_999_999, 17]);
    assert_eq!(
        read("t", U32, &times, STAMP_NS, &TimeOptions::default()),
        after_stamp(&[0, 99_999_999, 17])
    );
}

#[test]
fn hesai_absolute_seconds() {
    let times = f64s(&[STAMP_S, STAMP_S + 0.0625]);
    assert_eq!(
        read("timestamp", F64, &times, STAMP_NS, &TimeOptions::default()),
        Ok(Some(vec![
            1_700_000_000_000_000_000,
            1_700_000_000_062_500_000
        ]))
    );
}

#[test]
fn livox_absolute_nanoseconds() {
    let times = f64s(&[1.7e18, 1.7e18 + 102_400.0]);
    assert_eq!(
        read("timestamp", F64, &times, STAMP_NS, &TimeOptions::default()),
        Ok(Some(vec![
            1_700_000_000_000_000_000,
            1_700_000_000_000_102_400
        ]))
    );
}

#[test]
fn f64_seconds_from_the_stamp() {
    let times = f64s(&[0.0, 0.0625, -0.0625]);
    assert_eq!(
        read("time_stamp", F64, &times, STAMP_NS, &TimeOptions::default()),
        after_stamp(&[0, 62_500_000, -62_500_000])
    );
}

#[test]
fn no_field_no_time() {
    let times = f32s(&[0.0]);
    let options = TimeOptions::default();
    assert_eq!(read("intensity", F32, &times, 0, &options), Ok(None));
    // Of a type that is no time.
    assert_eq!(read("t", 3, &[vec![0, 0]], 0, &options), Ok(None));
    let off = TimeOptions {
        field: Some(String::new()),
        ..TimeOptions::default()
    };
    assert_eq!(read("time", F32, &times, 0, &off), Ok(None));
}

#[test]
fn overrides_are_obeyed() {
    let micros = with(Some(TimeUnit::Microseconds), None);
    assert_eq!(
        read("t", U32, &u32s(&[0, 100_000]), STAMP_NS, &micros),
        after_stamp(&[0, 100_000_000])
    );
    let end = with(None, Some(TimeReference::StampEnd));
    assert_eq!(
        read("t", U32, &u32s(&[10, 110]), STAMP_NS, &end),
        after_stamp(&[-100, 0])
    );
    let named = TimeOptions {
        field: Some("when".to_owned()),
        unit: Some(TimeUnit::Milliseconds),
        ..TimeOptions::default()
    };
    assert_eq!(
        read("when", 4, &[vec![7, 0], vec![0, 0]], STAMP_NS, &named),
        after_stamp(&[7_000_000, 0])
    );
    let absolute = with(None, Some(TimeReference::Absolute));
    assert_eq!(
        read("t", U32, &u32s(&[10, 110]), STAMP_NS, &absolute),
        Ok(Some(vec![10, 110]))
    );
}

#[test]
fn a_free_running_clock_needs_and_takes_an_override() {
    let times = f64s(&[523.5, 523.25]);
    assert!(matches!(
        read("timestamp", F64, &times, STAMP_NS, &TimeOptions::default()),
        Err(CloudError::TimeOffset { offset_s, .. }) if offset_s == 523.5
    ));
    let start = with(None, Some(TimeReference::StampStart));
    assert_eq!(
        read("timestamp", F64, &times, STAMP_NS, &start),
        after_stamp(&[250_000_000, 0])
    );
}

#[test]
fn tai_is_distinguished_from_utc_unless_insisted_on() {
    let times = f64s(&[STAMP_S + 37.0, STAMP_S + 37.0625]);
    let stamp_ns = 1_700_000_000_000_000_000;
    match read("timestamp", F64, &times, stamp_ns, &TimeOptions::default()) {
        Err(CloudError::TimeClock { distance_s, .. }) => assert!((distance_s - 37.0).abs() < 1e-6),
        other => panic!("{other:?}"),
    }
    let insist = with(None, Some(TimeReference::Absolute));
    assert_eq!(
        read("timestamp", F64, &times, stamp_ns, &insist),
        Ok(Some(vec![
            stamp_ns + 37_000_000_000,
            stamp_ns + 37_062_500_000
        ]))
    );
}

#[test]
fn a_span_of_a_second_is_refused() {
    let options = TimeOptions::default();
    let almost = u32s(&[0, 999_999_999]);
    assert!(read("t", U32, &almost, 0, &options).is_ok());
    let second = u32s(&[0, 1_000_000_000]);
    assert!(matches!(
        read("t", U32, &second, 0, &options),
        Err(CloudError::TimeSpan {
            span_s: 1.0,
            max_span_s: 1.0,
            ..
        })
    ));
    let longer = TimeOptions {
        max_span_s: 2.0,
        ..TimeOptions::default()
    };
    assert!(read("t", U32, &second, 0, &longer).is_ok());
    let nonsense = TimeOptions {
        max_span_s: f64::NAN,
        ..TimeOptions::default()
    };
    assert!(read("t", U32, &almost, 0, &nonsense).is_err());
}

#[test]
fn named_fields_must_be_there_and_have_a_unit() {
    let named = |name: &str| TimeOptions {
        field: Some(name.to_owned()),
        ..TimeOptions::default()
    };
    assert!(matches!(
        read("t", U32, &u32s(&[0]), 0, &named("when")),
        Err(CloudError::MissingTimeField { .. })
    ));
    assert!(matches!(
        read("t", 4, &[vec![0, 0]], 0, &named("t")),
        Err(CloudError::TimeType {
            datatype: "UINT16",
            ..
        })
    ));
}

#[test]
fn points_that_are_no_returns_have_no_say() {
    let points = [
        [1.0, 0.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
    ];
    let times = f64s(&[STAMP_S, 0.0, 0.0, f64::NAN, STAMP_S + 0.25]);
    let (layout, data) = timed("timestamp", F64, &points, &times);
    let view = layout.view(&data, &CloudLimits::default()).unwrap();
    assert_eq!(
        view.point_times(STAMP_NS, &TimeOptions::default()),
        Ok(Some(vec![
            1_700_000_000_000_000_000,
            NO_TIME_NS,
            NO_TIME_NS,
            NO_TIME_NS,
            1_700_000_000_250_000_000
        ]))
    );
}

#[test]
fn extreme_values_do_not_overflow() {
    for value in [f64::MAX, f64::MIN, 1.0e300, -1.0e300, f64::MIN_POSITIVE] {
        for stamp_ns in [i64::MIN, 0, i64::MAX] {
            for reference in [
                None,
                Some(TimeReference::StampStart),
                Some(TimeReference::StampEnd),
                Some(TimeReference::Absolute),
            ] {
                let times = f64s(&[value, value]);
                if let Ok(Some(found)) =
                    read("timestamp", F64, &times, stamp_ns, &with(None, reference))
                {
                    assert_eq!(found.len(), 2);
                    assert_eq!(found[0], found[1]);
                }
            }
        }
    }
}
