//! Alternative axis and unit conventions, tested to detect misdeclared input.

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::super::likelihood::Fit;
use super::super::search::Region;
use super::axis_hypothesis::AxisHypothesis;
use super::candidates::{Candidate, RegistrationContext};
use super::reinterpreted_cloud::ReinterpretedCloud;

/// Search hypotheses per axis convention: all, and the best ones that get all iterations of the coarse refinement.
const MISREAD_PLACES: (usize, usize) = (48, 16);
/// The same under another scale; more, because a scaled cloud nearly fits many poses.
const SCALED_PLACES: (usize, usize) = (128, 64);
/// Axis hypotheses evaluated with the coarse points: the correct one and its mirror image lead a rough search.
const EVALUATED_AXES: usize = 2;
/// Hypotheses evaluated with all points if the declared convention is in doubt.
const EVALUATED_IN_DOUBT: usize = 4;
/// Tested scales; a scale nearer to 1 is estimated with the pose.
const SCALES: [f64; 4] = [0.8, 0.9, 1.11, 1.25];
/// Lead in the rough score from which a scale is evaluated; a wrong scale is behind except in views of bare walls.
const MIN_SCALE_LEAD: f64 = 0.02;
/// Log-likelihood ratio above which another convention is accepted.
const ACCEPTED_LEAD: f64 = 40.0;
/// Log-likelihood deficit above which another convention is ruled out.
const RULED_OUT_LAG: f64 = 4.0;
/// Lag in the rough score at which a correct hypothesis is still evaluated.
const MAX_ROUGH_LAG: f64 = 0.03;

/// Most likely alternative convention.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct BestHypothesis {
    pub hypothesis: AxisHypothesis,
    /// Log-likelihood ratio to the declared convention; from all points if it is plausible by the coarse points.
    pub lead: f64,
    /// True if the convention is accepted.
    pub is_accepted: bool,
}

impl BestHypothesis {
    /// Compares the log-likelihood of a hypothesis with that of the declared convention.
    fn new(
        hypothesis: AxisHypothesis,
        likelihood: f64,
        declared: f64,
        observations: f64,
    ) -> BestHypothesis {
        let lead = likelihood - declared;
        let is_clear = lead > ACCEPTED_LEAD.max(0.25 * observations);
        BestHypothesis {
            hypothesis,
            lead,
            is_accepted: is_clear && likelihood > 0.5 * observations,
        }
    }

    /// Tests whether the likelihood ratio leaves the hypothesis possible given the prior.
    pub fn is_plausible(&self) -> bool {
        self.is_accepted || self.lead > -RULED_OUT_LAG
    }

    /// Repeats the comparison with all points, from the poses found with the coarse points.
    ///
    /// The hypothesis is plausible with or without the line-of-sight penalty: some lines are blocked at correct poses
    /// too.
    fn evaluated_with_all_points(
        self,
        context: &RegistrationContext<'_>,
        poses: &[Isometry3<f64>],
        refined: Refined,
    ) -> Option<BestHypothesis> {
        let reinterpreted =
            ReinterpretedCloud::new(context, &context.source.full, &self.hypothesis)?;
        let scale = context.map.scale(context.options.noise_m);
        let fit = Fit::new(&reinterpreted.cloud, &context.map.cloud, scale);
        let observations = context.fit.observations();
        let share = observations / fit.observations().max(1.0);
        let density = observations * self.hypothesis.scale().ln();
        let likelihoods = poses.par_iter().map(|pose| {
            let pose = context.refine_two_stage(&reinterpreted.cloud, pose);
            let likelihood = share * reinterpreted.likelihood_at(context, &fit, &pose) + density;
            let blocked =
                context.blocked(&reinterpreted.cloud, reinterpreted.sensor_m.as_ref(), &pose);
            Refined {
                likelihood,
                total: likelihood - blocked * observations,
            }
        });
        let best = likelihoods.reduce(|| Refined::NONE, Refined::max);
        let other = BestHypothesis::new(self.hypothesis, best.total, refined.total, observations);
        Some(BestHypothesis {
            lead: other.lead.max(best.likelihood - refined.likelihood),
            ..other
        })
    }
}

/// Largest log-likelihoods among refined poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refined {
    /// Without the line-of-sight penalty.
    likelihood: f64,
    /// With the line-of-sight penalty.
    total: f64,
}

impl Refined {
    const NONE: Refined = Refined {
        likelihood: f64::NEG_INFINITY,
        total: f64::NEG_INFINITY,
    };

    /// Maxima over candidates.
    pub fn of(candidates: &[Candidate]) -> Refined {
        let each = candidates.iter().map(|c| Refined {
            likelihood: c.likelihood.total(),
            total: c.total(),
        });
        each.fold(Refined::NONE, Refined::max)
    }

    fn max(self, other: Refined) -> Refined {
        Refined {
            likelihood: self.likelihood.max(other.likelihood),
            total: self.total.max(other.total),
        }
    }
}

