//! Selection of a candidate, its covariance and its verdict.

use nalgebra::{Isometry3, Matrix6, Vector3};

use super::calibration::{Calibration, ClassReliability, DirectionKind, Verdict, WeakDirection};
use super::candidates::most_likely;
use super::candidates::{Candidate, RegistrationContext};
use super::error_model::covariance;
use super::error_model::weak;
use super::fit_diagnostics::{FitDiagnostics, fit_diagnostics};
use super::margin::{Margin, SOFTNESS, describe_p_wrong};
use super::request::CalibrationOptions;
use super::scale::{estimate_scale, scale_fault};

/// Penalty weight: a line of sight that the map contradicts counts as three outliers.
const CONTRADICTION_PENALTY: f64 = 3.0;
/// Maximum number of alternatives that enter the margin.
const MAX_ALTERNATIVES: usize = 16;
/// Tilt beyond which a pose is rejected, in standard deviations.
const MAX_TILT_SIGMAS: f64 = 5.0;
/// Log-likelihood ratio above which another pose replaces the result of GICP-SE(3) from the initial guess.
const REPLACE_LEAD: f64 = 10.0;

/// Selects a candidate and classifies it. With `started`, the first candidate is GICP-SE(3) from the initial guess.
pub(super) fn select_and_classify(
    context: &RegistrationContext<'_>,
    all: Vec<Candidate>,
    started: bool,
) -> Calibration {
    let Some(best) = select(context, &all, started) else {
        return Calibration::refused(
            Verdict::NoOverlap,
            "no place was found: the search has no candidate pose",
        );
    };
    let centroid = context.centroid();
    let (shift_m, turn_rad) = context.min_separation();
    let pose = best.target_from_source;
    let fit = fit_diagnostics(context, &pose);
    let margin = margin(context, &all, best, &fit);
    let covariance = covariance(context, best).map(|surfaces| {
        let near = all
            .iter()
            .filter(|c| c.is_near(&pose, &centroid, shift_m, turn_rad));
        let probed = context.with_probed_variances(best, surfaces);
        near.fold(
            context.with_uncertain_sides(best, probed),
            |covariance, alternative| {
                let odds = ((alternative.total() - best.total()) / SOFTNESS)
                    .exp()
                    .min(1.0);
                covariance.with_alternative(
                    &pose,
                    &alternative.target_from_source,
                    odds / (1.0 + odds),
                )
            },
        )
    });
    // Both frames are gravity-aligned, but the result of GICP-SE(3) from a guess is returned unchanged.
    let gravity = context.options.gravity_sigma_rad;
    let is_from_start = started && all.first().is_some_and(|gicp| std::ptr::eq(gicp, best));
    let upright = (covariance.as_ref())
        .filter(|_| gravity.is_finite())
        .map(|covariance| covariance.upright(&pose, gravity));
    let is_tilted = upright == Some(None);
    let (pose, covariance) = match upright.flatten() {
        Some((pose, covariance)) if !is_from_start => (pose, Some(covariance)),
        _ => (pose, covariance),
    };
    let options = context.options;
    let weak = covariance
        .as_ref()
        .map(|covariance| weak(context, covariance, &pose));
    let weak = weak.unwrap_or_default();
    let is_constrained = covariance.is_some();
    let (mut verdict, mut reason) = classify(options, best, &margin, &fit, is_constrained, &weak);
    let scale = estimate_scale(context, best);
    if best.inlier_fraction >= options.min_inliers
        && let Some(fault) = tilt_fault(&pose, is_tilted, options)
            .or_else(|| scale_fault(scale, context.fit.observations(), options))
    {
        (verdict, reason) = (Verdict::RejectedInput, fault);
    }
    if let Some(regions) = (verdict != Verdict::RejectedInput)
        .then(|| fit.describe())
        .flatten()
    {
        reason = format!("{reason}; {regions}");
    }
    let confusion = context.prior_confusion.merged(&best.confusion);
    Calibration {
        verdict,
        reason,
        cancelled: false,
        target_from_source: pose,
        covariance: covariance.map_or_else(Matrix6::zeros, |c| c.in_target(&pose)),
        margin,
        fit,
        axis_hypothesis_lead: None,
        inlier_fraction: best.inlier_fraction,
        rmse_m: best.rmse_m,
        weak_directions: weak,
        class_reliability: reliability(best),
        method: best.method,
        confusion: match verdict {
            Verdict::Ok => confusion,
            _ => context.prior_confusion.clone(),
        },
        scale,
    }
}

/// Margin of a pose over its best alternatives.
fn margin(
    context: &RegistrationContext<'_>,
    all: &[Candidate],
    best: &Candidate,
    fit: &FitDiagnostics,
) -> Margin {
    let outlier = context.fit.outlier_log_likelihood();
    let mut alternatives = context.alternatives(all, best, MAX_ALTERNATIVES);
    // Alternatives far behind count only if there are no others.
    let competitive = alternatives
        .iter()
        .filter(|alternative| context.is_competitive(alternative, best));
    alternatives.truncate(competitive.count().max(1));
    let poses: Vec<&Isometry3<f64>> = alternatives.iter().map(|c| &c.target_from_source).collect();
    let region_m = context.options.region_m;
    let indistinct = context
        .fit
        .indistinct_differences(&best.target_from_source, &poses, region_m);
    let ahead = |alternative: &&Candidate| best.total() - alternative.total().max(outlier);
    let log_ratios = alternatives.iter().map(ahead).zip(indistinct);
    let contradicted = CONTRADICTION_PENALTY * (fit.floating + fit.blocked);
    let outliers = context.fit.observations() * (1.0 - best.inlier_fraction + contradicted);
    let margin = Margin::over(log_ratios, outliers);
    margin.unwrap_or_else(|| Margin {
        log_ratio: best.total() - outlier,
        outliers,
        ..Margin::default()
    })
}

