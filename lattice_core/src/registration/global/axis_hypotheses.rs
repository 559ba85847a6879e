//! Readings of a cloud's axes and unit: those under which it would fit tell how it was misread.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::super::likelihood::Fit;
use super::super::search::{Region, SearchSource, search};
use super::super::{PrepareOptions, PreparedCloud, SemanticCloud};
use super::candidates::{Candidate, RegistrationContext};
use crate::pose::Axes;

/// Hypotheses of a search with other axes, and those of them that get all steps of a first look.
const MISREAD_PLACES: (usize, usize) = (48, 16);
/// The same with another scale: what is of it fits many places nearly.
const SCALED_PLACES: (usize, usize) = (128, 64);
/// Hypotheses of a rough search.
const ROUGH_PLACES: usize = 4;
/// Readings that are looked at: the right one and its mirror image lead a rough search.
const LOOKED_AT: usize = 2;
/// The best hypotheses that are looked at closely where the cloud as it is is in doubt.
const DOUBTED: usize = 4;
/// Poses of a hypothesis that are looked at with all points.
const CLOSELY: usize = 4;
/// Scales that a cloud may have instead of 1; what is nearer to 1 is estimated with the pose.
const SCALES: [f64; 4] = [0.8, 0.9, 1.11, 1.25];
/// Score by which a scale must be ahead in a rough search to be looked at closely: a scale that is wrong is behind
/// in all but bare views.
const SCALED_AHEAD: f64 = 0.02;
/// Log-likelihood by which a hypothesis is certainly better.
const MARGIN: f64 = 40.0;
/// Log-likelihood by which a hypothesis must be behind to be out of the question: where one cloud in fifty is misread,
/// that is a probability of one in a hundred.
const NOT_BEHIND: f64 = 4.0;
/// Score by which a right hypothesis may fall behind a wrong one in it.
const ROUGH: f64 = 0.03;

/// Axes or unit that a cloud may have instead of forward, left, up in metres.
///
/// Turns about the vertical are searched anyway, so the axis that points up and the handedness tell all.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct AxisHypothesis {
    /// The matrix that mends the points.
    matrix: Matrix3<f64>,
}

impl AxisHypothesis {
    /// One axis has the wrong sign.
    const MIRRORED: AxisHypothesis = AxisHypothesis {
        matrix: Matrix3::new(1., 0., 0., 0., -1., 0., 0., 0., 1.),
    };

    /// All that turn the vertical, of both hands.
    fn on_their_side() -> Vec<AxisHypothesis> {
        let signed = |i: usize| [1.0, -1.0].map(|sign| (i, sign));
        let up = (0..3).flat_map(signed).filter(|up| *up != (2, 1.0));
        let hands = |(i, sign): (usize, f64)| {
            [1.0, -1.0].map(|hand| {
                let unit = |i: usize| Vector3::ith(i % 3, 1.0);
                let (up, forward) = (sign * unit(i), unit(i + 1));
                let left = hand * up.cross(&forward);
                let matrix = Matrix3::from_columns(&[forward, left, up]).transpose();
                AxisHypothesis { matrix }
            })
        };
        up.flat_map(hands).collect()
    }

    /// Lengths are to be multiplied by a factor.
    fn scaled(by: f64) -> AxisHypothesis {
        AxisHypothesis {
            matrix: Matrix3::identity() * by,
        }
    }

    /// Factor on lengths.
    pub fn scale(&self) -> f64 {
        self.matrix.determinant().abs().cbrt()
    }

    /// True if it changes lengths.
    pub fn is_scaled(&self) -> bool {
        (self.scale() - 1.0).abs() > 1e-6
    }

    /// True if two differ by a turn about the vertical only.
    fn is_like(&self, matrix: &Matrix3<f64>) -> bool {
        let same_up = self.matrix.row(2) == matrix.row(2);
        same_up && self.matrix.determinant() * matrix.determinant() > 0.0
    }

