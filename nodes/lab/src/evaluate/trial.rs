//! The result of one method in one trial.

use super::settings::Cell;
use crate::metrics::PoseError;
use lattice_core::registration::{Calibration, Margin, Verdict};
use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// The method whose results are ours.
pub const OURS: &str = "ours";
/// Ours, its time measured with nothing else running.
pub const TIMED: &str = "ours_timed";
/// One step of the tracker from a pose 3 cm and 1 degree off, its time measured with nothing else running.
pub const TRACKED: &str = "tracking_timed";

/// One line of the results.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Trial {
    #[serde(flatten)]
    pub cell: Cell,
    pub method: String,
    /// Share of the view whose labels differ between map and headset.
    pub different_share: f64,
    /// Distance of the headset's origin from the truth, metres.
    pub translation_m: f64,
    /// Angle from the truth, degrees.
    pub rotation_deg: f64,
    /// Tilt of the vertical, part of the angle, degrees.
    pub tilt_deg: f64,
    /// The error ||log(T* T_GT^-1)||, as the paper prints it.
    pub d_se3: f64,
    /// Left form ||log(T_GT^-1 T*)|| of d_SE3.
    pub d_se3_left: f64,
    /// Mean distance of the seen points from where they should be, metres.
    pub view_m: f64,
    /// Wall time, milliseconds, on one thread but for those that are timed.
    pub wall_ms: f64,
    /// Share of the cloud's points that the map has too, where that is measured.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub overlap: Option<f64>,
    /// Shares of labels that are right, where a network gave them.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub labels: Option<LabelsRight>,
    /// Middle of the seen points: its distance from the truth, its stated standard deviation in that direction, and its
    /// height above the truth, metres.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub middle: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub judged: Option<Judged>,
}

/// Shares of labels that are right.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct LabelsRight {
    /// Fraction for the voxels of the map, by their most frequent label.
    pub map: f64,
    /// Fraction for the points of the headset.
    pub headset: f64,
}

/// A calibration's judgement of its pose.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Judged {
    /// Verdict, as in `lattice_msgs/CalibrationResult`.
    pub verdict: String,
    pub reason: String,
    pub chosen: String,
    /// Log-likelihood above the best different pose; None if there was none.
    pub margin: Option<f64>,
    /// Probability that another pose is right.
    #[serde(default)]
    pub p_wrong: Option<f64>,
    /// Part of the margin that may be chance.
    #[serde(default)]
    pub even: Option<f64>,
    /// Standard deviation of that by chance.
    #[serde(default)]
    pub chance: Option<f64>,
    /// Independent observations without a partner.
    #[serde(default)]
    pub unexplained: Option<f64>,
    /// Number of other places, those that are less probable counting less.
    #[serde(default)]
    pub places: Option<f64>,
    /// Scale of the points and its standard deviation.
    #[serde(default)]
    pub scale: Option<(f64, f64)>,
    /// Log-likelihood by which the cloud fits better with that scale.
    #[serde(default)]
    pub scale_gain: Option<f64>,
    /// Log-likelihood by which other axes or another unit are ahead.
    #[serde(default)]
    pub other_reading_ahead: Option<f64>,
    /// Squared shift of regions over what is expected, shares of points that float and of lines of sight through
    /// surfaces, and regions that are not explained.
    #[serde(default)]
    pub fit: Option<(f64, f64, f64, usize)>,
    pub inliers: f64,
    /// Normalised squared error of the stated covariance, 6 degrees of freedom; None without a covariance.
    pub nees: Option<f64>,
}

impl Judged {
    /// Probability that another pose is right, as this version states it of the margin that was recorded; what was
    /// stated then if there was none.
    pub fn p_wrong_by_margin(&self) -> Option<f64> {
        let parts = self.even.zip(self.chance);
        let evidence = self.margin.zip(parts).zip(self.unexplained);
        let p_wrong = evidence.map(|((log_ratio, (indistinct, sigma)), outliers)| {
            let margin = Margin {
                log_ratio,
                indistinct,
                indistinct_sigma: sigma,
                outliers,
                alternatives: self.places.unwrap_or(1.0),
            };
            margin.p_wrong()
        });
        p_wrong.or(self.p_wrong)
    }
}

/// Bounds of a right pose: metres and degrees.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bounds {
    pub m: f64,
    pub deg: f64,
}

/// Bounds beyond which a pose is wrong.
pub const WRONG: Bounds = Bounds { m: 0.15, deg: 3.0 };
/// Tighter bounds.
pub const WRONG_TIGHT: Bounds = Bounds { m: 0.10, deg: 3.0 };

impl Trial {
    /// Compares a pose with the truth; `seen_m` are points of the headset, in its frame.
    pub fn of_pose(
        cell: &Cell,
        method: &str,
        pose: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        seen_m: &[Point3<f64>],
        wall_ms: f64,
    ) -> Trial {
        let up = Vector3::z();
        let error = PoseError::between(pose, truth);
        let tilt_rad = (pose.rotation * up).angle(&(truth.rotation * up));
        let apart = |p: &Point3<f64>| nalgebra::distance(&(pose * p), &(truth * p));
        let apart_m = seen_m.iter().map(apart);
        Trial {
            cell: cell.clone(),
            method: method.to_owned(),
            different_share: 0.0,
            translation_m: rounded(error.translation_m),
            rotation_deg: rounded(error.rotation_rad.to_degrees()),
            tilt_deg: rounded(tilt_rad.to_degrees()),
            d_se3: rounded(error.d_se3),
            d_se3_left: rounded(error.d_se3_left),
            view_m: rounded(apart_m.sum::<f64>() / seen_m.len().max(1) as f64),
            wall_ms: rounded(wall_ms),
            overlap: None,
            labels: None,
            middle: None,
            judged: None,
        }
    }