/// Finds the most likely alternative convention.
///
/// A rough search excludes unlikely conventions. All are evaluated if none of the others is accepted and the declared
/// convention is in doubt. `coarse` are the coarsely refined candidates of the declared convention, `refined` the
/// log-likelihoods after its last refinement.
pub(super) fn best_axis_hypothesis(
    context: &RegistrationContext<'_>,
    coarse: &[Candidate],
    refined: Refined,
    in_doubt: bool,
    region: Option<&Region>,
) -> Option<BestHypothesis> {
    let declared = ReinterpretedCloud::new(
        context,
        &context.source.coarse,
        &AxisHypothesis::scaled(1.0),
    )?;
    let rough = declared.rough_score(context, region);
    let (axes, scales) = axis_hypotheses(context, region);
    let (mut likely, mut rest) =
        split_by_rough_score(context, axes, rough - MAX_ROUGH_LAG, EVALUATED_AXES);
    let (scales, other_scales) = split_by_rough_score(context, scales, rough + MIN_SCALE_LEAD, 1);
    likely.extend(scales);
    rest.extend(other_scales);
    let declared = coarse.iter().map(|c| c.likelihood.total());
    let declared = declared.fold(0.0, f64::max);
    let by_coarse_points = |found: &ScoredHypothesis| {
        BestHypothesis::new(
            found.hypothesis,
            found.likelihood,
            declared,
            context.coarse_fit.observations(),
        )
    };
    let by_all_points = |found: &ScoredHypothesis| {
        let other = by_coarse_points(found);
        other
            .evaluated_with_all_points(context, &found.poses, refined)
            .unwrap_or(other)
    };
    let mut found = evaluate(context, &likely);
    let first = found
        .iter()
        .max_by(|a, b| a.likelihood.total_cmp(&b.likelihood));
    let best = first.map(|first| match by_coarse_points(first).is_plausible() {
        true => by_all_points(first),
        false => by_coarse_points(first),
    });
    if !in_doubt || best.is_some_and(|other| other.is_accepted) {
        return best;
    }
    found.extend(evaluate(context, &rest));
    found.sort_by(|a, b| b.likelihood.total_cmp(&a.likelihood));
    let others = found.iter().take(EVALUATED_IN_DOUBT).map(by_all_points);
    others.max_by(|a, b| a.lead.total_cmp(&b.lead))
}

/// Hypothesis with its log-likelihood by the coarse points and its best poses.
struct ScoredHypothesis {
    hypothesis: AxisHypothesis,
    likelihood: f64,
    poses: Vec<Isometry3<f64>>,
}

/// Evaluates hypotheses with the coarse points.
fn evaluate(
    context: &RegistrationContext<'_>,
    hypotheses: &[RankedHypothesis<'_>],
) -> Vec<ScoredHypothesis> {
    let found = hypotheses
        .par_iter()
        .filter_map(|(hypothesis, region, reinterpreted)| {
            let places = match hypothesis.is_scaled() {
                true => SCALED_PLACES,
                false => MISREAD_PLACES,
            };
            // Change of variables: scaling lengths divides their density by the factor.
            let density = context.coarse_fit.observations() * hypothesis.scale().ln();
            let (likelihood, poses) = reinterpreted.likelihood(context, *region, places)?;
            Some(ScoredHypothesis {
                hypothesis: *hypothesis,
                likelihood: likelihood + density,
                poses,
            })
        });
    found.collect()
}

/// Lists the tested axis conventions and scales, each with its search region.
fn axis_hypotheses<'a>(
    context: &RegistrationContext<'_>,
    region: Option<&'a Region>,
) -> (Vec<HypothesisInRegion<'a>>, Vec<HypothesisInRegion<'a>>) {
    // Only sensors with a known vertical, as headsets, are often misdeclared.
    let mut axes = vec![(AxisHypothesis::MIRRORED, region)];
    if context.options.gravity_sigma_rad.is_finite() {
        let with_other_up_axes = AxisHypothesis::with_other_up_axes().into_iter();
        axes.extend(with_other_up_axes.map(|hypothesis| (hypothesis, None)));
    }
    // The scale of a laser scanner is known.
    let scales = match context.options.scale_sigma > 0.0 {
        true => SCALES
            .map(|by| (AxisHypothesis::scaled(by), region))
            .to_vec(),
        false => Vec::new(),
    };
    (axes, scales)
}

type HypothesisInRegion<'a> = (AxisHypothesis, Option<&'a Region>);
type RankedHypothesis<'a> = (AxisHypothesis, Option<&'a Region>, ReinterpretedCloud);

/// Splits hypotheses by their rough scores: the best `most` of at least `least`, and the rest.
fn split_by_rough_score<'a>(
    context: &RegistrationContext<'_>,
    hypotheses: Vec<HypothesisInRegion<'a>>,
    least: f64,
    most: usize,
) -> (Vec<RankedHypothesis<'a>>, Vec<RankedHypothesis<'a>>) {
    let scored = hypotheses
        .into_par_iter()
        .filter_map(|(hypothesis, region)| {
            let reinterpreted =
                ReinterpretedCloud::new(context, &context.source.coarse, &hypothesis)?;
            let score = reinterpreted.rough_score(context, region);
            Some((score, (hypothesis, region, reinterpreted)))
        });
    let mut scored: Vec<(f64, RankedHypothesis<'a>)> = scored.collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let likely = scored
        .partition_point(|(score, _)| *score >= least)
        .min(most);
    let mut ranked: Vec<_> = scored.into_iter().map(|(_, one)| one).collect();
    let rest = ranked.split_off(likely);
    (ranked, rest)
}
