//! The server's logic with a search that answers as it is told, and once with the true one.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::atomic::Ordering::Relaxed;

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::pose::Axes;
use lattice_core::registration::{
    Calibration, CalibrationOptions, Gaze, Progress, Stage, TrackUpdate, Verdict,
};
use lattice_msgs::calibration::{CalibrateGoal, CalibrateResult, CalibrationResult};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::String as StringMessage;
use lattice_nodes::convert::geometry::{isometry_from_transform, pose_from};
use lattice_nodes::convert::semantic::LabelOptions;
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::semantic_icp_server::{
    CallId, End, Job, LatticeSearch, MapCloud, Output, Search, SearchWhen, SemanticIcpServer,
    ServerOptions, WhenBusy, Work,
};
use lattice_test::clouds::{SECOND_NS, cloud, labelled_cloud};
use lattice_test::flat::{Flat, headset_cloud};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Answers as it is told.
#[derive(Default)]
struct Fake {
    maps: usize,
    map_labelled: bool,
    verdicts: VecDeque<Calibration>,
    /// Shares of points on the map.
    fits: VecDeque<f64>,
    gazes: Vec<usize>,
    starts: Vec<Option<Isometry3<f64>>>,
    refuse_map: bool,
}

fn found(verdict: Verdict, x: f64) -> Calibration {
    let mut found = Calibration::refused(verdict, format!("{verdict:?}"));
    found.map_from_headset = Isometry3::translation(x, 0.0, 0.0);
    found.inlier_fraction = 0.9;
    found
}

impl Search for Fake {
    fn prepare(&mut self, map: MapCloud) -> Result<(), String> {
        self.maps += 1;
        self.map_labelled = map.cloud.labels.len() == map.cloud.len();
        match self.refuse_map {
            true => Err("too small".into()),
            false => Ok(()),
        }
    }

    fn calibrate(
        &mut self,
        gazes: &[Gaze],
        start: Option<Isometry3<f64>>,
        progress: &dyn Progress,
    ) -> Calibration {
        self.gazes.push(gazes.len());
        self.starts.push(start);
        if let ControlFlow::Break(()) = progress.report(Stage::Search, 0.5) {
            let mut ended = found(Verdict::RejectedInput, 0.0);
            ended.cancelled = true;
            return ended;
        }
        let next = self.verdicts.pop_front();
        next.unwrap_or_else(|| found(Verdict::Ok, 1.0))
    }

    fn track(&mut self, _: &Gaze, map_from_headset: &Isometry3<f64>) -> Option<TrackUpdate> {
        let fits = self.fits.pop_front().unwrap_or(0.9);
        Some(TrackUpdate {
            holds: true,
            map_from_headset: Isometry3::translation(0.001, 0.0, 0.0) * map_from_headset,
            inlier_fraction: fits,
            rmse_m: 0.01,
        })
    }
}

struct Bench<S> {
    machine: SemanticIcpServer,
    search: S,
    now_ns: i64,
    jobs: VecDeque<Job>,
    results: Vec<CalibrationResult>,
    transforms: Vec<TransformStamped>,
    answers: Vec<(CallId, End, CalibrateResult)>,
    feedback: Vec<(CallId, String)>,
}

impl<S: Search> Bench<S> {
    fn new(options: ServerOptions, search: S) -> Self {
        Self {
            machine: SemanticIcpServer::new(options),
            search,
            now_ns: 1_700_000_000 * SECOND_NS,
            jobs: VecDeque::new(),
            results: Vec::new(),
            transforms: Vec::new(),
            answers: Vec::new(),
            feedback: Vec::new(),
        }
    }

    fn put(&mut self, outputs: impl IntoIterator<Item = Output>) {
        for output in outputs {
            match output {
                Output::Result(result) => self.results.push(*result),
                Output::Transform(transform) => self.transforms.push(transform),
                Output::Job(job) => self.jobs.push_back(job),
                Output::Answer(call, end, result) => self.answers.push((call, end, *result)),
                Output::Feedback(call, feedback) => self.feedback.push((call, feedback.stage)),
                Output::NeedKeyframe => panic!("nothing was lost"),
            }
        }
        assert!(self.jobs.len() <= 1, "one at a time");
    }

    fn map(&mut self, mapper: &mut LatticeMapper) {
        mapper.take_update();
        for chunk in mapper.keyframe() {
            let outputs = self.machine.on_map(&chunk, self.now_ns);
            self.put(outputs);
        }
    }

    /// A cloud two seconds after what was before; nothing is calculated yet.
    fn send(&mut self, message: &PointCloud2) {
        self.now_ns += 2 * SECOND_NS;
        let outputs = self.machine.on_headset_cloud(message, self.now_ns);
        self.put(outputs);
    }

