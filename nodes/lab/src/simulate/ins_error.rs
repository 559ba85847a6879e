//! Errors of the measured poses at any time.

use super::bobcat::{Bobcat, INS_PERIOD_NS};
use super::ins::{InsSample, InsSamples};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Share of the log's INS errors: 1 cm level and 1.4 cm in height, as after post-processing.
const POSITION_SHARE: f64 = 2.0 / 3.0;

/// Difference of a measured from a true pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct InsError {
    position_m: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
}

impl InsError {
    fn of(sample: &InsSample) -> Self {
        let (measured, truth) = (&sample.map_from_base, &sample.true_map_from_base);
        Self {
            position_m: (measured.translation.vector - truth.translation.vector) * POSITION_SHARE,
            rotation: measured.rotation * truth.rotation.inverse(),
        }
    }

    /// The measured pose of a true one.
    pub(super) fn apply(&self, truth: &Isometry3<f64>) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(truth.translation.vector + self.position_m),
            self.rotation * truth.rotation,
        )
    }
}

/// The errors of the epochs about the scans at hand.
#[derive(Debug)]
pub(super) struct InsErrors<'a> {
    samples: InsSamples<'a>,
    known: Vec<InsError>,
    first_epoch: i64,
}

impl<'a> InsErrors<'a> {
    pub(super) fn new(bobcat: &'a Bobcat) -> Self {
        Self {
            samples: bobcat.ins(),
            known: Vec::new(),
            first_epoch: 0,
        }
    }

    /// Forgets what is before a time and measures until after another, ns.
    pub(super) fn cover(&mut self, from_ns: i64, to_ns: i64) {
        let past = (from_ns / INS_PERIOD_NS - self.first_epoch).max(0) as usize;
        let past = past.min(self.known.len());
        self.known.drain(..past);
        self.first_epoch += past as i64;
        let last_epoch = to_ns / INS_PERIOD_NS + 1;
        let missing = last_epoch + 1 - self.first_epoch - self.known.len() as i64;
        let more = self.samples.by_ref().take(missing.max(0) as usize);
        self.known.extend(more.map(|sample| InsError::of(&sample)));
    }

    /// The error between two epochs, ns; the nearest one beyond their ends.
    pub(super) fn at(&self, time_ns: i64) -> InsError {
        let at = (time_ns / INS_PERIOD_NS - self.first_epoch).max(0) as usize;
        let share = time_ns.rem_euclid(INS_PERIOD_NS) as f64 / INS_PERIOD_NS as f64;
        let (a, b) = (self.known.get(at), self.known.get(at + 1));
        match (a, b, self.known.last()) {
            (Some(a), Some(b), _) => InsError {
                position_m: a.position_m.lerp(&b.position_m, share),
                rotation: a.rotation.nlerp(&b.rotation, share),
            },
            (Some(e), None, _) | (None, _, Some(e)) => *e,
            (None, _, None) => InsError {
                position_m: Vector3::zeros(),
                rotation: UnitQuaternion::identity(),
            },
        }
    }
}
