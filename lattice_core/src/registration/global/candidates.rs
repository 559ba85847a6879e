//! Candidate poses: refinement and likelihood.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use super::super::confusion::shares;
use super::super::likelihood::{Fit, Likelihood, Partners};
use super::super::search::Hypothesis;
use super::super::{Confusion, LabelUse, PreparedCloud, RegisterOptions, register};
use super::map::CalibrationMap;
use super::rays::blocked_fraction;
use super::request::CalibrationOptions;
use super::source::PreparedSource;

/// Gauss-Newton iterations of the coarse refinement.
pub(super) const COARSE_STEPS: usize = 7;
/// Iterations of it after which only the [`SCREENED`] best continue.
const SCREENING_STEPS: usize = 3;
/// Hypotheses that get all iterations of the coarse refinement.
const SCREENED: usize = 64;
/// Distinct candidates of the coarse refinement that are refined further.
const COARSE_REFINED: usize = 24;
/// Log-likelihood per observation that further refinement may still gain.
const PRUNING_PER_OBSERVATION: f64 = 0.5;
/// Log-likelihood penalty per observation if all lines of sight are blocked.
const BLOCKED_COST: f64 = 2.0;

/// Distance between the centroids from which two poses are different hypotheses, metres.
const DIFFERENT_M: f64 = 0.5;
/// Rotation from which two poses are different hypotheses, radians.
const DIFFERENT_RAD: f64 = 0.26;

/// Pose hypothesis with its likelihood.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub target_from_source: Isometry3<f64>,
    pub method: &'static str,
    pub likelihood: Likelihood,
    /// Log-likelihood penalty of lines of sight through occupied cells.
    pub blocked: f64,
    pub inlier_fraction: f64,
    pub rmse_m: f64,
    pub confusion: Confusion,
}

impl Candidate {
    /// Total log-likelihood, penalty included.
    pub fn total(&self) -> f64 {
        self.likelihood.total() - self.blocked
    }

    /// Tests whether two poses differ by less than `shift_m` at the centroid of the points and by less than
    /// `turn_rad`.
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

/// Prepared clouds, options and likelihood models of one global registration.
pub(super) struct RegistrationContext<'a> {
    pub map: &'a CalibrationMap,
    pub source: &'a PreparedSource,
    pub options: &'a CalibrationOptions,
    /// Label co-occurrence known before this registration.
    pub prior_confusion: Confusion,
    /// Likelihood model of the registered points.
    pub fit: Fit<'a>,
    /// Likelihood model of the coarse points.
    pub coarse_fit: Fit<'a>,
}