    /// The hypothesis in words, for a cloud that was read as one of `axes`.
    pub fn reason(&self, axes: Axes) -> String {
        if self.is_scaled() {
            return format!(
                "fits with its points multiplied by about {:.2}: it is of another scale, check its unit",
                self.scale()
            );
        }
        let back = axes.matrix().transpose();
        let mut all = Axes::ALL.into_iter();
        if let Some(right) = all.clone().find(|a| self.is_like(&(a.matrix() * back))) {
            return match right {
                Axes::RosFlu => "fits as ros_flu: the cloud was converted twice".to_owned(),
                _ => format!("fits as {right}, not as {axes}: name its axes"),
            };
        }
        if axes == Axes::RosFlu
            && let Some(twice) = all.find(|a| self.is_like(&a.matrix().transpose()))
        {
            return format!(
                "fits with a conversion from {twice} undone: the cloud was converted twice"
            );
        }
        let mirrored = match self.matrix.determinant() < 0.0 {
            true => "mirrored",
            false => "turned",
        };
        let up = self.matrix.row(2);
        let name = ["x", "y", "z"].into_iter().zip(up.iter());
        let up = name.fold(String::new(), |text, (name, c)| match *c {
            c if c > 0.0 => name.to_owned(),
            c if c < 0.0 => format!("-{name}"),
            _ => text,
        });
        format!("fits only {mirrored}, with its {up} axis up: check its axes")
    }
}

/// Another hypothesis of a cloud, the best of those that were looked at closely.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct BestHypothesis {
    pub hypothesis: AxisHypothesis,
    /// Log-likelihood by which it is ahead of the cloud as it is: of few points, or of all if it is possible by these.
    pub ahead: f64,
    /// True if it is beyond doubt.
    pub is_certain: bool,
}

impl BestHypothesis {
    /// A hypothesis with a likelihood, beside that of the cloud as it is.
    fn new(
        hypothesis: AxisHypothesis,
        likelihood: f64,
        as_it_is: f64,
        observations: f64,
    ) -> BestHypothesis {
        let ahead = likelihood - as_it_is;
        let is_clear = ahead > MARGIN.max(0.25 * observations);
        BestHypothesis {
            hypothesis,
            ahead,
            is_certain: is_clear && likelihood > 0.5 * observations,
        }
    }

    /// True if it fits about as well as the cloud as it is, so that the odds beforehand do not rule it out.
    pub fn is_possible(&self) -> bool {
        self.is_certain || self.ahead > -NOT_BEHIND
    }

    /// The same by all points, from the poses that the few led to, beside the cloud as it is after its last refinement.
    ///
    /// It is possible if it is so with lines of sight or without: a few of them are blocked at right poses too.
    fn looked_at_closely(
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
        let best = likelihoods.reduce(|| Refined::NOWHERE, Refined::max);
        let other = BestHypothesis::new(self.hypothesis, best.total, refined.total, observations);
        Some(BestHypothesis {
            ahead: other.ahead.max(best.likelihood - refined.likelihood),
            ..other
        })
    }
}

/// Best log-likelihoods of refined poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refined {
    /// Without lines of sight.
    likelihood: f64,
    /// With them.
    total: f64,
}

impl Refined {
    const NOWHERE: Refined = Refined {
        likelihood: f64::NEG_INFINITY,
        total: f64::NEG_INFINITY,
    };

    /// The best of candidates.
    pub fn of(candidates: &[Candidate]) -> Refined {
        let each = candidates.iter().map(|c| Refined {
            likelihood: c.likelihood.total(),
            total: c.total(),
        });
        each.fold(Refined::NOWHERE, Refined::max)
    }

    fn max(self, other: Refined) -> Refined {
        Refined {
            likelihood: self.likelihood.max(other.likelihood),
            total: self.total.max(other.total),
        }
    }
}

