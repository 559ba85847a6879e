//! Global registration of source clouds in a target map, without an initial guess, with a verdict on the result.
//!
//! Hypotheses of all poses come from a search by surfaces and one by labels. The best are refined by GICP-SE(3) and
//! by Semantic-ICP with learned labels. One likelihood ranks them. Labels contribute
//! as far as they predict each other across folds of the source. With an initial guess, the result of GICP-SE(3) from
//! it is kept unless another pose is clearly more likely.

mod alternatives;
mod axis_hypotheses;
mod axis_hypothesis;
mod calibration;
mod candidates;
mod cloud_statistics;
mod covariance;
mod diagnostics;
mod error_model;
mod fit_diagnostics;
mod map;
mod margin;
mod opposite_sides;
mod profile;
mod rays;
mod reinterpreted_cloud;
mod request;
mod scale;
mod source;
mod source_cloud;
mod track;
mod verdict;
mod weak_directions;

use std::ops::ControlFlow;

use nalgebra::Isometry3;
use rayon::prelude::*;

use super::search::{Hypothesis, Region, SearchMap, SearchSource, search};
use super::{LabelDistribution, PreparedCloud, RegisterOptions, register};
use axis_hypotheses::{BestHypothesis, Refined, best_axis_hypothesis};
use calibration::Refusal;
use candidates::{Candidate, RegistrationContext};
use source::PreparedSource;

pub use calibration::{
    Calibration, ClassReliability, DirectionKind, ScaleEstimate, Verdict, WeakDirection,
};
pub use fit_diagnostics::{FitDiagnostics, Unexplained, UnexplainedKind};
pub use map::CalibrationMap;
pub use margin::{Margin, describe_p_wrong};
pub use profile::Profile;
pub use request::{CalibrationOptions, CalibrationRequest, Progress, SourceCloud, Stage};
pub use track::{TrackUpdate, track};

/// Hypotheses of the search by surfaces; many, because a planar patch fits many walls.
const BY_SURFACES: usize = 128;
/// Hypotheses of the search by labels.
const BY_LABELS: usize = 64;
/// Candidates refined with all methods.
const FINALISTS: usize = 4;
/// Fraction of contradicted lines of sight above which a pose is in doubt; correct poses rarely reach it.
const IN_DOUBT: f64 = 0.1;
/// Largest log-ratio of two scales that count as equal.
const SAME_SCALE_LOG_RATIO: f64 = 0.08;
/// Maximum number of classes in the search by labels.
const SEARCHED_CLASSES: usize = 24;

/// Finds `target_from_source` by a search over all poses, or near `request.start`.
///
/// Unusable input yields [`Verdict::RejectedInput`], not an error. The result is the same on any number of threads.
pub fn register_global(
    map: &CalibrationMap,
    request: &CalibrationRequest<'_>,
    options: &CalibrationOptions,
    progress: &dyn Progress,
) -> Calibration {
    let once = |request: &CalibrationRequest<'_>| {
        run(map, request, options, progress).unwrap_or_else(Calibration::from)
    };
    let found = once(request);
    match options.estimate_scale {
        true => scale::register_scaled(request, found, once),
        false => found,
    }
}

fn run(
    map: &CalibrationMap,
    request: &CalibrationRequest<'_>,
    options: &CalibrationOptions,
    progress: &dyn Progress,
) -> Result<Calibration, Refusal> {
    step(progress, Stage::Prepare, 0.0)?;
    let source = PreparedSource::new(request, options, map.spacing_m)?;
    let context = RegistrationContext::new(map, &source, options, request.confusion);
    step(progress, Stage::Search, 0.1)?;
    let region = request.start.map(|about| Region {
        about,
        radius_m: options.start_radius_m,
        yaw_rad: options.start_yaw_rad,
    });
    let mut hypotheses = by_surfaces(&context, region.as_ref());
    step(progress, Stage::Search, 0.3)?;
    hypotheses.extend(by_labels(&context, region.as_ref()));
    step(progress, Stage::Refine, 0.5)?;
    let coarse = context.coarse_refine(&hypotheses);
    step(progress, Stage::Refine, 0.6)?;
    let fine = context.fine_refine(&coarse);
    step(progress, Stage::Refine, 0.7)?;
    let least = fine.first().map_or(0.0, Candidate::total) - context.pruning_threshold();
    let mut all: Vec<Candidate> = fine
        .par_iter()
        .take(FINALISTS)
        .filter(|c| c.total() >= least)
        .flat_map_iter(|c| context.refine_with_all_methods(&c.target_from_source, "search"))
        .collect();
    all.extend(fine);
    all.extend(context.search_alternatives(&all, region.as_ref()));
    if let Some(start) = &request.start {
        // The result of GICP-SE(3) from the guess comes first.
        let mut from_start = from_start(&context, start);
        from_start.append(&mut all);
        all = from_start;
    }
    step(progress, Stage::Judge, 0.9)?;
    let refined = Refined::of(&all);
    let calibration = verdict::select_and_classify(&context, all, request.start.is_some());
    let contradicted = calibration.fit.floating + calibration.fit.blocked;
    let in_doubt = contradicted > IN_DOUBT && calibration.verdict != Verdict::RejectedInput;
    let other = match options.trust_axes {
        true => None,
        false => best_axis_hypothesis(&context, &coarse, refined, in_doubt, region.as_ref()),
    };
    let _ = progress.report(Stage::Judge, 1.0);
    Ok(match other {
        Some(other) => with_axis_hypothesis(calibration, &other, options),
        None => calibration,
    })
}