    /// Calculates until there is nothing more to do.
    fn work(&mut self) {
        while let Some(job) = self.jobs.pop_front() {
            let id = job.id;
            let told = std::sync::Mutex::new(Vec::new());
            let done = job.run(&mut self.search, |stage, fraction| {
                told.lock().unwrap().push((stage, fraction));
            });
            for (stage, fraction) in told.into_inner().unwrap() {
                let output = self.machine.on_progress(id, stage, fraction);
                self.put(output);
            }
            self.now_ns += SECOND_NS / 4;
            let outputs = self.machine.on_done(id, done, self.now_ns);
            self.put(outputs);
        }
    }

    fn cloud(&mut self, message: &PointCloud2) {
        self.send(message);
        self.work();
    }

    fn ask(&mut self, call: CallId, goal: &CalibrateGoal) {
        let outputs = self.machine.calibrate(call, goal, self.now_ns);
        self.put(outputs);
    }

    fn session(&mut self, name: &str) {
        let data = name.to_owned();
        let outputs = self
            .machine
            .on_session(&StringMessage { data }, self.now_ns);
        self.put(outputs);
    }

    fn verdict(&self) -> u8 {
        self.results.last().unwrap().verdict
    }

    fn reason(&self) -> &str {
        &self.results.last().unwrap().reason
    }
}

fn mapper(epoch: u64) -> LatticeMapper {
    let mut options = MapperOptions::new(Lattice::new(LatticeKind::Cubic, 0.000_125).unwrap());
    options.labels = Some(LabelOptions::default());
    LatticeMapper::new(options, epoch).unwrap()
}

fn bench(options: ServerOptions) -> Bench<Fake> {
    let mut mapper = mapper(1);
    let points = [([0.0; 3], 3), ([1.0, 0.0, 0.0], 4)];
    mapper.on_cloud(&labelled_cloud("map", 1, &points)).unwrap();
    let mut bench = Bench::new(options, Fake::default());
    bench.map(&mut mapper);
    bench
}

fn good() -> PointCloud2 {
    labelled_cloud(
        "headset_origin",
        5,
        &[([1.0, 2.0, 3.0], 7), ([1.0, 2.0, 4.0], 8)],
    )
}

const OK: u8 = CalibrationResult::OK;
const REJECTED: u8 = CalibrationResult::REJECTED_INPUT;
const NONE: u8 = CalibrationResult::NONE;

#[test]
fn the_first_cloud_is_searched_and_the_next_are_tracked() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
    let result = bench.results.last().unwrap().clone();
    assert_eq!(
        (&*result.header.frame_id, &*result.child_frame_id),
        ("map", "headset_origin")
    );
    assert_eq!(
        (result.header.stamp.to_ns(), result.gazes, result.points),
        (5, 1, 2)
    );
    assert_eq!(result.duration_s, 0.25);
    assert_eq!(bench.transforms.len(), 1);
    assert!(bench.search.map_labelled);

    for _ in 0..3 {
        bench.cloud(&good());
    }
    assert_eq!(
        (bench.search.maps, bench.search.gazes.len()),
        (1, 1),
        "no more searches"
    );
    let counts = bench.machine.counts();
    assert_eq!(
        (
            counts.clouds_in,
            counts.clouds_searched,
            counts.clouds_tracked
        ),
        (4, 1, 3)
    );
    // A millimetre is no news; but what is published on is the refined pose.
    assert_eq!(bench.results.len(), 2, "told again after five seconds");
    assert_eq!(bench.results[1].method, "tracking");
    let tick = bench.machine.tick(bench.now_ns).unwrap();
    bench.put([tick]);
    let last = bench.transforms.last().unwrap();
    let pose = isometry_from_transform(&last.transform).unwrap();
    assert!((pose.translation.x - 1.003).abs() < 1e-9, "{pose}");
    assert_eq!(last.header.stamp.to_ns(), bench.now_ns);
    assert_eq!(
        (&*last.header.frame_id, &*last.child_frame_id),
        ("map", "headset_origin")
    );
}

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
fn without_a_map_clouds_are_refused_and_kept() {
    let mut bench = Bench::new(ServerOptions::default(), Fake::default());
    bench.cloud(&good());
    assert_eq!(
        (bench.verdict(), bench.reason()),
        (REJECTED, "there is no map yet")
    );
    bench.ask(1, &CalibrateGoal::default());
    assert_eq!(bench.answers[0].1, End::Failed);
    assert_eq!(bench.answers[0].2.message, "there is no map yet");
    bench.map(&mut mapper(1));
    bench.ask(2, &CalibrateGoal::default());
    assert_eq!(
        bench.answers[1].2.message, "there is no map yet",
        "it is empty"
    );

    let mut mapper = mapper(2);
    mapper
        .on_cloud(&labelled_cloud("map", 1, &[([0.0; 3], 3)]))
        .unwrap();
    bench.map(&mut mapper);
    bench.ask(3, &CalibrateGoal::default());
    bench.work();
    assert_eq!((bench.answers[2].0, bench.answers[2].1), (3, End::Found));
    assert!(bench.answers[2].2.success);

    bench.search.refuse_map = true;
    mapper
        .on_cloud(&labelled_cloud("map", 1, &[([5.0; 3], 3)]))
        .unwrap();
    bench.map(&mut mapper);
    bench.ask(4, &CalibrateGoal::default());
    bench.work();
    assert_eq!(
        bench.answers[3].2.message,
        "the map cannot be used: too small"
    );
    assert_eq!(bench.search.maps, 2, "made ready once for each state");
}