impl<'a> RegistrationContext<'a> {
    pub fn new(
        map: &'a CalibrationMap,
        source: &'a PreparedSource,
        options: &'a CalibrationOptions,
        known: Option<&Confusion>,
    ) -> RegistrationContext<'a> {
        let scale = map.scale(options.noise_m);
        let unseen = Confusion::unseen(&shares(&source.coarse), &map.classes);
        RegistrationContext {
            map,
            source,
            options,
            prior_confusion: known.map_or_else(|| unseen.clone(), |known| known.merged(&unseen)),
            fit: Fit::new(&source.full, &map.cloud, scale),
            coarse_fit: Fit::new(&source.coarse, &map.cloud, scale.coarser(2.0)),
        }
    }

    /// Refines search hypotheses with the coarse points.
    ///
    /// Returns distinct candidates, sorted by descending likelihood.
    pub fn coarse_refine(&self, hypotheses: &[Hypothesis]) -> Vec<Candidate> {
        let found = self.refine_best(&self.source.coarse, hypotheses, SCREENED, |pose| {
            let candidate = self.evaluate(&self.coarse_fit, pose, "search");
            (candidate.total(), candidate)
        });
        let found = found.into_iter().map(|(_, candidate)| candidate).collect();
        self.distinct(found, COARSE_REFINED)
    }

    /// Refines all hypotheses by a few iterations and the best `kept` of these further.
    ///
    /// Returns the poses with their log-likelihoods, sorted in descending order.
    pub fn refine_best<T: Send>(
        &self,
        coarse: &PreparedCloud,
        hypotheses: &[Hypothesis],
        kept: usize,
        evaluate: impl Fn(Isometry3<f64>) -> (f64, T) + Sync,
    ) -> Vec<(f64, T)> {
        let screened = hypotheses.par_iter().map(|hypothesis| {
            let pose = self.refine_steps(coarse, &hypothesis.target_from_source, SCREENING_STEPS);
            (evaluate(pose).0, pose)
        });
        let mut screened: Vec<(f64, Isometry3<f64>)> = screened.collect();
        screened.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = screened.par_iter().take(kept);
        let refined = best.map(|(_, pose)| {
            evaluate(self.refine_steps(coarse, pose, COARSE_STEPS - SCREENING_STEPS))
        });
        let mut refined: Vec<(f64, T)> = refined.collect();
        refined.sort_by(|a, b| b.0.total_cmp(&a.0));
        refined
    }

    /// Refines candidates with a subset of the full points and evaluates them with all of them.
    ///
    /// Returns them sorted by descending likelihood.
    pub fn fine_refine(&self, first: &[Candidate]) -> Vec<Candidate> {
        let options = RegisterOptions {
            max_iterations: 8,
            source_stride: self.source.full.len().div_ceil(700),
            ..self.baseline()
        };
        let mut found: Vec<Candidate> = first
            .par_iter()
            .map(|candidate| {
                let (full, map) = (&self.source.full, &self.map.cloud);
                let pose = register(full, map, &candidate.target_from_source, &options);
                self.evaluate(&self.fit, pose.target_from_source, "search")
            })
            .collect();
        found.sort_by(|a, b| b.total().total_cmp(&a.total()));
        found
    }

    /// Runs `steps` iterations of GICP-SE(3) with the coarse points.
    pub fn refine_steps(
        &self,
        coarse: &PreparedCloud,
        start: &Isometry3<f64>,
        steps: usize,
    ) -> Isometry3<f64> {
        let options = RegisterOptions {
            gate_m: 8.0 * self.map.spacing_m,
            max_iterations: steps,
            ..self.baseline()
        };
        register(coarse, &self.map.cloud, start, &options).target_from_source
    }

    /// Removes candidates that repeat the pose of an earlier one, and keeps at most `most`.
    pub fn distinct(&self, candidates: Vec<Candidate>, most: usize) -> Vec<Candidate> {
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

    /// Refines a pose by GICP-SE(3) with all points and the wide gate.
    pub fn refine_wide_gate(&self, start: &Isometry3<f64>) -> Isometry3<f64> {
        let options = self.baseline();
        register(&self.source.full, &self.map.cloud, start, &options).target_from_source
    }

    /// Refines the pose of a cloud by GICP-SE(3) with the wide gate, then with the narrow gate.
    pub fn refine_two_stage(
        &self,
        cloud: &PreparedCloud,
        start: &Isometry3<f64>,
    ) -> Isometry3<f64> {
        let refined = register(cloud, &self.map.cloud, start, &self.baseline());
        self.refine_narrow_gate(cloud, &refined.target_from_source)
    }

    /// Refines the pose of a cloud by GICP-SE(3) with a narrow gate.
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

    /// Options of GICP-SE(3) with the wide gate.
    pub fn baseline(&self) -> RegisterOptions<'static> {
        RegisterOptions {
            gate_m: (20.0 * self.map.spacing_m).clamp(0.5, 3.0),
            inner_iterations: 2,
            rotation_tolerance_rad: 1e-4,
            translation_tolerance_m: 1e-4,
            ..RegisterOptions::gicp_se3()
        }
    }

    /// Refines a pose by GICP-SE(3) and, for labelled clouds, by Semantic-ICP with the label lift learned so far.
    pub fn refine_with_all_methods(
        &self,
        start: &Isometry3<f64>,
        method: &'static str,
    ) -> Vec<Candidate> {
        let mut all = vec![self.evaluate(&self.fit, self.refine_wide_gate(start), method)];
        let labelled = self.source.full.is_labelled() && self.map.cloud.is_labelled();
        if labelled {
            let learned = all
                .first()
                .map(|c| self.prior_confusion.merged(&c.confusion));
            let lift = learned.unwrap_or_default().lift(self.options.agreement);
            let options = RegisterOptions {
                pair_weight: Some(&lift),
                max_iterations: 15,
                anneal: 1.0,
                ..RegisterOptions::semantic_em(self.baseline().gate_m, LabelUse::Soft)
            };
            let pose = register(&self.source.full, &self.map.cloud, start, &options);
            let refined = self.refine_wide_gate(&pose.target_from_source);
            all.push(self.evaluate(&self.fit, refined, "semantic"));
        }
        all
    }

    /// Evaluates the likelihood of a pose.
    pub fn evaluate(&self, fit: &Fit<'_>, pose: Isometry3<f64>, method: &'static str) -> Candidate {
        let partners: Partners = fit.partners(&pose);
        let (likelihood, confusion) =
            fit.likelihood(&partners, &self.prior_confusion, self.options.agreement);
        let sensor_m = self.source.sensor_m.as_ref();
        Candidate {
            target_from_source: pose,
            method,
            likelihood,
            blocked: self.blocked(&self.source.coarse, sensor_m, &pose) * fit.observations(),
            inlier_fraction: partners.inlier_fraction,
            rmse_m: partners.rmse_m,
            confusion,
        }
    }

    /// Log-likelihood penalty per observation for lines of sight through occupied cells; 0 if the sensor position is
    /// unknown.
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

    /// Log-likelihood that a candidate may be behind the best one and still be refined.
    pub fn pruning_threshold(&self) -> f64 {
        PRUNING_PER_OBSERVATION * self.fit.observations()
    }

    /// Minimum distance (metres) and rotation (radians) between different hypotheses.
    pub fn min_separation(&self) -> (f64, f64) {
        (DIFFERENT_M.max(4.0 * self.map.spacing_m), DIFFERENT_RAD)
    }

    /// Centroid of the source points, in the source frame.
    pub fn centroid(&self) -> Point3<f64> {
        let points = self.source.coarse.points_m();
        let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
        (sum / points.len().max(1) as f64).into()
    }
}

/// Candidate with the largest total log-likelihood; the first of equal ones.
pub(super) fn most_likely(all: &[Candidate]) -> Option<&Candidate> {
    all.iter()
        .reduce(|a, b| if b.total() > a.total() { b } else { a })
}
