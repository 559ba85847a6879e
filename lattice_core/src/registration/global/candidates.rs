//! Poses that may be the answer, refined and judged.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use super::super::confusion::shares;
use super::super::likelihood::{Fit, Likelihood, Partners};
use super::super::search::Hypothesis;
use super::super::{Confusion, LabelUse, PreparedCloud, RegisterOptions, register};
use super::input::Input;
use super::map::CalibrationMap;
use super::rays::blocked_fraction;
use super::types::CalibrationOptions;

/// Steps of a first look, and those of them after which only the best go on.
pub(super) const COARSE_STEPS: usize = 7;
const SCREENING_STEPS: usize = 3;
/// Hypotheses that get all steps of a first look.
const SCREENED: usize = 64;
/// Hypotheses that are refined with more points after a first look.
const COARSE_REFINED: usize = 24;
/// Log-likelihood of an observation that refining a candidate may still win it.
const PRUNING_PER_OBSERVATION: f64 = 0.5;
/// Log-likelihood that a blocked line of sight costs an observation.
const BLOCKED_COST: f64 = 2.0;

/// Poses farther apart than this in the midst of the points, or turned by more, are different answers;
/// nearer ones say how sure the answer is.
const DIFFERENT_M: f64 = 0.5;
const DIFFERENT_RAD: f64 = 0.26;

/// A pose with what speaks for it.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub target_from_source: Isometry3<f64>,
    pub method: &'static str,
    pub likelihood: Likelihood,
    /// Lines of sight through walls, as log-likelihood.
    pub blocked: f64,
    pub inlier_fraction: f64,
    pub rmse_m: f64,
    pub confusion: Confusion,
}

impl Candidate {
    /// Total log-likelihood.
    pub fn total(&self) -> f64 {
        self.likelihood.total() - self.blocked
    }

    /// True if two are one place up to `shift_m` and `turn_rad`; places are compared in the midst of the
    /// points.
    pub fn is_near(
        &self,
        other: &Isometry3<f64>,
        centroid: &Point3<f64>,
        shift_m: f64,
        turn_rad: f64,
    ) -> bool {
        let pose = &self.target_from_source;
        nalgebra::distance(&(pose * centroid), &(other * centroid)) < shift_m
            && pose.rotation.angle_to(&other.rotation) < turn_rad
    }
}

/// Clouds and settings that candidates are made from.
pub(super) struct RegistrationContext<'a> {
    pub map: &'a CalibrationMap,
    pub input: &'a Input,
    pub options: &'a CalibrationOptions,
    /// Co-occurrence of labels known before this calibration.
    pub known: Confusion,
    pub fit: Fit<'a>,
    pub few: Fit<'a>,
}

