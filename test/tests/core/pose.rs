//! Pose and transform buffers: between the samples, never beyond them, whatever the order.

use lattice_core::pose::{
    PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose, TfMiss, TransformBuffer,
    TransformBufferOptions, interpolate,
};
use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;

const MS: i64 = 1_000_000;

fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
    (-limit..limit, -limit..limit, -limit..limit).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    (vector(1.0e4), vector(3.0)).prop_map(|(t, r)| Isometry3::new(t, r))
}

/// Distance and angle (rad) between two poses.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let turn = a.rotation.inverse() * b.rotation;
    let half = turn.coords.xyz().norm().atan2(turn.w.abs());
    (
        (a.translation.vector - b.translation.vector).norm(),
        2.0 * half,
    )
}

fn close(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    let (metres, radians) = apart(a, b);
    metres < 1.0e-8 && radians < 1.0e-12
}

fn all_of_time() -> PoseBufferOptions {
    PoseBufferOptions {
        span_s: 1.0e6,
        max_gap_s: 1.0e6,
        max_poses: 1_000,
        jump_back_s: 1.0e6,
    }
}

fn config() -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(1024)
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn interpolation_stays_between_and_is_even(a in pose(), b in pose(), f in 0.0..=1.0_f64) {
        let between = interpolate(&a, &b, f);
        let (way, turn) = apart(&a, &b);
        let (way_a, turn_a) = apart(&a, &between);
        let (way_b, turn_b) = apart(&between, &b);
        prop_assert!((way_a - f * way).abs() < 1.0e-9 && (way_b - (1.0 - f) * way).abs() < 1.0e-9);
        prop_assert!((turn_a - f * turn).abs() < 1.0e-12, "{turn_a} of {turn} at {f}");
        prop_assert!((turn_b - (1.0 - f) * turn).abs() < 1.0e-12);
        prop_assert!((between.rotation.norm() - 1.0).abs() < 1.0e-15);
    }

    #[test]
    fn interpolation_moves_with_the_frame(a in pose(), b in pose(), frame in pose(), f in 0.0..=1.0_f64) {
        // The straight line and the shorter arc are the same seen from any frame.
        let moved = interpolate(&(frame * a), &(frame * b), f);
        prop_assume!(apart(&a, &b).1 < 3.1);
        prop_assert!(close(&moved, &(frame * interpolate(&a, &b, f))));
        prop_assert!(close(&interpolate(&b, &a, 1.0 - f), &interpolate(&a, &b, f)));
    }

    #[test]
    fn a_buffer_is_exact_at_samples_and_silent_outside(
        steps in prop::collection::vec((1..100_i64, pose()), 1..20),
        start in -1_000_000_000_000_000_000..1_000_000_000_000_000_000_i64,
        inside in 0.0..1.0_f64,
        beyond in 1..i64::MAX / 2,
    ) {
        let mut buffer = PoseBuffer::new(all_of_time());
        let mut samples = Vec::new();
        let mut stamp_ns = start;
        for (step, map_from_base) in steps {
            stamp_ns += step * MS;
            prop_assert_eq!(buffer.push(StampedPose { stamp_ns, map_from_base }), PushOutcome::Accepted);
            samples.push((stamp_ns, map_from_base));
        }
        prop_assert_eq!(buffer.validate(), Ok(()));
        for (at, expected) in &samples {
            prop_assert_eq!(buffer.at(*at).unwrap(), *expected);
        }
        for pair in samples.windows(2) {
            let ((t0, a), (t1, b)) = (pair[0], pair[1]);
            let at = t0 + ((t1 - t0) as f64 * inside) as i64;
            let fraction = (at - t0) as f64 / (t1 - t0) as f64;
            prop_assert!(close(&buffer.at(at).unwrap(), &interpolate(&a, &b, fraction)));
        }
        let (first, last) = (samples[0].0, samples[samples.len() - 1].0);
        prop_assert_eq!(buffer.at(first - beyond), Err(PoseMiss::BeforeStart { by_ns: beyond }));
        prop_assert_eq!(buffer.at(last + beyond), Err(PoseMiss::AfterEnd { by_ns: beyond }));
    }

    /// Whatever comes, the buffer is sound, bounded and answers only within its poses.
    #[test]
    fn a_buffer_survives_any_stamps(
        stamps in prop::collection::vec(
            prop_oneof![any::<i64>(), -5_000 * MS..5_000 * MS, 0..100_i64], 0..60),
        asked in any::<i64>(),
    ) {
        let options = PoseBufferOptions { span_s: 2.0, max_gap_s: 0.5, max_poses: 10, jump_back_s: 1.0 };
        let mut buffer = PoseBuffer::new(options);
        for stamp_ns in stamps {
            let newest = buffer.newest_ns();
            let before = buffer.len();
            match buffer.push(StampedPose { stamp_ns, map_from_base: Isometry3::identity() }) {
                PushOutcome::Accepted => {
                    prop_assert!(newest.is_none_or(|n| stamp_ns > n));
                    prop_assert_eq!(buffer.newest_ns(), Some(stamp_ns));
                }
                PushOutcome::JumpedBack => {
                    prop_assert_eq!((buffer.len(), buffer.newest_ns()), (1, Some(stamp_ns)));
                }
                PushOutcome::OutOfOrder => {
                    prop_assert!(newest.is_some_and(|n| stamp_ns <= n));
                    prop_assert_eq!((buffer.len(), buffer.newest_ns()), (before, newest));
                }
                PushOutcome::NotFinite => prop_assert!(false, "the pose is finite"),
            }
            prop_assert_eq!(buffer.validate(), Ok(()));
            if let (Some(a), Some(b)) = (buffer.oldest_ns(), buffer.newest_ns()) {
                prop_assert!(buffer.at(a).is_ok() && buffer.at(b).is_ok());
            }
        }
        if buffer.at(asked).is_ok() {
            prop_assert!(buffer.oldest_ns().unwrap() <= asked && asked <= buffer.newest_ns().unwrap());
        }
    }

    /// Any tree of frames, all static: a lookup is the composition along the path.
    #[test]
    fn lookups_compose_and_invert(
        parents in prop::collection::vec(any::<prop::sample::Index>(), 1..12),
        poses in prop::collection::vec(pose(), 12),
        picks in prop::collection::vec(any::<prop::sample::Index>(), 3),
        order in Just((0..12_usize).collect::<Vec<_>>()).prop_shuffle(),
    ) {
        // Frame 0 is the root; each further one hangs below an earlier one.
        let edges: Vec<(usize, usize)> = parents.iter().enumerate()
            .map(|(i, parent)| (parent.index(i + 1), i + 1)).collect();
        let mut root_from = vec![Isometry3::identity()];
        for (parent, child) in &edges {
            root_from.push(root_from[*parent] * poses[*child]);
        }
        let mut tf = TransformBuffer::new(TransformBufferOptions::default());
        for k in order.into_iter().filter(|k| *k < edges.len()) {
            let (parent, child) = edges[k];
            let done = tf.insert(&format!("f{parent}"), &format!("f{child}"), 0, poses[child], true);
            prop_assert_eq!(done, Ok(PushOutcome::Accepted));
            prop_assert_eq!(tf.validate(), Ok(()));
        }
        let [a, b, c] = [0, 1, 2].map(|k: usize| picks[k].index(root_from.len()));
        let look = |to: usize, from: usize| tf.lookup(&format!("f{to}"), &format!("/f{from}"), 7).unwrap();
        let near = |x: &Isometry3<f64>, y: &Isometry3<f64>| {
            let (metres, radians) = apart(x, y);
            metres < 1.0e-6 && radians < 1.0e-11
        };
        prop_assert!(near(&look(a, b), &(root_from[a].inverse() * root_from[b])));
        prop_assert!(near(&look(a, c), &(look(a, b) * look(b, c))));
        prop_assert!(near(&look(b, a), &look(a, b).inverse()));
        // The newest word of two frames about each other counts.
        let (parent, child) = edges[a % edges.len()];
        let (parent, child) = (format!("f{child}"), format!("f{parent}"));
        let done = tf.insert(&parent, &child, 0, poses[0], true);
        prop_assert_eq!(done, Ok(PushOutcome::Accepted));
        prop_assert!(near(&tf.lookup(&parent, &child, 7).unwrap(), &poses[0]));
        prop_assert_eq!(tf.validate(), Ok(()));
    }

    /// Moving frames may arrive in any order within the history.
    #[test]
    fn the_order_of_insertion_does_not_matter(
        samples in prop::collection::btree_map(0..1_000_i64, pose(), 2..15),
        seed in any::<prop::sample::Index>(),
        asked in prop::collection::vec(-100..1_100_i64, 10),
    ) {
        let sorted: Vec<_> = samples.into_iter().collect();
        let mut turned = sorted.clone();
        turned.rotate_left(seed.index(sorted.len()));
        let mut mirrored = sorted.clone();
        mirrored.reverse();
        let build = |samples: &[(i64, Isometry3<f64>)]| {
            let mut tf = TransformBuffer::new(TransformBufferOptions::default());
            for (ms, pose) in samples {
                assert_eq!(tf.insert("map", "base", ms * MS, *pose, false), Ok(PushOutcome::Accepted));
            }
            assert_eq!(tf.validate(), Ok(()));
            tf
        };
        let [tf, other, third] = [&sorted, &turned, &mirrored].map(|s| build(s));
        for ms in asked {
            let found = tf.lookup("map", "base", ms * MS);
            prop_assert_eq!(&found, &other.lookup("map", "base", ms * MS));
            prop_assert_eq!(&found, &third.lookup("map", "base", ms * MS));
            let (first, last) = (sorted[0].0, sorted[sorted.len() - 1].0);
            match found {
                Ok(_) => prop_assert!((first..=last).contains(&ms)),
                Err(TfMiss::TooOld { by_ns, .. }) => prop_assert_eq!(by_ns, (first - ms) * MS),
                Err(TfMiss::TooNew { by_ns, .. }) => prop_assert_eq!(by_ns, (ms - last) * MS),
                Err(other) => prop_assert!(false, "{:?}", other),
            }
        }
    }

    /// Any stream of transforms leaves a bounded table, and every lookup ends.
    #[test]
    fn a_transform_buffer_survives_any_stream(
        stream in prop::collection::vec((0..8_u8, 0..8_u8, any::<i64>(), any::<bool>()), 0..80),
        asked in any::<i64>(),
    ) {
        let options = TransformBufferOptions { max_frames: 6, max_samples: 4, ..TransformBufferOptions::default() };
        let mut tf = TransformBuffer::new(options);
        for (parent, child, stamp_ns, is_static) in stream {
            let frames = tf.len();
            let result = tf.insert(&parent.to_string(), &child.to_string(), stamp_ns,
                Isometry3::identity(), is_static);
            prop_assert!(result.is_ok() || tf.len() == frames);
            prop_assert_eq!(tf.validate(), Ok(()));
        }
        for target in 0..8_u8 {
            for source in 0..8_u8 {
                let found = tf.lookup(&target.to_string(), &source.to_string(), asked);
                if let Ok(transform) = found {
                    prop_assert!(close(&transform, &Isometry3::identity()));
                }
            }
        }
    }
}
