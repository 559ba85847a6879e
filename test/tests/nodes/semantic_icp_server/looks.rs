//! Looks that are refused, that do not fit, and that fit somewhat.

use lattice_core::registration::Verdict;
use lattice_msgs::lattice::CalibrateGoal;
use lattice_nodes::semantic_icp_server::{ServerOptions, Work};
use lattice_test::clouds::{SECOND_NS, cloud, labelled_cloud};

use super::bench::{AMBIGUOUS, NONE, OK, REJECTED, bench, found, good};

#[test]
fn every_refusal_has_its_reason_and_the_next_good_cloud_succeeds() {
    let mut options = ServerOptions::default();
    options.semantic.require_labels = true;
    options.semantic.max_points = 1000;
    let mut bench = bench(options);
    let nan = labelled_cloud("headset_origin", 5, &[([f32::NAN; 3], 7); 3]);
    let unlabelled = cloud("headset_origin", 5, &[[1.0; 3]]);
    let mut large = labelled_cloud("headset_origin", 5, &[([1.0; 3], 7); 1001]);
    let mut malformed = good();
    malformed.data.truncate(3);
    let mut wrong = good();
    wrong.header.frame_id = "hololens".into();
    let empty = labelled_cloud("headset_origin", 5, &[]);
    for (message, reason) in [
        (&nan, "none of the 3 points is finite"),
        (&unlabelled, "no labels"),
        (&large, "1000"),
        (&malformed, "3 bytes"),
        (&wrong, "frame 'hololens', expected 'headset_origin'"),
        (&empty, "no points"),
    ] {
        bench.cloud(message);
        assert_eq!(bench.verdict(), REJECTED);
        assert!(bench.reason().contains(reason), "{}", bench.reason());
        assert!(bench.machine.map_from_headset().is_none());
        bench.cloud(&good());
        assert_eq!(bench.verdict(), OK, "after: {reason}");
        bench.session(reason);
        assert_eq!(bench.verdict(), NONE);
    }
    let counts = bench.machine.counts().clone();
    assert_eq!(counts.clouds_refused(), 6);
    assert_eq!((counts.clouds_no_place, counts.clouds_unlabelled), (1, 1));
    assert_eq!((counts.clouds_too_large, counts.clouds_malformed), (1, 1));
    assert_eq!((counts.clouds_wrong_frame, counts.clouds_empty), (1, 1));

    // Ten million points are refused by their number alone, whatever the bytes are.
    large.width = 10_000_000;
    large.row_step = 140_000_000;
    large.data = serde_bytes::ByteBuf::from(vec![0; 140_000_000]);
    bench.cloud(&large);
    assert!(bench.reason().contains("10000000"), "{}", bench.reason());
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
}

#[test]
fn a_look_that_does_not_fit_is_searched_with_alone() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    // Rejected, as a mirrored one is: the pose stands, and the next good one is tracked.
    bench.look(0.1, Verdict::RejectedInput, 0.0);
    assert_eq!(bench.verdict(), REJECTED);
    assert_eq!(bench.search.headset_scans.last(), Some(&1));
    assert!(bench.machine.map_from_headset().is_some());
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);

    // Recentred without a word: the looks from before are of another origin.
    bench.look(0.1, Verdict::Ok, 50.0);
    let pose = bench.machine.map_from_headset().unwrap();
    assert_eq!(pose.translation.x, 50.0);
    bench.ask(1, &CalibrateGoal::default());
    bench.work();
    assert_eq!(bench.search.headset_scans.last(), Some(&1));

    // Lost after three searches in vain.
    for left in (0..3).rev() {
        bench.look(0.1, Verdict::NoOverlap, 0.0);
        assert_eq!(bench.machine.map_from_headset().is_some(), left > 0);
    }
    assert_eq!(bench.machine.counts().tracking_lost, 1);
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
}

#[test]
fn a_look_that_fits_somewhat_is_doubted() {
    // No looks more than one, which would confirm the pose.
    let mut bench = bench(ServerOptions {
        max_headset_scans: 1,
        ..ServerOptions::default()
    });
    bench.cloud(&good());
    // What is to be refused is, as often as it comes.
    for _ in 0..2 {
        bench.look(0.5, Verdict::RejectedInput, 0.0);
        assert_eq!(bench.verdict(), REJECTED);
    }
    // But one that tells nothing alone is held against nobody, and there is no doubt for a while.
    for verdict in [Verdict::NoOverlap, Verdict::Ambiguous, Verdict::Degenerate] {
        let searches = bench.search.headset_scans.len();
        bench.look(0.5, verdict, 0.0);
        bench.search.fits.push_back(0.5);
        bench.cloud(&good());
        assert_eq!(bench.verdict(), OK);
        assert_eq!(bench.search.headset_scans.len(), searches + 1);
        bench.now_ns += 10 * SECOND_NS;
    }
    let counts = bench.machine.counts();
    assert_eq!(counts.tracking_doubts, 5);
    assert_eq!((counts.tracking_misses, counts.tracking_lost), (0, 0));
    let pose = bench.machine.map_from_headset().unwrap();
    assert_eq!(pose.translation.x.round(), 1.0);
}

#[test]
fn a_pose_by_one_look_is_confirmed_by_the_next_or_withdrawn() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    // Two looks tell nothing more: the pose stands. Three find another, and then there are no more searches.
    let verdicts = [(Verdict::Ambiguous, 1.1), (Verdict::Ok, 50.0)];
    bench.search.verdicts = verdicts.map(|(verdict, x)| found(verdict, x)).into();
    for (x, searches) in [(1.0, vec![1, 2]), (50.0, vec![1, 2, 3])] {
        bench.cloud(&good());
        let pose = bench.machine.map_from_headset().unwrap();
        assert!((pose.translation.x - x).abs() < 0.1, "{pose}");
        assert_eq!(bench.verdict(), OK);
        assert_eq!(bench.search.headset_scans, searches);
    }
    let last = bench.transforms.last().unwrap();
    assert_eq!(last.transform.translation.x, 50.0);
    bench.cloud(&good());
    assert_eq!(bench.search.headset_scans, [1, 2, 3]);
    let counts = bench.machine.counts();
    assert_eq!((counts.confirmations, counts.poses_withdrawn), (2, 1));
    assert_eq!((counts.tracking_lost, counts.searches_ambiguous), (0, 1));

    // Who asked meanwhile is answered, whatever comes of it, and nobody else hears that nothing is new.
    let mut bench = super::bench::bench(ServerOptions::default());
    bench.cloud(&good());
    bench.search.verdicts = [found(Verdict::Ambiguous, 1.1)].into();
    bench.send(&good());
    let (job, results) = (bench.jobs.pop_front().unwrap(), bench.results.len());
    let id = job.id;
    let done = job.run(&mut bench.search, |_, _| ());
    let outputs = bench.machine.on_done(id, done, bench.now_ns);
    bench.put(outputs);
    assert!(matches!(bench.jobs[0].work, Work::Calibrate { .. }));
    bench.ask(1, &CalibrateGoal::default());
    bench.work();
    assert_eq!(bench.answered(0).0, 1);
    assert_eq!(bench.results.len(), results);

    // Two looks that fit best elsewhere, and not for sure: then nothing is known.
    let mut bench = super::bench::bench(ServerOptions::default());
    bench.cloud(&good());
    bench.search.verdicts = [found(Verdict::Ambiguous, 9.0)].into();
    bench.cloud(&good());
    assert!(bench.machine.map_from_headset().is_none());
    assert_eq!(bench.verdict(), AMBIGUOUS);
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
    assert_eq!(bench.search.headset_scans, [1, 2, 3]);
}
