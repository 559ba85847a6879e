//! Rivals of the likeliest pose: other places that deserve the same care before one is called certain.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::super::search::{Region, SearchSource, angle_between, search, yaw_of};
use super::candidates::{COARSE_STEPS, Candidate, RegistrationContext};
use super::likeliest;

/// Rivals from among the candidates that are refined like the likeliest.
const KNOWN: usize = 4;
/// Turns about the vertical under which rooms are often symmetric.
const TWINS_RAD: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    std::f64::consts::PI,
    -std::f64::consts::FRAC_PI_2,
];
/// Deviation from such a turn that is searched, and places of each that are looked at.
const TWIN_YAW_RAD: f64 = 0.06;
const TWIN_PLACES: usize = 6;
/// Farther than any map reaches.
const ANYWHERE_M: f64 = 1e6;
/// Log-likelihood of an observation by which a rival is beyond reach: refining it wins less.
const BEYOND: f64 = 1.0;

impl RegistrationContext<'_> {
    /// The likeliest candidate, its best rivals, and its twins in a symmetric room, all refined with near
    /// partners only, which leaves out what one of the clouds has not seen, and moved along what surfaces leave weak.
    ///
    /// A likelihood is compared fairly only if all were refined alike.
    pub fn contest(&self, all: &[Candidate], region: Option<&Region>) -> Vec<Candidate> {
        let Some(best) = likeliest(all) else {
            return Vec::new();
        };
        let mut places = vec![(best.target_from_source, best.method)];
        let known = self.rivals(all, best, KNOWN).into_iter();
        let known = known.filter(|rival| self.is_within_reach(rival, best));
        places.extend(known.map(|rival| (rival.target_from_source, rival.method)));
        let twins = self.twins(best, region);
        places.extend(twins.into_iter().map(|pose| (pose, "search")));
        let refined = places.par_iter().map(|(pose, method)| {
            let tight = self.refine_narrow_gate(&self.input.full, pose);
            self.judge(&self.fit, tight, method)
        });
        let refined: Vec<Candidate> = refined.collect();
        let least = likeliest(&refined).map_or(0.0, Candidate::total) - self.pruning_threshold();
        let kept = refined.into_par_iter().filter(|c| c.total() > least);
        kept.map(|candidate| self.climbed(candidate)).collect()
    }

    /// The likeliest candidates elsewhere, at most so many, one of each place, the likeliest first.
    pub fn rivals<'a>(
        &self,
        all: &'a [Candidate],
        best: &'a Candidate,
        most: usize,
    ) -> Vec<&'a Candidate> {
        let middle = self.middle();
        let (shift_m, turn_rad) = self.least_difference();
        let mut sorted: Vec<&Candidate> = all.iter().collect();
        sorted.sort_by(|a, b| b.total().total_cmp(&a.total()));
        let mut kept = vec![best];
        for candidate in sorted {
            let near = |other: &&Candidate| {
                other.is_near(&candidate.target_from_source, &middle, shift_m, turn_rad)
            };
            if kept.len() <= most && !kept.iter().any(near) {
                kept.push(candidate);
            }
        }
        kept.split_off(1)
    }

    /// True if refining a rival may win what it is behind.
    pub fn is_within_reach(&self, rival: &Candidate, best: &Candidate) -> bool {
        rival.total() > best.total() - BEYOND * self.fit.observations()
    }

    /// The place that fits best with each heading of a symmetric room.
    fn twins(&self, best: &Candidate, region: Option<&Region>) -> Vec<Isometry3<f64>> {
        let source = SearchSource::by_surface(&self.input.few, self.input.sensor_m);
        let best_of_few = self.judge(&self.few, best.target_from_source, best.method);
        let least = best_of_few.total() - BEYOND * self.few.observations();
        let twin = |turn_rad: &f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *turn_rad);
            let about = Isometry3::from_parts(
                region.map_or_else(Translation3::identity, |region| region.about.translation),
                turn * best.target_from_source.rotation,
            );
            let around = Region {
                about,
                radius_m: region.map_or(ANYWHERE_M, |region| region.radius_m),
                yaw_rad: TWIN_YAW_RAD,
            };
            let wanted = region.is_none_or(|region| {
                angle_between(yaw_of(&about), yaw_of(&region.about)) <= region.yaw_rad
            });
            let found = match wanted {
                true => search(&self.map.surfaces, &source, Some(&around), TWIN_PLACES),
                false => Vec::new(),
            };
            let looked_at = found.par_iter().map(|hypothesis| {
                let pose = self.refine_steps(
                    &self.input.few,
                    &hypothesis.target_from_source,
                    COARSE_STEPS,
                );
                self.judge(&self.few, pose, "search")
            });
            likeliest(&looked_at.collect::<Vec<_>>())
                .filter(|twin| twin.total() > least)
                .map(|twin| self.refine_wide_gate(&twin.target_from_source))
        };
        TWINS_RAD.par_iter().filter_map(twin).collect()
    }
}