    /// Compares a calibration with the truth. Its time is not kept: it would be taken beside other trials.
    pub fn of_calibration(
        cell: &Cell,
        method: &str,
        found: &Calibration,
        truth: &Isometry3<f64>,
        seen_m: &[Point3<f64>],
    ) -> Trial {
        let pose = &found.target_from_source;
        Trial::of_pose(cell, method, pose, truth, seen_m, 0.0).with_judgement(found, truth)
    }

    pub fn with_judgement(self, calibration: &Calibration, truth: &Isometry3<f64>) -> Trial {
        let (margin, fit) = (calibration.margin, &calibration.fit);
        Trial {
            judged: Some(Judged {
                verdict: calibration.verdict.name().to_owned(),
                reason: calibration.reason.clone(),
                chosen: calibration.method.to_owned(),
                margin: margin
                    .log_ratio
                    .is_finite()
                    .then_some(rounded(margin.log_ratio)),
                p_wrong: Some(margin.p_wrong()),
                even: Some(margin.indistinct),
                chance: Some(margin.indistinct_sigma),
                unexplained: Some(margin.outliers),
                places: Some(margin.alternatives),
                scale: calibration
                    .scale
                    .map(|s| (rounded(s.scale), rounded(s.sigma))),
                scale_gain: calibration.scale.map(|s| rounded(s.gain)),
                other_reading_ahead: calibration.axis_hypothesis_lead.map(rounded),
                fit: Some((
                    rounded(fit.chi_square),
                    rounded(fit.floating),
                    rounded(fit.blocked),
                    fit.unexplained.len(),
                )),
                inliers: rounded(calibration.inlier_fraction),
                nees: nees(calibration, truth).map(rounded),
            }),
            ..self
        }
    }

    pub fn is_within(&self, bounds: Bounds) -> bool {
        self.translation_m <= bounds.m && self.rotation_deg <= bounds.deg
    }

    /// True if the seen points are within bounds, in place of the headset's origin, which may be metres away from them.
    pub fn is_within_in_view(&self, bounds: Bounds) -> bool {
        self.view_m <= bounds.m && self.rotation_deg <= bounds.deg
    }

    pub fn is_accepted(&self) -> bool {
        let judged = self.judged.as_ref();
        judged.is_some_and(|j| j.verdict == Verdict::Ok.name())
    }
}

/// A value rounded to the digits that are read back exactly from a file.
pub(super) fn rounded(value: f64) -> f64 {
    const UNIT: f64 = 1e6;
    if value.abs() < 1e9 {
        (value * UNIT).round() / UNIT
    } else {
        value.round()
    }
}

/// e^T C^-1 e of the position and the rotation vector by which a pose is off, both along the axes of
/// the map.
fn nees(calibration: &Calibration, truth: &Isometry3<f64>) -> Option<f64> {
    let pose = &calibration.target_from_source;
    let moved = pose.translation.vector - truth.translation.vector;
    let turned = (pose.rotation * truth.rotation.inverse()).scaled_axis();
    let error = Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z);
    let solved = calibration.covariance.cholesky()?.solve(&error);
    Some(error.dot(&solved)).filter(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix6;

    fn cell() -> Cell {
        Cell {
            scene: "tv".to_owned(),
            seed: 3,
            q: 0.4,
            start: "none".to_owned(),
        }
    }

    #[test]
    fn errors_are_those_of_the_pose() {
        let truth = Isometry3::new(Vector3::new(4.0, -3.0, 1.0), Vector3::z() * 2.0);
        let off = Isometry3::new(Vector3::new(4.03, -3.04, 1.0), Vector3::z() * 2.01);
        let seen = [Point3::new(0.0, 0.0, 0.0)];
        let trial = Trial::of_pose(&cell(), OURS, &off, &truth, &seen, 1.0);
        assert!((trial.translation_m - 0.05).abs() < 1e-6);
        assert!((trial.view_m - 0.05).abs() < 1e-6);
        assert!((trial.rotation_deg - 0.01_f64.to_degrees()).abs() < 1e-6);
        assert_eq!(trial.tilt_deg, 0.0);
        assert!(trial.is_within(WRONG) && !trial.is_accepted());

        let calibration = Calibration {
            target_from_source: off,
            covariance: Matrix6::from_diagonal(&Vector6::from([1e-4; 6])),
            margin: Margin {
                log_ratio: f64::INFINITY,
                ..Margin::default()
            },
            ..Calibration::refused(Verdict::Ok, "")
        };
        let trial = trial.with_judgement(&calibration, &truth);
        let judged = trial.judged.clone().unwrap();
        assert!(trial.is_accepted() && judged.margin.is_none());
        assert_eq!(judged.p_wrong_by_margin(), Some(0.0));
        let recorded = Judged {
            margin: Some(0.0),
            ..judged.clone()
        };
        assert_eq!(recorded.p_wrong_by_margin(), Some(0.5));
        // (0.03^2 + 0.04^2 + 0.01^2) / 1e-4.
        assert!((judged.nees.unwrap() - 26.0).abs() < 1e-6);

        let line = serde_json::to_string(&trial).unwrap();
        assert_eq!(serde_json::from_str::<Trial>(&line).unwrap(), trial);
        let refused = Calibration::refused(Verdict::NoOverlap, "");
        assert_eq!(nees(&refused, &truth), None);
    }
}
