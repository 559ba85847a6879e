//! The state machine with a search whose answers a test sets.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use lattice_core::lattice::LatticeKind;
use lattice_core::registration::{
    Calibration, CalibrationOptions, Progress, SourceCloud, Stage, TrackUpdate, Verdict,
};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::lattice::{CalibrateGoal, CalibrateResult, CalibrationResult};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::String as StringMessage;
use lattice_nodes::convert::semantic::LabelOptions;
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::semantic_icp_server::{
    CallId, End, Job, MapCloud, Output, Search, SemanticIcpServer, ServerOptions,
};
use lattice_test::clouds::{SECOND_NS, labelled_cloud};
use lattice_test::maps;
use nalgebra::Isometry3;

/// Answers that a test sets.
#[derive(Default)]
pub struct Fake {
    pub maps: usize,
    pub map_labelled: bool,
    pub verdicts: VecDeque<Calibration>,
    /// Shares of points on the map.
    pub fits: VecDeque<f64>,
    pub headset_scans: Vec<usize>,
    pub starts: Vec<Option<Isometry3<f64>>>,
    pub refuse_map: bool,
    /// Times that it was to forget the confusions of labels.
    pub unlearned: usize,
}

pub fn found(verdict: Verdict, x: f64) -> Calibration {
    let mut found = Calibration::refused(verdict, format!("{verdict:?}"));
    found.target_from_source = Isometry3::translation(x, 0.0, 0.0);
    found.inlier_fraction = 0.9;
    found
}

impl Search for Fake {
    fn reset_label_confusion(&mut self) {
        self.unlearned += 1;
    }

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
        headset_scans: &[SourceCloud],
        start: Option<Isometry3<f64>>,
        progress: &dyn Progress,
    ) -> Calibration {
        self.headset_scans.push(headset_scans.len());
        self.starts.push(start);
        if let ControlFlow::Break(()) = progress.report(Stage::Search, 0.5) {
            let mut ended = found(Verdict::RejectedInput, 0.0);
            ended.cancelled = true;
            return ended;
        }
        let next = self.verdicts.pop_front();
        next.unwrap_or_else(|| found(Verdict::Ok, 1.0))
    }

    fn track(&mut self, _: &SourceCloud, map_from_headset: &Isometry3<f64>) -> Option<TrackUpdate> {
        let fits = self.fits.pop_front().unwrap_or(0.9);
        Some(TrackUpdate {
            fits: fits >= CalibrationOptions::default().min_inliers,
            target_from_source: Isometry3::translation(0.001, 0.0, 0.0) * map_from_headset,
            inlier_fraction: fits,
            rmse_m: 0.01,
        })
    }
}

pub struct Bench<S> {
    pub machine: SemanticIcpServer,
    pub search: S,
    pub now_ns: i64,
    pub jobs: VecDeque<Job>,
    pub results: Vec<CalibrationResult>,
    pub transforms: Vec<TransformStamped>,
    pub answers: Vec<(CallId, End, CalibrateResult)>,
    pub feedback: Vec<(CallId, String)>,
}

impl<S: Search> Bench<S> {
    pub fn new(options: ServerOptions, search: S) -> Self {
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

    pub fn put(&mut self, outputs: impl IntoIterator<Item = Output>) {
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

    pub fn map(&mut self, mapper: &mut LatticeMapper) {
        mapper.take_update();
        for chunk in mapper.keyframe() {
            let outputs = self.machine.on_map(&chunk, self.now_ns);
            self.put(outputs);
        }
    }

    /// A cloud two seconds after what was before; nothing is calculated yet.
    pub fn send(&mut self, message: &PointCloud2) {
        self.now_ns += 2 * SECOND_NS;
        let outputs = self.machine.on_headset_cloud(message, self.now_ns);
        self.put(outputs);
    }

    /// Calculates until there is nothing more to do.
    pub fn work(&mut self) {
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

    pub fn cloud(&mut self, message: &PointCloud2) {
        self.send(message);
        self.work();
    }

    pub fn ask(&mut self, call: CallId, goal: &CalibrateGoal) {
        let outputs = self.machine.calibrate(call, goal, self.now_ns);
        self.put(outputs);
    }

    pub fn session(&mut self, name: &str) {
        let data = name.to_owned();
        let message = StringMessage { data };
        let outputs = self.machine.on_session(&message, self.now_ns);
        self.put(outputs);
    }

    pub fn verdict(&self) -> u8 {
        self.results.last().unwrap().verdict
    }

    /// Caller and end of an answer.
    pub fn answered(&self, i: usize) -> (CallId, End) {
        (self.answers[i].0, self.answers[i].1)
    }

    /// Message of an answer.
    pub fn message(&self, i: usize) -> &str {
        &self.answers[i].2.message
    }

    pub fn reason(&self) -> &str {
        &self.results.last().unwrap().reason
    }
}

pub fn mapper(epoch: u64) -> LatticeMapper {
    let options = MapperOptions {
        labels: Some(LabelOptions::default()),
        ..maps::options(LatticeKind::Cubic, 0.000_125)
    };
    LatticeMapper::new(options, epoch).unwrap()
}

impl Bench<Fake> {
    /// Shows a good look that fits so well, and whose search by itself would end so.
    pub fn look(&mut self, fit: f64, verdict: Verdict, x: f64) {
        self.search.fits.push_back(fit);
        self.search.verdicts.push_back(found(verdict, x));
        self.cloud(&good());
    }

    /// Shows a good look whose search ends so.
    pub fn searched(&mut self, verdict: Verdict) {
        self.search.verdicts.push_back(found(verdict, 9.0));
        self.cloud(&good());
    }

    /// Shows another map.
    pub fn other_map(&mut self) {
        let mut other = mapper(2);
        map_point(&mut other, 0.0);
        self.map(&mut other);
    }
}

pub fn bench(options: ServerOptions) -> Bench<Fake> {
    let mut mapper = mapper(1);
    map_point(&mut mapper, 1.0);
    let mut bench = Bench::new(options, Fake::default());
    bench.map(&mut mapper);
    bench
}

/// Maps a point at the origin, and one on the x axis.
pub fn map_point(mapper: &mut LatticeMapper, x: f32) {
    let points = [([0.0; 3], 3), ([x, 0.0, 0.0], 4)];
    mapper.on_cloud(&labelled_cloud("map", 1, &points)).unwrap();
}

pub fn good() -> PointCloud2 {
    let points = [([1.0, 2.0, 3.0], 7), ([1.0, 2.0, 4.0], 8)];
    labelled_cloud("headset_origin", 5, &points)
}

pub const OK: u8 = CalibrationResult::OK;
pub const REJECTED: u8 = CalibrationResult::REJECTED_INPUT;
pub const AMBIGUOUS: u8 = CalibrationResult::AMBIGUOUS;
pub const NONE: u8 = CalibrationResult::NONE;
