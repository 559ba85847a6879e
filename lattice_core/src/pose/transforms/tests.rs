use super::*;
use nalgebra::Vector3;

const MS: i64 = 1_000_000;

fn shift(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

fn buffer() -> TransformBuffer {
    TransformBuffer::new(TransformBufferOptions::default())
}

/// map -> base (moving) -> mount (static) -> turntable (moving) -> laser (static).
fn machine() -> TransformBuffer {
    let mut tf = buffer();
    for i in 0..=10 {
        let t = f64::from(i) * 0.1;
        let stamp_ns = i64::from(i) * 100 * MS;
        let turn = Isometry3::new(Vector3::zeros(), Vector3::new(0.0, 0.0, t));
        tf.insert(
            "map",
            "base_link",
            stamp_ns,
            shift(10.0 * t, 0.0, 0.0),
            false,
        )
        .unwrap();
        tf.insert("mount", "turntable", stamp_ns, turn, false)
            .unwrap();
    }
    tf.insert("base_link", "mount", 0, shift(0.0, 0.0, 2.0), true)
        .unwrap();
    tf.insert("turntable", "laser", 0, shift(1.0, 0.0, 0.0), true)
        .unwrap();
    assert_eq!(tf.validate(), Ok(()));
    tf
}

#[test]
fn a_turning_laser_on_a_driving_machine() {
    let tf = machine();
    let found = tf.lookup("map", "laser", 250 * MS).unwrap();
    let expected = Vector3::new(2.5 + 0.25_f64.cos(), 0.25_f64.sin(), 2.0);
    assert!((found.translation.vector - expected).norm() < 1.0e-12);
    let back = tf.lookup("laser", "map", 250 * MS).unwrap();
    assert!(((found * back).translation.vector).norm() < 1.0e-12);
    assert_eq!(
        tf.lookup("laser", "laser", i64::MAX),
        Ok(Isometry3::identity())
    );
}

#[test]
fn static_frames_need_no_time() {
    let tf = machine();
    for stamp_ns in [i64::MIN, 0, i64::MAX] {
        let found = tf.lookup("base_link", "mount", stamp_ns).unwrap();
        assert_eq!(found, shift(0.0, 0.0, 2.0));
    }
}

#[test]
fn leading_slashes_are_old_habits() {
    let mut tf = buffer();
    tf.insert("/map", "//base_link", 0, shift(1.0, 0.0, 0.0), true)
        .unwrap();
    assert_eq!(tf.lookup("map", "/base_link", 0), Ok(shift(1.0, 0.0, 0.0)));
    assert!(tf.contains("/map"));
    assert_eq!(tf.len(), 2);
}

#[test]
fn each_miss_has_its_reason() {
    let tf = machine();
    assert_eq!(
        tf.lookup("map", "/nowhere", 0),
        Err(TfMiss::UnknownFrame {
            frame: "nowhere".to_owned()
        })
    );
    let too_new = tf.lookup("map", "laser", 1001 * MS).unwrap_err();
    assert!(matches!(&too_new, TfMiss::TooNew { by_ns, .. } if *by_ns == MS));
    assert!(too_new.may_still_come());
    let too_old = tf.lookup("map", "laser", -MS).unwrap_err();
    assert!(matches!(&too_old, TfMiss::TooOld { by_ns, .. } if *by_ns == MS));
    assert!(!too_old.may_still_come());

    let mut tf = machine();
    tf.insert("odom", "wheel", 0, shift(0.0, 0.0, 0.0), true)
        .unwrap();
    assert_eq!(
        tf.lookup("map", "wheel", 0),
        Err(TfMiss::Disconnected {
            from: "wheel".to_owned(),
            to: "map".to_owned()
        })
    );
    tf.insert("map", "base_link", 3_000 * MS, shift(0.0, 0.0, 0.0), false)
        .unwrap();
    assert!(matches!(
        tf.lookup("map", "base_link", 2_000 * MS),
        Err(TfMiss::Gap { gap_ns, .. }) if gap_ns == 2_000 * MS
    ));
    tf.clear_link("map", "base_link");
    assert!(
        tf.lookup("map", "base_link", 0)
            .unwrap_err()
            .may_still_come()
    );
    assert!(tf.lookup("base_link", "mount", 0).is_ok());
}

#[test]
fn a_miss_that_lasts_is_told_before_one_that_heals() {
    for swapped in [false, true] {
        let mut tf = buffer();
        let (old, new) = if swapped { ("a", "b") } else { ("b", "a") };
        // At 500 ms, `old` has no past and `new` no future.
        tf.insert("root", old, 600 * MS, shift(0.0, 0.0, 0.0), false)
            .unwrap();
        tf.insert("root", new, 400 * MS, shift(0.0, 0.0, 0.0), false)
            .unwrap();
        for (target, source) in [("a", "b"), ("b", "a")] {
            assert!(matches!(
                tf.lookup(target, source, 500 * MS),
                Err(TfMiss::TooOld { .. })
            ));
        }
        // The same on one branch.
        tf.insert(old, "tip", 400 * MS, shift(0.0, 0.0, 0.0), false)
            .unwrap();
        assert!(matches!(
            tf.lookup("root", "tip", 500 * MS),
            Err(TfMiss::TooOld { .. })
        ));
    }
}

#[test]
fn what_means_nothing_is_refused_and_changes_nothing() {
    let mut tf = machine();
    let here = shift(0.0, 0.0, 0.0);
    assert_eq!(
        tf.insert("map", "map", 0, here, false),
        Err(TfInsertError::Itself("map".to_owned()))
    );
    assert!(matches!(
        tf.insert("map", "x", 0, shift(f64::NAN, 0.0, 0.0), true),
        Err(TfInsertError::NotFinite { .. })
    ));
    assert!(matches!(
        tf.insert("map", "/", 0, here, true),
        Err(TfInsertError::NoName { .. })
    ));
    assert!(matches!(
        tf.insert(&"m".repeat(10_000), "x", 0, here, true),
        Err(TfInsertError::LongName { bytes: 10_000, .. })
    ));
    assert_eq!(tf.len(), 5);
    assert_eq!(tf.validate(), Ok(()));
}

/// Other parents of the laser, as wrong publishers give them, more than are remembered.
fn mislead(tf: &mut TransformBuffer) {
    let wrong = shift(0.0, 9.0, 0.0);
    for (i, is_static) in [(0, false), (1, true), (2, false), (3, true), (4, true)] {
        let parent = format!("wrong{i}");
        tf.insert(&parent, "laser", 250 * MS, wrong, is_static)
            .unwrap();
        assert_eq!(tf.validate(), Ok(()));
    }
}

#[test]
fn other_parents_do_not_take_a_frame_away() {
    let right = machine().lookup("map", "laser", 250 * MS).unwrap();
    let mut tf = machine();
    tf.keep("base_link");
    tf.keep("laser");
    mislead(&mut tf);
    assert_eq!(tf.lookup("map", "laser", 250 * MS), Ok(right));
    // Those that were there first do not keep the right one out.
    let mut tf = buffer();
    mislead(&mut tf);
    for (parent, child) in [("map", "mount"), ("mount", "laser")] {
        tf.insert(parent, child, 0, shift(0.0, 0.0, 1.0), true)
            .unwrap();
    }
    assert_eq!(tf.lookup("map", "laser", 0), Ok(shift(0.0, 0.0, 2.0)));
    // Nor one that hangs the machine below its sensor, nor one of the other kind.
    let here = shift(0.0, 0.0, 5.0);
    tf.insert("laser", "mount", 0, here, true).unwrap();
    tf.insert("mount", "laser", 9, here, false).unwrap();
    tf.insert("mount", "laser", 0, shift(0.0, 0.0, 1.0), true)
        .unwrap();
    assert_eq!(tf.lookup("map", "laser", 0), Ok(shift(0.0, 0.0, 2.0)));
    assert_eq!(tf.validate(), Ok(()));
}

#[test]
fn frames_in_a_circle_have_an_end() {
    let mut tf = buffer();
    let step = shift(1.0, 0.0, 0.0);
    for (parent, child) in [("a", "b"), ("b", "c"), ("c", "a")] {
        tf.insert(parent, child, 0, step, true).unwrap();
    }
    assert_eq!(tf.lookup("a", "b", 0), Ok(step));
    assert_eq!(tf.lookup("b", "c", 0), Ok(step));
    assert_eq!(tf.lookup("c", "a", 0), Ok(step));
    let far = tf.lookup("a", "elsewhere", 0);
    assert!(matches!(far, Err(TfMiss::UnknownFrame { .. })));
    for i in 0..100 {
        tf.insert(&format!("f{}", i + 1), &format!("f{i}"), 0, step, true)
            .unwrap();
    }
    assert!(matches!(
        tf.lookup("f100", "f0", 0),
        Err(TfMiss::Disconnected { .. })
    ));
}

#[test]
fn a_full_table_takes_further_frames_and_keeps_those_in_use() {
    let mut tf = TransformBuffer::new(TransformBufferOptions {
        max_frames: 8,
        ..TransformBufferOptions::default()
    });
    let here = shift(0.0, 0.0, 1.0);
    for frame in ["base_link", "laser", "camera"] {
        tf.keep(frame);
    }
    tf.insert("base_link", "mount", 0, here, true).unwrap();
    tf.insert("mount", "laser", 0, here, true).unwrap();
    for i in 0..100 {
        tf.insert("base_link", &format!("flood{i}"), 0, here, true)
            .unwrap();
        tf.insert(&format!("root{i}"), &format!("leaf{i}"), i, here, false)
            .unwrap();
        assert_eq!(tf.validate(), Ok(()));
    }
    assert_eq!(tf.len(), 8);
    let mount = tf.lookup("base_link", "laser", 0);
    assert_eq!(mount, Ok(shift(0.0, 0.0, 2.0)));
    tf.insert("mount", "camera", 0, here, true).unwrap();
    assert_eq!(tf.lookup("laser", "camera", 0), Ok(shift(0.0, 0.0, 0.0)));
    assert!(tf.lookup("leaf99", "root99", 99).is_ok());
}

#[test]
fn frames_and_history_are_bounded() {
    let mut tf = TransformBuffer::new(TransformBufferOptions {
        max_frames: 2,
        max_samples: 3,
        ..TransformBufferOptions::default()
    });
    tf.keep("map");
    tf.keep("f0");
    for i in 0..100 {
        tf.insert("map", "f0", i, shift(0.0, 0.0, 0.0), false)
            .unwrap();
    }
    assert!(matches!(
        tf.insert("map", "f1", 0, shift(0.0, 0.0, 0.0), false),
        Err(TfInsertError::TooManyFrames { max_frames: 2, .. })
    ));
    assert!(tf.lookup("map", "f0", 97).is_ok());
    assert!(matches!(
        tf.lookup("map", "f0", 96),
        Err(TfMiss::TooOld { by_ns: 1, .. })
    ));
    assert_eq!(tf.validate(), Ok(()));
}

#[test]
fn time_set_back_starts_the_frame_anew() {
    let mut tf = machine();
    let second = 1_000 * MS;
    let far = 100 * second;
    let here = shift(5.0, 0.0, 0.0);
    let mut insert = |stamp_ns| tf.insert("map", "base_link", stamp_ns, here, false);
    assert_eq!(insert(far), Ok(PushOutcome::Accepted));
    assert_eq!(insert(far), Ok(PushOutcome::OutOfOrder));
    assert_eq!(insert(far - 2 * second), Ok(PushOutcome::Accepted));
    assert_eq!(insert(far - 3 * second), Ok(PushOutcome::JumpedBack));
    assert!(matches!(
        tf.lookup("map", "base_link", far),
        Err(TfMiss::TooNew { .. })
    ));
}

#[test]
fn a_static_transform_can_be_corrected() {
    let mut tf = machine();
    tf.insert("base_link", "mount", 5, shift(0.0, 0.0, 3.0), true)
        .unwrap();
    assert_eq!(tf.lookup("base_link", "mount", 0), Ok(shift(0.0, 0.0, 3.0)));
}

#[test]
fn the_static_root_of_a_sensor_is_the_frame_that_carries_it() {
    let mut tf = machine();
    assert_eq!(tf.static_root("laser"), Some("turntable"));
    assert_eq!(tf.static_root("/mount"), Some("base_link"));
    assert_eq!(tf.static_root("base_link"), Some("base_link"));
    assert_eq!(tf.static_root("nowhere"), None);
    // A loop of static transforms has no root, and ends.
    for (parent, child) in [("a", "b"), ("b", "c"), ("c", "a")] {
        tf.insert(parent, child, 0, shift(0.0, 0.0, 0.0), true)
            .unwrap();
    }
    assert!(tf.static_root("a").is_some());
}