/// The best other hypothesis of a cloud, after a first look, given what the cloud as it is has after its last refinement.
///
/// A rough search leaves out those that cannot be it; if none of the rest is certain and the cloud is in doubt, all are
/// looked at.
pub(super) fn best_axis_hypothesis(
    context: &RegistrationContext<'_>,
    straight: &[Candidate],
    refined: Refined,
    in_doubt: bool,
    region: Option<&Region>,
) -> Option<BestHypothesis> {
    let as_it_is = ReinterpretedCloud::new(
        context,
        &context.source.coarse,
        &AxisHypothesis::scaled(1.0),
    )?;
    let rough = as_it_is.rough_score(context, region);
    let (axes, scales) = axis_hypotheses(context, region);
    let (mut likely, mut rest) = scored(context, axes, rough - ROUGH, LOOKED_AT);
    let (scales, other_scales) = scored(context, scales, rough + SCALED_AHEAD, 1);
    likely.extend(scales);
    rest.extend(other_scales);
    let straight = straight.iter().map(|c| c.likelihood.total());
    let straight = straight.fold(0.0, f64::max);
    let by_few = |found: &Found| {
        BestHypothesis::new(
            found.hypothesis,
            found.likelihood,
            straight,
            context.coarse_fit.observations(),
        )
    };
    let closely = |found: &Found| {
        let other = by_few(found);
        other
            .looked_at_closely(context, &found.poses, refined)
            .unwrap_or(other)
    };
    let mut found = look_at(context, &likely);
    let first = found
        .iter()
        .max_by(|a, b| a.likelihood.total_cmp(&b.likelihood));
    let best = first.map(|first| match by_few(first).is_possible() {
        true => closely(first),
        false => by_few(first),
    });
    if !in_doubt || best.is_some_and(|other| other.is_certain) {
        return best;
    }
    found.extend(look_at(context, &rest));
    found.sort_by(|a, b| b.likelihood.total_cmp(&a.likelihood));
    let others = found.iter().take(DOUBTED).map(closely);
    others.max_by(|a, b| a.ahead.total_cmp(&b.ahead))
}

/// A hypothesis after a first look: its likelihood by a few points, and its best poses.
struct Found {
    hypothesis: AxisHypothesis,
    likelihood: f64,
    poses: Vec<Isometry3<f64>>,
}

/// Looks at hypotheses by a few points.
fn look_at(context: &RegistrationContext<'_>, hypotheses: &[Hopeful<'_>]) -> Vec<Found> {
    let found = hypotheses
        .par_iter()
        .filter_map(|(hypothesis, region, reinterpreted)| {
            let places = match hypothesis.is_scaled() {
                true => SCALED_PLACES,
                false => MISREAD_PLACES,
            };
            // A density of lengths that are to be multiplied is one over them.
            let density = context.coarse_fit.observations() * hypothesis.scale().ln();
            let (likelihood, poses) = reinterpreted.likelihood(context, *region, places)?;
            Some(Found {
                hypothesis: *hypothesis,
                likelihood: likelihood + density,
                poses,
            })
        });
    found.collect()
}

/// Readings of axes that a cloud may have, and of scales, each with where it is searched.
fn axis_hypotheses<'a>(
    context: &RegistrationContext<'_>,
    region: Option<&'a Region>,
) -> (Vec<Asked<'a>>, Vec<Asked<'a>>) {
    // A cloud that may lean is not of a headset, whose axes are often mistaken.
    let mut axes = vec![(AxisHypothesis::MIRRORED, region)];
    if context.options.gravity_sigma_rad.is_finite() {
        let on_their_side = AxisHypothesis::on_their_side().into_iter();
        axes.extend(on_their_side.map(|hypothesis| (hypothesis, None)));
    }
    // Nor is the scale of a laser in doubt.
    let scales = match context.options.scale_sigma > 0.0 {
        true => SCALES
            .map(|by| (AxisHypothesis::scaled(by), region))
            .to_vec(),
        false => Vec::new(),
    };
    (axes, scales)
}

type Asked<'a> = (AxisHypothesis, Option<&'a Region>);
type Hopeful<'a> = (AxisHypothesis, Option<&'a Region>, ReinterpretedCloud);