/// Reason to reject a tilted pose, since gravity is along -z of both frames.
fn tilt_fault(
    pose: &Isometry3<f64>,
    is_tilted: bool,
    options: &CalibrationOptions,
) -> Option<String> {
    let angle_rad = (pose.rotation * Vector3::z()).angle(&Vector3::z());
    let beyond = is_tilted && angle_rad > MAX_TILT_SIGMAS * options.gravity_sigma_rad;
    beyond.then(|| {
        let degrees = angle_rad.to_degrees();
        let most = (MAX_TILT_SIGMAS * options.gravity_sigma_rad).to_degrees();
        format!(
            "the cloud leans by {degrees:.1} degrees in the map, above {most:.1} degrees: gravity must be along -z of both"
        )
    })
}

/// Selects the most likely candidate; prefers GICP-SE(3) from the initial guess if it is near or nearly as likely.
fn select<'a>(
    context: &RegistrationContext<'_>,
    all: &'a [Candidate],
    started: bool,
) -> Option<&'a Candidate> {
    let best = most_likely(all)?;
    let Some(gicp) = all.first().filter(|_| started) else {
        return Some(best);
    };
    // Near the result of GICP-SE(3), a difference of the likelihoods is not significant.
    let (shift_m, turn_rad) = (3.0 * context.map.spacing_m, 0.09);
    let beside = gicp.is_near(
        &best.target_from_source,
        &context.centroid(),
        shift_m,
        turn_rad,
    );
    let least = match beside {
        true => REPLACE_LEAD.max(0.2 * context.fit.observations()),
        false => REPLACE_LEAD,
    };
    Some(match best.total() < gicp.total() + least {
        true => gicp,
        false => best,
    })
}

/// Verdict on the selected candidate, with its reason.
fn classify(
    options: &CalibrationOptions,
    best: &Candidate,
    margin: &Margin,
    fit: &FitDiagnostics,
    is_constrained: bool,
    weak: &[WeakDirection],
) -> (Verdict, String) {
    let percent = 100.0 * best.inlier_fraction;
    if best.inlier_fraction < options.min_inliers {
        let least = 100.0 * options.min_inliers;
        let reason = format!(
            "only {percent:.0} % of the points lie on the map, below {least:.0} % (`min_inliers`)"
        );
        return (Verdict::NoOverlap, reason);
    }
    if fit.floating + fit.blocked > options.max_contradicted {
        return (Verdict::NoOverlap, contradiction(fit, options));
    }
    let (log, p_wrong) = (margin.log_ratio, margin.p_wrong());
    if p_wrong > options.max_p_wrong {
        let least = margin.threshold(options.max_p_wrong);
        let reason = format!(
            "another pose is right with a probability of {p_wrong:.2}: log-margin {log:.1} is below {least:.0}; \
             scan other parts of the place too"
        );
        return (Verdict::Ambiguous, reason);
    }
    if let Some(worst) = weak.first() {
        let [x, y, z] = [worst.axis.x, worst.axis.y, worst.axis.z];
        let reason = match worst.kind {
            DirectionKind::Translation => format!(
                "position is weak along ({x:.2}, {y:.2}, {z:.2}): standard deviation {:.2} m",
                worst.sigma
            ),
            DirectionKind::Rotation => format!(
                "orientation is weak about ({x:.2}, {y:.2}, {z:.2}): standard deviation {:.1} degrees",
                worst.sigma.to_degrees()
            ),
        };
        return (Verdict::Degenerate, reason);
    }
    if !is_constrained {
        return (
            Verdict::Degenerate,
            "too few surfaces constrain the pose".into(),
        );
    }
    let reason = format!(
        "{percent:.0} % of the points lie on the map, log-margin {log:.0}, {}",
        describe_p_wrong(p_wrong)
    );
    (Verdict::Ok, reason)
}

/// Reason to reject a pose that the free space of the map contradicts.
fn contradiction(fit: &FitDiagnostics, options: &CalibrationOptions) -> String {
    let [floating, blocked, most] =
        [fit.floating, fit.blocked, options.max_contradicted].map(|share| 100.0 * share);
    format!(
        "the map contradicts the cloud: {floating:.0} % of its points are floating in front of surfaces of the map, \
         {blocked:.0} % are hidden behind one, above {most:.0} % together (`max_contradicted`); the cloud is of another \
         place, or objects have moved"
    )
}

/// Agreement of each source class with the map at a candidate's pose.
fn reliability(best: &Candidate) -> Vec<ClassReliability> {
    let mut classes: Vec<u16> = best.confusion.pairs().iter().map(|p| p.0).collect();
    classes.dedup();
    let of = |source_class: u16| {
        let (agreement, weight) = best.confusion.agreement(source_class);
        ClassReliability {
            source_class,
            agreement,
            weight,
        }
    };
    classes
        .into_iter()
        .map(of)
        .filter(|c| c.weight > 0.0)
        .collect()
}