#[test]
fn several_gazes_are_searched_together_and_bad_ones_dropped() {
    let mut bench = bench(ServerOptions::default());
    for verdict in [
        Verdict::Ambiguous,
        Verdict::Degenerate,
        Verdict::Ambiguous,
        Verdict::Ambiguous,
    ] {
        bench.search.verdicts.push_back(found(verdict, 9.0));
        bench.cloud(&good());
        assert_ne!(bench.verdict(), OK);
    }
    assert_eq!(bench.search.gazes, [1, 2, 3, 3], "at most three");
    assert!(
        bench.transforms.is_empty(),
        "no pose is told that does not hold"
    );
    for verdict in [Verdict::NoOverlap, Verdict::RejectedInput] {
        bench.search.verdicts.push_back(found(verdict, 9.0));
        bench.cloud(&good());
    }
    assert_eq!(bench.search.gazes[4..], [3, 1], "those said nothing");
    bench.cloud(&good());
    assert_eq!((bench.verdict(), bench.search.gazes[6]), (OK, 1));

    // Clouds of one second are one look.
    let mut bench = self::bench(ServerOptions {
        search: SearchWhen::Asked,
        ..ServerOptions::default()
    });
    for _ in 0..5 {
        bench.now_ns -= 2 * SECOND_NS - SECOND_NS / 10;
        bench.cloud(&good());
    }
    bench.ask(1, &CalibrateGoal::default());
    bench.work();
    assert_eq!(bench.search.gazes, [1]);
}

#[test]
fn a_new_session_is_searched_anew() {
    let mut bench = bench(ServerOptions::default());
    bench.session("a");
    bench.cloud(&good());
    assert_eq!(bench.results.last().unwrap().session, "a");
    bench.session("a");
    assert_eq!(bench.verdict(), OK, "the same once more");
    bench.session("b");
    assert_eq!(
        (bench.verdict(), bench.reason()),
        (NONE, "the headset has begun a new session")
    );
    assert!(
        bench.machine.tick(bench.now_ns).is_none(),
        "no transform of the old origin"
    );
    bench.cloud(&good());
    assert_eq!((bench.verdict(), bench.search.gazes.last()), (OK, Some(&1)));

    // While a search is at work: what it finds is of the old origin.
    bench.session("c");
    bench.send(&good());
    bench.ask(7, &CalibrateGoal::default());
    let canceled = bench.jobs[0].canceled.clone();
    bench.session("d");
    assert!(canceled.load(Relaxed));
    assert_eq!(bench.answers[0].1, End::Failed);
    assert!(bench.answers[0].2.message.contains("new session"));
    bench.work();
    assert_eq!(
        (bench.verdict(), bench.machine.map_from_headset()),
        (NONE, None)
    );
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
    assert_eq!(bench.machine.counts().sessions, 4);
}

#[test]
fn a_new_map_is_searched_anew() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    let mut other = mapper(2);
    other
        .on_cloud(&labelled_cloud("map", 1, &[([0.0; 3], 3)]))
        .unwrap();
    bench.map(&mut other);
    assert_eq!(
        (bench.verdict(), bench.reason()),
        (NONE, "the map is a new one")
    );
    bench.cloud(&good());
    assert_eq!((bench.verdict(), bench.search.maps), (OK, 2));
}

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
    assert!(bench.results.is_empty() && bench.search.gazes.is_empty());
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
    assert_eq!((bench.answers.len(), bench.search.gazes.len()), (1, 1));
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
    assert_eq!(bench.search.gazes.len(), 2, "it was ended before it began");
}

