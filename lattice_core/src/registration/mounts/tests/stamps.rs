use super::*;

/// Samples whose points are of a clock that is late, with the poses of the whole drive.
fn of_other_clock(drive: Drive, wrong: &MountCorrection, late_s: f64, seed: u64) -> MountSamples {
    let mut samples = samples(drive, wrong, late_s, seed);
    let times = (-2500..4500).map(|step| 0.01 * f64::from(step));
    samples.way = times
        .map(|time_s| crate::pose::StampedPose {
            stamp_ns: (time_s * 1e9) as i64,
            map_from_base: pose_at(drive, time_s),
        })
        .collect();
    // The poses that belong to the stamps.
    for pose in &mut samples.poses {
        pose.stamp_s += late_s;
    }
    samples
}

#[test]
fn stamps_of_another_clock_are_found_with_a_wrong_mount() {
    let truth = wrong([2.0, -1.0, 3.0], [0.2, -0.1, 0.1]);
    for late_s in [18.0, -2.5, 0.15] {
        let samples = of_other_clock(Drive::Rough, &truth, late_s, 9);
        let found = estimate_mount(&samples, &exact_poses()).unwrap();
        let errors = errors(&found, &truth, late_s);
        assert!(errors[6].abs() < 0.002, "{late_s}: {errors:?}");
        assert!(errors[2].abs() < 0.1, "{late_s}: {errors:?}");
        assert!(found.numbers[6].is_observable);
        assert!((found.numbers[6].value + late_s).abs() < 0.002);
    }
}

#[test]
fn right_stamps_raise_no_alarm_whatever_the_way() {
    let truth = wrong([0.0; 3], [0.0; 3]);
    for (drive, seed) in [(Drive::Rough, 10), (Drive::Flat, 11), (Drive::Straight, 12)] {
        let samples = of_other_clock(drive, &truth, 0.0, seed);
        let found = estimate_mount(&samples, &MountOptions::default()).unwrap();
        let time = found.numbers[6];
        assert!(time.value.abs() < 0.005, "{time:?}");
    }
}

#[test]
fn a_straight_way_does_not_show_another_clock() {
    let truth = wrong([0.0; 3], [0.0; 3]);
    let samples = of_other_clock(Drive::Straight, &truth, 12.0, 13);
    let found = estimate_mount(&samples, &MountOptions::default()).unwrap();
    assert_eq!(
        (found.numbers[6].value, found.numbers[6].is_observable),
        (0.0, false)
    );
}

#[test]
fn poses_beyond_the_reach_of_keys_show_no_offset() {
    let mut far = of_other_clock(Drive::Rough, &wrong([0.0; 3], [0.0; 3]), 5.0, 14);
    for pose in &mut far.way {
        pose.map_from_base.translation.x += 1e12;
    }
    assert_eq!(time_scan::search(&far), Offset::Nothing);
    far.way.clear();
    assert_eq!(time_scan::search(&far), Offset::Nothing);
}
