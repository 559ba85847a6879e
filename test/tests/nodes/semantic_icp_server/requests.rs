//! Callers: answered, refused, superseded, cancelled, and notified at the end.

use std::sync::atomic::Ordering::Relaxed;

use lattice_core::registration::Verdict;
use lattice_msgs::lattice::{CalibrateGoal, CalibrationResult};
use lattice_nodes::convert::geometry::pose_from;
use lattice_nodes::semantic_icp_server::{End, SearchWhen, ServerOptions, WhenBusy, Work};
use nalgebra::Isometry3;

use super::bench::{OK, bench, found, good};

#[test]
fn requests_are_answered_refused_or_superseded() {
    let asked = ServerOptions {
        search: SearchWhen::Asked,
        ..ServerOptions::default()
    };
    let goal = CalibrateGoal::default();
    let mut bench = bench(asked.clone());
    bench.ask(1, &goal);
    assert_eq!(bench.message(0), "there is no cloud of the headset yet");
    bench.cloud(&good());
    assert!(bench.results.is_empty() && bench.search.headset_scans.is_empty());
    let elsewhere = CalibrateGoal {
        session: "x".into(),
        ..goal.clone()
    };
    bench.ask(2, &elsewhere);
    assert!(bench.message(1).contains("not 'x'"));
    let mut guess = CalibrateGoal {
        has_guess: true,
        guess: pose_from(&Isometry3::translation(4.0, 5.0, 6.0)),
        ..goal.clone()
    };
    guess.guess.orientation.w = f64::NAN;
    bench.ask(3, &guess);
    assert!(bench.message(2).contains("not a pose"));
    guess.guess.orientation.w = 1.0;
    bench.ask(4, &guess);
    bench.ask(5, &goal);
    assert_eq!(bench.answered(3), (5, End::Failed));
    assert!(bench.message(3).contains("busy"));
    bench.work();
    assert_eq!(bench.answered(4), (4, End::Found));
    assert_eq!(bench.feedback, [(4, "search".to_owned())]);
    assert_eq!(bench.search.starts[0].unwrap().translation.x, 4.0);
    let counts = bench.machine.counts();
    assert_eq!((counts.requests_in, counts.requests_busy), (5, 1));
    assert_eq!(counts.requests_refused, 3);

    let ambiguous = found(Verdict::Ambiguous, 2.0);
    bench.search.verdicts.push_back(ambiguous);
    bench.ask(6, &goal);
    bench.work();
    assert_eq!(bench.answered(5), (6, End::Failed));
    let verdict = bench.answers[5].2.result.verdict;
    assert_eq!(verdict, CalibrationResult::AMBIGUOUS);

    let mut bench = self::bench(ServerOptions {
        when_busy: WhenBusy::Supersede,
        ..asked
    });
    bench.cloud(&good());
    for call in 1..4 {
        bench.ask(call, &goal);
    }
    assert_eq!(bench.answers.len(), 2);
    assert_eq!(bench.answered(0), (1, End::Failed));
    assert_eq!(bench.answered(1), (2, End::Failed));
    assert!(bench.message(1).contains("superseded"));
    bench.work();
    assert_eq!(bench.answered(2), (3, End::Found));
    assert_eq!(bench.machine.counts().searches_ended_early, 1);
}

#[test]
fn a_request_joins_a_search_that_is_at_work() {
    let mut bench = bench(ServerOptions::default());
    bench.send(&good());
    bench.ask(1, &CalibrateGoal::default());
    bench.work();
    assert_eq!((bench.answers.len(), bench.verdict()), (1, OK));
    assert_eq!(bench.search.headset_scans, [1]);
    assert_eq!(bench.answered(0), (1, End::Found));
}

#[test]
fn a_canceled_request_ends_at_once_and_what_was_known_stays() {
    // No looks more than one, which would confirm the pose.
    let mut bench = bench(ServerOptions {
        max_headset_scans: 1,
        ..ServerOptions::default()
    });
    bench.cloud(&good());
    let before = bench.results.len();
    bench.ask(1, &CalibrateGoal::default());
    let canceled = bench.jobs[0].canceled.clone();
    let outputs = bench.machine.cancel(1);
    bench.put(outputs);
    assert!(canceled.load(Relaxed));
    assert_eq!(bench.answered(0), (1, End::Canceled));
    bench.work();
    assert_eq!((bench.results.len(), bench.answers.len()), (before, 1));
    assert!(bench.machine.map_from_headset().is_some());
    assert!(bench.machine.cancel(1).is_empty() && bench.machine.cancel(99).is_empty());

    // One that still waits for a look to be tracked.
    bench.send(&good());
    assert!(matches!(bench.jobs[0].work, Work::Track { .. }));
    bench.ask(2, &CalibrateGoal::default());
    let outputs = bench.machine.cancel(2);
    bench.put(outputs);
    bench.work();
    assert_eq!(bench.answered(1), (2, End::Canceled));
    let searches = bench.search.headset_scans.len();
    assert_eq!(searches, 2, "it was ended before it began");
}

#[test]
fn the_end_answers_everyone() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    bench.ask(1, &CalibrateGoal::default());
    let outputs = bench.machine.finish();
    bench.put(outputs);
    assert_eq!(bench.answered(0), (1, End::Failed));
    assert_eq!(bench.message(0), "the server ends");
}