/// Adds the best alternative axis or scale hypothesis to a result, which it may reject.
fn with_axis_hypothesis(
    found: Calibration,
    other: &BestHypothesis,
    options: &CalibrationOptions,
) -> Calibration {
    let found = Calibration {
        axis_hypothesis_lead: Some(other.lead),
        ..found
    };
    let reason = || other.hypothesis.reason(options.axes);
    match found.verdict {
        // Tilt and scale are coupled: a tilted cloud fits better at another scale, and the reverse. The reason names
        // both.
        Verdict::RejectedInput if other.hypothesis.is_scaled() => Calibration {
            reason: match other.is_accepted && !found.is_about(other.hypothesis.scale()) {
                true => format!("{}; or it {}", found.reason, reason()),
                false => found.reason,
            },
            ..found
        },
        _ if other.is_accepted => Calibration {
            verdict: Verdict::RejectedInput,
            reason: format!("the cloud {}", reason()),
            scale: match other.hypothesis.is_scaled() {
                true => Some(ScaleEstimate::about(other.hypothesis.scale())),
                false => found.scale,
            },
            ..found
        },
        Verdict::Ok if other.is_plausible() => Calibration {
            verdict: Verdict::Ambiguous,
            reason: format!("perhaps the cloud {}", reason()),
            ..found
        },
        _ => found,
    }
}

impl Calibration {
    /// Tests whether the estimated scale nearly equals `scale`.
    fn is_about(&self, scale: f64) -> bool {
        let estimate = self.scale.map_or(1.0, |estimate| estimate.scale);
        (estimate / scale).ln().abs() < SAME_SCALE_LOG_RATIO
    }
}

/// Reports progress; fails if the caller cancels the registration.
fn step(progress: &dyn Progress, stage: Stage, fraction: f64) -> Result<(), Refusal> {
    match progress.report(stage, fraction) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Refusal::Cancelled),
    }
}

/// Searches for poses by the positions and orientations of surfaces.
fn by_surfaces(context: &RegistrationContext<'_>, region: Option<&Region>) -> Vec<Hypothesis> {
    let source = SearchSource::by_surface(&context.source.coarse, context.source.sensor_m);
    search(&context.map.surfaces, &source, region, BY_SURFACES)
}

/// Searches for poses by the labels, with the lift of their co-occurrence as the score.
fn by_labels(context: &RegistrationContext<'_>, region: Option<&Region>) -> Vec<Hypothesis> {
    let (coarse, map) = (&context.source.coarse, &context.map.cloud);
    if !coarse.is_labelled() || !map.is_labelled() {
        return Vec::new();
    }
    let classes = frequent_classes(coarse);
    let lift = context.prior_confusion.lift(context.options.agreement);
    let score = |i: usize, channel: usize| {
        let class = classes.get(channel).copied().unwrap_or_default();
        let lift = lift.expected(&LabelDistribution::hard(class), &map.label(i));
        // Score 0 at a lift of 1/4, 50 at 1, 100 at 4.
        (50.0 * (1.0 + lift.clamp(0.25, 4.0).ln() / 4.0_f64.ln())) as u8
    };
    let channels: Vec<Option<usize>> = (0..coarse.len())
        .map(|i| {
            coarse
                .label(i)
                .top()
                .and_then(|top| classes.iter().position(|c| *c == top))
        })
        .collect();
    let Some(labels) = SearchMap::of_classes(map, context.map.spacing_m, classes.len(), score)
    else {
        return Vec::new();
    };
    let source = SearchSource::by_class(coarse, context.source.sensor_m, &channels);
    search(&labels, &source, region, BY_LABELS)
}

/// Most frequent classes of a cloud, in descending order of their counts.
fn frequent_classes(cloud: &PreparedCloud) -> Vec<u16> {
    let mut counts = std::collections::BTreeMap::new();
    for class in (0..cloud.len()).filter_map(|i| cloud.label(i).top()) {
        *counts.entry(class).or_insert(0_usize) += 1;
    }
    let mut classes: Vec<(u16, usize)> = counts.into_iter().collect();
    classes.sort_by_key(|(class, n)| (std::cmp::Reverse(*n), *class));
    classes.truncate(SEARCHED_CLASSES);
    classes.into_iter().map(|(class, _)| class).collect()
}

/// Refines the initial guess with all methods; the result of GICP-SE(3) comes first.
fn from_start(context: &RegistrationContext<'_>, start: &Isometry3<f64>) -> Vec<Candidate> {
    let (source, map) = (&context.source.full, &context.map.cloud);
    // The published gate is wider and converges from farther away.
    let published = register(source, map, start, &RegisterOptions::gicp_se3());
    let mut all = vec![context.evaluate(&context.fit, published.target_from_source, "gicp")];
    all.extend(context.refine_with_all_methods(start, "gicp"));
    if source.is_labelled() && map.is_labelled() {
        let gate_m = (30.0 * context.map.spacing_m).max(1.0);
        let options = RegisterOptions {
            gate_m,
            inner_iterations: 2,
            ..RegisterOptions::class_wise_cauchy()
        };
        let pose = register(source, map, start, &options);
        let refined = context.refine_wide_gate(&pose.target_from_source);
        all.push(context.evaluate(&context.fit, refined, "class-wise"));
    }
    all
}