#[test]
fn a_look_that_does_not_fit_is_searched_with_alone() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    // Rejected, as a mirrored one is: the pose stands, and the next good one is tracked.
    bench.search.fits.push_back(0.1);
    bench
        .search
        .verdicts
        .push_back(found(Verdict::RejectedInput, 0.0));
    bench.cloud(&good());
    assert_eq!(
        (bench.verdict(), bench.search.gazes.last()),
        (REJECTED, Some(&1))
    );
    assert!(bench.machine.map_from_headset().is_some());
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);

    // Recentred without a word: the looks from before are of another origin.
    bench.search.fits.push_back(0.1);
    bench.search.verdicts.push_back(found(Verdict::Ok, 50.0));
    bench.cloud(&good());
    assert_eq!(
        bench.machine.map_from_headset().unwrap().translation.x,
        50.0
    );
    bench.ask(1, &CalibrateGoal::default());
    bench.work();
    assert_eq!(bench.search.gazes.last(), Some(&1));

    // Lost after three searches in vain.
    for left in (0..3).rev() {
        bench.search.fits.push_back(0.1);
        bench
            .search
            .verdicts
            .push_back(found(Verdict::NoOverlap, 0.0));
        bench.cloud(&good());
        assert_eq!(bench.machine.map_from_headset().is_some(), left > 0);
    }
    assert_eq!(bench.machine.counts().tracking_lost, 1);
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
}

#[test]
fn a_look_that_fits_somewhat_is_doubted() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    // What is to be refused is, as often as it comes.
    for _ in 0..2 {
        bench.search.fits.push_back(0.5);
        bench
            .search
            .verdicts
            .push_back(found(Verdict::RejectedInput, 0.0));
        bench.cloud(&good());
        assert_eq!(bench.verdict(), REJECTED);
    }
    // But one that tells nothing alone is held against nobody, and there is no doubt for a while.
    for verdict in [Verdict::NoOverlap, Verdict::Ambiguous, Verdict::Degenerate] {
        bench.search.fits.extend([0.5, 0.5]);
        bench.search.verdicts.push_back(found(verdict, 0.0));
        let searches = bench.search.gazes.len();
        bench.cloud(&good());
        bench.cloud(&good());
        assert_eq!(
            (bench.verdict(), bench.search.gazes.len()),
            (OK, searches + 1)
        );
        bench.now_ns += 10 * SECOND_NS;
    }
    let counts = bench.machine.counts();
    assert_eq!(
        (
            counts.tracking_doubts,
            counts.tracking_misses,
            counts.tracking_lost
        ),
        (5, 0, 0)
    );
    assert_eq!(
        bench
            .machine
            .map_from_headset()
            .unwrap()
            .translation
            .x
            .round(),
        1.0
    );
}

#[test]
fn clouds_that_come_while_it_is_busy_are_not_lost_but_the_newest_counts() {
    let mut bench = bench(ServerOptions::default());
    bench
        .search
        .verdicts
        .push_back(found(Verdict::Ambiguous, 0.0));
    for _ in 0..5 {
        bench.send(&good());
    }
    bench.work();
    assert_eq!(
        (bench.search.gazes.clone(), bench.verdict()),
        (vec![1, 3], OK)
    );
    for _ in 0..5 {
        bench.send(&good());
    }
    assert_eq!(bench.jobs.len(), 1);
    bench.work();
    let counts = bench.machine.counts();
    assert_eq!((counts.clouds_in, counts.clouds_tracked), (10, 2));
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

fn truth() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.3);
    Isometry3::from_parts(Translation3::new(3.0, 2.0, 1.5), turn)
}

/// The whole way with the true search: a left-handed headset in a flat.
#[test]
fn a_left_handed_headset_is_found_and_a_mirrored_one_is_not() {
    let flat = Flat::default();
    let mut mapper = mapper(1);
    mapper.on_cloud(&flat.map_cloud(1)).unwrap();
    let mut options = ServerOptions::default();
    options.semantic.axes = Axes::UnityRuf;
    let mut bench = Bench::new(options, LatticeSearch::new(CalibrationOptions::default()));
    bench.map(&mut mapper);
    let look = flat.look(Point3::new(3.5, 3.8, 1.6), -2.2, &truth());
    let unity = |v: Vector3<f64>| Axes::UnityRuf.from_ros(v);
    let mirrored = |v: Vector3<f64>| unity(Vector3::new(v.x, -v.y, v.z));

    bench.cloud(&headset_cloud(&look, 1, mirrored));
    assert_eq!(bench.verdict(), REJECTED, "{}", bench.reason());
    assert!(bench.reason().contains("mirrored"), "{}", bench.reason());
    for turn in 0..3 {
        bench.cloud(&headset_cloud(&look, 2, unity));
        assert_eq!(bench.verdict(), OK, "{turn}: {}", bench.reason());
        let found = isometry_from_transform(&bench.results.last().unwrap().transform).unwrap();
        let off = truth().inverse() * found;
        assert!(off.translation.vector.norm() < 0.02, "{off}");
        assert!(off.rotation.angle() < 0.005, "{off}");
        // Also where the headset is known already.
        bench.cloud(&headset_cloud(&look, 3, mirrored));
        assert_eq!(bench.verdict(), REJECTED, "{turn}: {}", bench.reason());
    }
    let counts = bench.machine.counts();
    assert_eq!(counts.tracking_misses + counts.tracking_doubts, 3);
}
