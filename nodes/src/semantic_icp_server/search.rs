//! Search and tracking jobs for another thread.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use lattice_core::registration::{
    Calibration, CalibrationMap, CalibrationRequest, Confusion, Profile, Progress, SemanticCloud,
    SourceCloud, Stage, TrackUpdate, Verdict, register_global, track,
};
use lattice_runtime::lock;
use nalgebra::Isometry3;

use super::ByProfile;

/// A map to prepare.
#[derive(Clone, Debug)]
pub struct MapCloud {
    /// Mean point of each voxel, with labels.
    pub cloud: SemanticCloud,
    /// Cell size (edge of the cube of equal volume), m.
    pub cell_side_m: f64,
}

/// Pose search, used on the compute thread.
pub trait Search: Send + 'static {
    /// Resets the learned label confusion.
    fn reset_label_confusion(&mut self);

    /// Prepares a map for all further jobs. The error is the reason why it cannot be used.
    fn prepare(&mut self, map: MapCloud) -> Result<(), String>;

    /// Searches the map.
    fn calibrate(
        &mut self,
        headset_scans: &[SourceCloud],
        start: Option<Isometry3<f64>>,
        progress: &dyn Progress,
    ) -> Calibration;

    /// Refines `map_from_headset` with a scan; `None` without a map.
    fn track(
        &mut self,
        headset_scan: &SourceCloud,
        map_from_headset: &Isometry3<f64>,
    ) -> Option<TrackUpdate>;
}

/// Search with the core library.
pub struct LatticeSearch {
    options: Arc<Mutex<ByProfile>>,
    map: Option<CalibrationMap>,
    /// Label confusion learned so far.
    confusion: Option<Confusion>,
    /// Profile of the last calibration that was OK, which tracking keeps: a single scan may be misclassified.
    profile: Profile,
}

impl LatticeSearch {
    /// Search without a map.
    pub fn new(options: ByProfile) -> Self {
        Self {
            options: Arc::new(Mutex::new(options)),
            map: None,
            confusion: None,
            profile: Profile::default(),
        }
    }

    /// Options of the next job.
    pub fn options(&self) -> Arc<Mutex<ByProfile>> {
        Arc::clone(&self.options)
    }
}

impl Search for LatticeSearch {
    fn reset_label_confusion(&mut self) {
        self.confusion = None;
    }

    fn prepare(&mut self, map: MapCloud) -> Result<(), String> {
        self.map = None;
        let map = CalibrationMap::new(map.cloud, map.cell_side_m).map_err(|e| e.to_string())?;
        self.map = Some(map);
        Ok(())
    }

    fn calibrate(
        &mut self,
        headset_scans: &[SourceCloud],
        start: Option<Isometry3<f64>>,
        progress: &dyn Progress,
    ) -> Calibration {
        let Some(map) = &self.map else {
            return Calibration::refused(Verdict::RejectedInput, "there is no map yet");
        };
        let request = CalibrationRequest {
            source_clouds: headset_scans,
            start,
            confusion: self.confusion.as_ref(),
        };
        let options = *lock(&self.options);
        let options = options.of_clouds(headset_scans);
        let mut found = register_global(map, &request, &options, progress);
        if options.profile != Profile::Headset {
            found.reason = format!("{}; profile {}", found.reason, options.profile);
        }
        if found.verdict == Verdict::Ok {
            self.confusion = Some(found.confusion.clone());
            self.profile = options.profile;
        }
        found
    }

    fn track(
        &mut self,
        headset_scan: &SourceCloud,
        map_from_headset: &Isometry3<f64>,
    ) -> Option<TrackUpdate> {
        let map = self.map.as_ref()?;
        let options = lock(&self.options).of_profile(self.profile);
        Some(track(map, headset_scan, map_from_headset, &options))
    }
}

/// Task of a job.
#[derive(Clone, Debug)]
pub enum Work {
    /// Estimate the pose from several scans, near a start if given.
    Calibrate {
        /// The scans.
        headset_scans: Vec<Arc<SourceCloud>>,
        /// Approximate `map_from_headset`.
        start: Option<Isometry3<f64>>,
    },
    /// Refine the current pose with one scan.
    Track {
        /// The scan.
        headset_scan: Arc<SourceCloud>,
        /// The current pose.
        map_from_headset: Isometry3<f64>,
    },
}

/// A search or tracking job.
#[derive(Clone, Debug)]
pub struct Job {
    /// Number of the search.
    pub id: u64,
    /// Learned label confusions are obsolete.
    pub reset_label_confusion: bool,
    /// Map to prepare first.
    pub map: Option<MapCloud>,
    /// Task.
    pub work: Work,
    /// Cancellation flag.
    pub canceled: Arc<AtomicBool>,
}

/// Result of a job.
#[derive(Clone, Debug)]
pub enum Done {
    /// Result of a search.
    Calibrated(Box<Calibration>),
    /// Result of tracking; `None`: there is no map.
    Tracked(Option<TrackUpdate>),
    /// Reason why the map cannot be used.
    NoMap(String),
}

struct Watch<'a, F> {
    canceled: &'a AtomicBool,
    on_progress: F,
}

impl<F: Fn(Stage, f64) + Sync> Progress for Watch<'_, F> {
    fn report(&self, stage: Stage, fraction: f64) -> ControlFlow<()> {
        (self.on_progress)(stage, fraction);
        match self.canceled.load(Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

impl Job {
    /// Runs the job; `on_progress` is called with the stage and its fraction.
    pub fn run(self, search: &mut dyn Search, on_progress: impl Fn(Stage, f64) + Sync) -> Done {
        if self.reset_label_confusion {
            search.reset_label_confusion();
        }
        if let Some(map) = self.map
            && let Err(reason) = search.prepare(map)
        {
            return Done::NoMap(reason);
        }
        match self.work {
            Work::Track {
                headset_scan,
                map_from_headset,
            } => Done::Tracked(search.track(&headset_scan, &map_from_headset)),
            Work::Calibrate {
                headset_scans,
                start,
            } => {
                let headset_scans: Vec<SourceCloud> = headset_scans
                    .into_iter()
                    .map(Arc::unwrap_or_clone)
                    .collect();
                let watch = Watch {
                    canceled: &self.canceled,
                    on_progress,
                };
                Done::Calibrated(Box::new(search.calibrate(&headset_scans, start, &watch)))
            }
        }
    }
}