impl<'a> RegistrationContext<'a> {
    pub fn new(
        map: &'a CalibrationMap,
        input: &'a Input,
        options: &'a CalibrationOptions,
        known: Option<&Confusion>,
    ) -> RegistrationContext<'a> {
        let scale = map.scale(options.noise_m);
        let unseen = Confusion::unseen(&shares(&input.few), &map.classes);
        RegistrationContext {
            map,
            input,
            options,
            known: known.map_or_else(|| unseen.clone(), |known| known.merged(&unseen)),
            fit: Fit::new(&input.full, &map.cloud, scale),
            few: Fit::new(&input.few, &map.cloud, scale.coarser(2.0)),
        }
    }

    /// The hypotheses that stand a first look, refined with a few points, the best first and all
    /// different.
    pub fn coarse_refine(&self, hypotheses: &[Hypothesis]) -> Vec<Candidate> {
        let found = self.refine_best(&self.input.few, hypotheses, SCREENED, |pose| {
            let candidate = self.judge(&self.few, pose, "search");
            (candidate.total(), candidate)
        });
        let found = found.into_iter().map(|(_, candidate)| candidate).collect();
        self.different(found, COARSE_REFINED)
    }

    /// Poses that the best `kept` hypotheses lead to, with their likelihoods, the best first: all of them are
    /// refined by a few steps, and the best go on.
    pub fn refine_best<T: Send>(
        &self,
        few: &PreparedCloud,
        hypotheses: &[Hypothesis],
        kept: usize,
        judge: impl Fn(Isometry3<f64>) -> (f64, T) + Sync,
    ) -> Vec<(f64, T)> {
        let screened = hypotheses.par_iter().map(|hypothesis| {
            let pose = self.refine_steps(few, &hypothesis.target_from_source, SCREENING_STEPS);
            (judge(pose).0, pose)
        });
        let mut screened: Vec<(f64, Isometry3<f64>)> = screened.collect();
        screened.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = screened.par_iter().take(kept);
        let refined = best
            .map(|(_, pose)| judge(self.refine_steps(few, pose, COARSE_STEPS - SCREENING_STEPS)));
        let mut refined: Vec<(f64, T)> = refined.collect();
        refined.sort_by(|a, b| b.0.total_cmp(&a.0));
        refined
    }

    /// The same candidates after some steps with more points, judged by all of them, the best first.
    pub fn fine_refine(&self, first: &[Candidate]) -> Vec<Candidate> {
        let options = RegisterOptions {
            max_iterations: 8,
            source_stride: self.input.full.len().div_ceil(700),
            ..self.baseline()
        };
        let mut found: Vec<Candidate> = first
            .par_iter()
            .map(|candidate| {
                let (full, map) = (&self.input.full, &self.map.cloud);
                let pose = register(full, map, &candidate.target_from_source, &options);
                self.judge(&self.fit, pose.target_from_source, "search")
            })
            .collect();
        found.sort_by(|a, b| b.total().total_cmp(&a.total()));
        found
    }

    /// A few steps of GICP-SE(3) with a few points.
    pub fn refine_steps(
        &self,
        few: &PreparedCloud,
        start: &Isometry3<f64>,
        steps: usize,
    ) -> Isometry3<f64> {
        let options = RegisterOptions {
            gate_m: 8.0 * self.map.spacing_m,
            max_iterations: steps,
            ..self.baseline()
        };
        register(few, &self.map.cloud, start, &options).target_from_source
    }

    /// The first of each place.
    pub fn different(&self, candidates: Vec<Candidate>, most: usize) -> Vec<Candidate> {
        let centroid = self.centroid();
        let mut kept: Vec<Candidate> = Vec::new();
        for candidate in candidates {
            let pose = &candidate.target_from_source;
            let near = |other: &Candidate| other.is_near(pose, &centroid, self.map.spacing_m, 0.02);
            if kept.len() < most && !kept.iter().any(near) {
                kept.push(candidate);
            }
        }
        kept
    }

    /// GICP-SE(3) with all points from a pose: what every candidate ends with.
    pub fn refine_wide_gate(&self, start: &Isometry3<f64>) -> Isometry3<f64> {
        let options = self.baseline();
        register(&self.input.full, &self.map.cloud, start, &options).target_from_source
    }

    /// GICP-SE(3) of another cloud, at last with near partners only.
    pub fn refine_two_stage(
        &self,
        cloud: &PreparedCloud,
        start: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        let refined = register(cloud, &self.map.cloud, start, &self.baseline());
        self.refine_narrow_gate(cloud, &refined.target_from_source)
    }

    /// GICP-SE(3) with near partners only.
    pub fn refine_narrow_gate(
        &self,
        cloud: &PreparedCloud,
        start: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        let options = RegisterOptions {
            gate_m: 4.0 * self.map.spacing_m,
            max_iterations: 24,
            ..self.baseline()
        };
        register(cloud, &self.map.cloud, start, &options).target_from_source
    }

    /// GICP-SE(3) as everything is compared with.
    pub fn baseline(&self) -> RegisterOptions<'static> {
        RegisterOptions {
            gate_m: (20.0 * self.map.spacing_m).clamp(0.5, 3.0),
            inner_iterations: 2,
            rotation_tolerance_rad: 1e-4,
            translation_tolerance_m: 1e-4,
            ..RegisterOptions::gicp_se3()
        }
    }

    /// Candidates from a pose: GICP-SE(3) and Semantic-ICP with what the labels taught so far.
    pub fn refine_with_all_methods(
        &self,
        start: &Isometry3<f64>,
        method: &'static str,
    ) -> Vec<Candidate> {
        let mut all = vec![self.judge(&self.fit, self.refine_wide_gate(start), method)];
        let labelled = self.input.full.is_labelled() && self.map.cloud.is_labelled();
        if labelled {
            let learned = all.first().map(|c| self.known.merged(&c.confusion));
            let lift = learned.unwrap_or_default().lift(self.options.agreement);
            let options = RegisterOptions {
                pair_weight: Some(&lift),
                max_iterations: 15,
                anneal: 1.0,
                ..RegisterOptions::semantic_em(self.baseline().gate_m, LabelUse::Soft)
            };
            let pose = register(&self.input.full, &self.map.cloud, start, &options);
            let refined = self.refine_wide_gate(&pose.target_from_source);
            all.push(self.judge(&self.fit, refined, "semantic"));
        }
        all
    }

    /// Likelihood of a pose.
    pub fn judge(&self, fit: &Fit<'_>, pose: Isometry3<f64>, method: &'static str) -> Candidate {
        let partners: Partners = fit.partners(&pose);
        let (likelihood, confusion) =
            fit.likelihood(&partners, &self.known, self.options.agreement);
        let sensor_m = self.input.sensor_m.as_ref();
        Candidate {
            target_from_source: pose,
            method,
            likelihood,
            blocked: self.blocked(&self.input.few, sensor_m, &pose) * fit.observations(),
            inlier_fraction: partners.inlier_fraction,
            rmse_m: partners.rmse_m,
            confusion,
        }
    }

    /// Log-likelihood of an observation that lines of sight through walls cost; 0 without a place of the sensor.
    pub fn blocked(
        &self,
        cloud: &PreparedCloud,
        sensor_m: Option<&Point3<f64>>,
        pose: &Isometry3<f64>,
    ) -> f64 {
        let clear_m = 5.0 * self.map.spacing_m;
        let occupied = &self.map.occupied;
        sensor_m.map_or(0.0, |sensor_m| {
            BLOCKED_COST * blocked_fraction(occupied, cloud, sensor_m, pose, clear_m)
        })
    }

    /// Log-likelihood that refining a candidate may still win it.
    pub fn pruning_threshold(&self) -> f64 {
        PRUNING_PER_OBSERVATION * self.fit.observations()
    }

    /// Least distance, metres, and turn, radians, between answers that count as different.
    pub fn least_difference(&self) -> (f64, f64) {
        (DIFFERENT_M.max(4.0 * self.map.spacing_m), DIFFERENT_RAD)
    }

    /// The midst of the headset's points, in its frame.
    pub fn centroid(&self) -> Point3<f64> {
        let points = self.input.few.points_m();
        let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
        (sum / points.len().max(1) as f64).into()
    }
}