/// The hypotheses to which a rough search gives a score of `least`, the best `most` of them, and the rest.
fn scored<'a>(
    context: &RegistrationContext<'_>,
    hypotheses: Vec<Asked<'a>>,
    least: f64,
    most: usize,
) -> (Vec<Hopeful<'a>>, Vec<Hopeful<'a>>) {
    let scored = hypotheses
        .into_par_iter()
        .filter_map(|(hypothesis, region)| {
            let reinterpreted =
                ReinterpretedCloud::new(context, &context.source.coarse, &hypothesis)?;
            let score = reinterpreted.rough_score(context, region);
            Some((score, (hypothesis, region, reinterpreted)))
        });
    let mut scored: Vec<(f64, Hopeful<'a>)> = scored.collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let likely = scored
        .partition_point(|(score, _)| *score >= least)
        .min(most);
    let mut ranked: Vec<_> = scored.into_iter().map(|(_, one)| one).collect();
    let rest = ranked.split_off(likely);
    (ranked, rest)
}

/// A cloud by another hypothesis.
struct ReinterpretedCloud {
    cloud: PreparedCloud,
    sensor_m: Option<Point3<f64>>,
}

impl ReinterpretedCloud {
    fn new(
        context: &RegistrationContext<'_>,
        given: &PreparedCloud,
        hypothesis: &AxisHypothesis,
    ) -> Option<ReinterpretedCloud> {
        let matrix = &hypothesis.matrix;
        let turn = matrix / hypothesis.scale();
        let labels = match given.is_labelled() {
            true => (0..given.len()).map(|i| given.label(i)).collect(),
            false => Vec::new(),
        };
        let points_m = given.points_m().iter().map(|p| matrix * p).collect();
        let cloud = SemanticCloud { points_m, labels };
        let cloud = PreparedCloud::new(cloud, &PrepareOptions::default()).ok()?;
        let cloud = cloud.with_normals(|i| given.normals().get(i).map(|n| turn * n));
        let sensor_m = context.source.sensor_m.map(|p| matrix * p);
        Some(ReinterpretedCloud { cloud, sensor_m })
    }

    fn source(&self) -> SearchSource {
        SearchSource::by_surface(&self.cloud, self.sensor_m)
    }

    /// Share of the full score at the best place of a rough search.
    fn rough_score(&self, context: &RegistrationContext<'_>, region: Option<&Region>) -> f64 {
        let found = search(&context.map.rough, &self.source(), region, ROUGH_PLACES);
        found.first().map_or(0.0, |hypothesis| hypothesis.score)
    }

    /// The best likelihood after a first look, as if it had as many regions as the cloud as it is, and the best poses.
    fn likelihood(
        &self,
        context: &RegistrationContext<'_>,
        region: Option<&Region>,
        (places, looked_at): (usize, usize),
    ) -> Option<(f64, Vec<Isometry3<f64>>)> {
        let hypotheses = search(&context.map.surfaces, &self.source(), region, places);
        let scale = context.map.scale(context.options.noise_m).coarser(2.0);
        let fit = Fit::new(&self.cloud, &context.map.cloud, scale);
        let share = context.coarse_fit.observations() / fit.observations().max(1.0);
        let mut found = context.refine_best(&self.cloud, &hypotheses, looked_at, |pose| {
            (self.likelihood_at(context, &fit, &pose), pose)
        });
        found.truncate(CLOSELY);
        let best = found.first()?.0;
        let poses = found.into_iter().map(|(_, pose)| pose);
        Some((share * best, poses.collect()))
    }

    fn likelihood_at(
        &self,
        context: &RegistrationContext<'_>,
        fit: &Fit<'_>,
        pose: &Isometry3<f64>,
    ) -> f64 {
        let partners = fit.partners(pose);
        let (likelihood, _) = fit.likelihood(
            &partners,
            &context.prior_confusion,
            context.options.agreement,
        );
        likelihood.total()
    }
}
