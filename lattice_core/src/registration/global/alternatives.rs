//! Alternative hypotheses: competing poses, refined like the most likely one before its margin is computed.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::super::search::{Region, SearchSource, angle_between, search, yaw_of};
use super::candidates::most_likely;
use super::candidates::{COARSE_STEPS, Candidate, RegistrationContext};

/// Number of alternatives among the candidates that are refined like the most likely one.
const REFINED_ALTERNATIVES: usize = 4;
/// Rotations about the vertical under which rooms are often symmetric.
const SYMMETRY_TURNS_RAD: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    std::f64::consts::PI,
    -std::f64::consts::FRAC_PI_2,
];
/// Half width of the yaw interval searched around each symmetry rotation, radians.
const SYMMETRY_YAW_RAD: f64 = 0.06;
/// Number of search hypotheses refined for each symmetry rotation.
const SYMMETRY_PLACES: usize = 6;
/// Search radius larger than any map, metres.
const UNBOUNDED_M: f64 = 1e6;
/// Log-likelihood per observation that refinement gains at most: an alternative further behind cannot win.
const COMPETITIVE_PER_OBSERVATION: f64 = 1.0;

impl RegistrationContext<'_> {
    /// Refines the most likely candidate, its best alternatives and its symmetric poses alike.
    ///
    /// A narrow gate excludes surfaces that only one cloud contains. Poses above the pruning threshold are then
    /// optimized along their weak directions; the others are dropped. Likelihoods are comparable only after the same
    /// refinement.
    pub fn search_alternatives(
        &self,
        all: &[Candidate],
        region: Option<&Region>,
    ) -> Vec<Candidate> {
        let Some(best) = most_likely(all) else {
            return Vec::new();
        };
        let mut places = vec![(best.target_from_source, best.method)];
        let known = self
            .alternatives(all, best, REFINED_ALTERNATIVES)
            .into_iter();
        let known = known.filter(|alternative| self.is_competitive(alternative, best));
        places
            .extend(known.map(|alternative| (alternative.target_from_source, alternative.method)));
        let symmetric_poses = self.symmetric_poses(best, region);
        places.extend(symmetric_poses.into_iter().map(|pose| (pose, "search")));
        let refined = places.par_iter().map(|(pose, method)| {
            let pose = self.refine_narrow_gate(&self.source.full, pose);
            self.evaluate(&self.fit, pose, method)
        });
        let refined: Vec<Candidate> = refined.collect();
        let least = most_likely(&refined).map_or(0.0, Candidate::total) - self.pruning_threshold();
        let kept = refined.into_par_iter().filter(|c| c.total() > least);
        kept.map(|candidate| self.optimize_weak_directions(candidate))
            .collect()
    }

    /// Selects up to `most` distinct candidates other than `best`, sorted by descending likelihood.
    pub fn alternatives<'a>(
        &self,
        all: &'a [Candidate],
        best: &'a Candidate,
        most: usize,
    ) -> Vec<&'a Candidate> {
        let centroid = self.centroid();
        let (shift_m, turn_rad) = self.min_separation();
        let mut sorted: Vec<&Candidate> = all.iter().collect();
        sorted.sort_by(|a, b| b.total().total_cmp(&a.total()));
        let mut kept = vec![best];
        for candidate in sorted {
            let near = |other: &&Candidate| {
                other.is_near(&candidate.target_from_source, &centroid, shift_m, turn_rad)
            };
            if kept.len() <= most && !kept.iter().any(near) {
                kept.push(candidate);
            }
        }
        kept.split_off(1)
    }

    /// Tests whether refinement could make an alternative more likely than `best`.
    pub fn is_competitive(&self, alternative: &Candidate, best: &Candidate) -> bool {
        alternative.total() > best.total() - COMPETITIVE_PER_OBSERVATION * self.fit.observations()
    }

    /// Finds the best pose for each symmetry rotation of the room.
    fn symmetric_poses(&self, best: &Candidate, region: Option<&Region>) -> Vec<Isometry3<f64>> {
        let source = SearchSource::by_surface(&self.source.coarse, self.source.sensor_m);
        let best_of_coarse = self.evaluate(&self.coarse_fit, best.target_from_source, best.method);
        let least =
            best_of_coarse.total() - COMPETITIVE_PER_OBSERVATION * self.coarse_fit.observations();
        let best_at = |turn_rad: &f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *turn_rad);
            let about = Isometry3::from_parts(
                region.map_or_else(Translation3::identity, |region| region.about.translation),
                turn * best.target_from_source.rotation,
            );
            let around = Region {
                about,
                radius_m: region.map_or(UNBOUNDED_M, |region| region.radius_m),
                yaw_rad: SYMMETRY_YAW_RAD,
            };
            let is_in_region = region.is_none_or(|region| {
                angle_between(yaw_of(&about), yaw_of(&region.about)) <= region.yaw_rad
            });
            let found = match is_in_region {
                true => search(&self.map.surfaces, &source, Some(&around), SYMMETRY_PLACES),
                false => Vec::new(),
            };
            let evaluated = found.par_iter().map(|hypothesis| {
                let pose = self.refine_steps(
                    &self.source.coarse,
                    &hypothesis.target_from_source,
                    COARSE_STEPS,
                );
                self.evaluate(&self.coarse_fit, pose, "search")
            });
            most_likely(&evaluated.collect::<Vec<_>>())
                .filter(|pose| pose.total() > least)
                .map(|pose| self.refine_wide_gate(&pose.target_from_source))
        };
        SYMMETRY_TURNS_RAD.par_iter().filter_map(best_at).collect()
    }
}
