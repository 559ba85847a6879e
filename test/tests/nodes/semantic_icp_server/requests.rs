//! Callers: answered, refused, superseded, cancelled, and told at the end.

use std::sync::atomic::Ordering::Relaxed;

use lattice_core::registration::Verdict;
use lattice_msgs::calibration::{CalibrateGoal, CalibrationResult};
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
    assert_eq!(
        bench.answers[0].2.message,
        "there is no cloud of the headset yet"
    );
    bench.cloud(&good());
    assert!(bench.results.is_empty() && bench.search.headset_scans.is_empty());
    let elsewhere = CalibrateGoal {
        session: "x".into(),
        ..goal.clone()
    };
    bench.ask(2, &elsewhere);
    assert!(bench.answers[1].2.message.contains("not 'x'"));
    let mut guess = CalibrateGoal {
        has_guess: true,
        guess: pose_from(&Isometry3::translation(4.0, 5.0, 6.0)),
        ..goal.clone()
    };
    guess.guess.orientation.w = f64::NAN;
    bench.ask(3, &guess);
    assert!(bench.answers[2].2.message.contains("not a pose"));
    guess.guess.orientation.w = 1.0;
    bench.ask(4, &guess);
    bench.ask(5, &goal);
    assert_eq!((bench.answers[3].0, bench.answers[3].1), (5, End::Failed));
    assert!(bench.answers[3].2.message.contains("busy"));
    bench.work();
    assert_eq!((bench.answers[4].0, bench.answers[4].1), (4, End::Found));
    assert_eq!(bench.feedback, [(4, "search".to_owned())]);
    assert_eq!(bench.search.starts[0].unwrap().translation.x, 4.0);
    let counts = bench.machine.counts();
    assert_eq!(
        (
            counts.requests_in,
            counts.requests_refused,
            counts.requests_busy
        ),
        (5, 3, 1)
    );

    bench
        .search
        .verdicts
        .push_back(found(Verdict::Ambiguous, 2.0));
    bench.ask(6, &goal);
    bench.work();
    assert_eq!((bench.answers[5].0, bench.answers[5].1), (6, End::Failed));
    assert_eq!(
        bench.answers[5].2.result.verdict,
        CalibrationResult::AMBIGUOUS
    );

    let mut bench = self::bench(ServerOptions {
        when_busy: WhenBusy::Supersede,
        ..asked
    });
    bench.cloud(&good());
    bench.ask(1, &goal);
    bench.ask(2, &goal);
    bench.ask(3, &goal);
    let ended: Vec<_> = bench
        .answers
        .iter()
        .map(|(call, end, _)| (*call, *end))
        .collect();
    assert_eq!(ended, [(1, End::Failed), (2, End::Failed)]);
    assert!(bench.answers[1].2.message.contains("superseded"));
    bench.work();
    assert_eq!((bench.answers[2].0, bench.answers[2].1), (3, End::Found));
    assert_eq!(bench.machine.counts().searches_ended_early, 1);
}

#[test]
fn a_request_joins_a_search_that_is_at_work() {
    let mut bench = bench(ServerOptions::default());
    bench.send(&good());
    bench.ask(1, &CalibrateGoal::default());
    bench.work();
    assert_eq!(
        (bench.answers.len(), bench.search.headset_scans.len()),
        (1, 1)
    );
    assert_eq!((bench.answers[0].1, bench.verdict()), (End::Found, OK));
}

#[test]
fn a_canceled_request_ends_at_once_and_what_was_known_stays() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    let before = bench.results.len();
    bench.ask(1, &CalibrateGoal::default());
    let canceled = bench.jobs[0].canceled.clone();
    let outputs = bench.machine.cancel(1);
    bench.put(outputs);
    assert!(canceled.load(Relaxed));
    assert_eq!(
        (bench.answers[0].1, bench.answers.len()),
        (End::Canceled, 1)
    );
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
    assert_eq!((bench.answers[1].0, bench.answers[1].1), (2, End::Canceled));
    assert_eq!(
        bench.search.headset_scans.len(),
        2,
        "it was ended before it began"
    );
}

#[test]
fn the_end_answers_everyone() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    bench.ask(1, &CalibrateGoal::default());
    let outputs = bench.machine.finish();
    bench.put(outputs);
    assert_eq!(
        (bench.answers[0].1, &*bench.answers[0].2.message),
        (End::Failed, "the server ends")
    );
}
