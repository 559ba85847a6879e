//! Source cloud under another axis or scale hypothesis.

use nalgebra::{Isometry3, Point3};

use super::super::likelihood::Fit;
use super::super::search::{Region, SearchSource, search};
use super::super::{PrepareOptions, PreparedCloud, SemanticCloud};
use super::axis_hypothesis::AxisHypothesis;
use super::candidates::RegistrationContext;

/// Search hypotheses of the rough search.
const ROUGH_PLACES: usize = 4;
/// Poses kept for the evaluation with all points.
const KEPT_POSES: usize = 4;

/// Source cloud transformed by an [`AxisHypothesis`].
pub(super) struct ReinterpretedCloud {
    pub cloud: PreparedCloud,
    pub sensor_m: Option<Point3<f64>>,
}

impl ReinterpretedCloud {
    /// Transforms the points, normals and sensor position of a cloud; `None` if it cannot be registered.
    pub fn new(
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

    /// Fraction of the full score at the best pose of a rough search.
    pub fn rough_score(&self, context: &RegistrationContext<'_>, region: Option<&Region>) -> f64 {
        let found = search(&context.map.rough, &self.source(), region, ROUGH_PLACES);
        found.first().map_or(0.0, |hypothesis| hypothesis.score)
    }

    /// Log-likelihood of the best pose after a coarse refinement, with the best poses.
    ///
    /// The log-likelihood is scaled to the number of observations of the source as declared.
    pub fn likelihood(
        &self,
        context: &RegistrationContext<'_>,
        region: Option<&Region>,
        (places, kept): (usize, usize),
    ) -> Option<(f64, Vec<Isometry3<f64>>)> {
        let hypotheses = search(&context.map.surfaces, &self.source(), region, places);
        let scale = context.map.scale(context.options.noise_m).coarser(2.0);
        let fit = Fit::new(&self.cloud, &context.map.cloud, scale);
        let share = context.coarse_fit.observations() / fit.observations().max(1.0);
        let mut found = context.refine_best(&self.cloud, &hypotheses, kept, |pose| {
            (self.likelihood_at(context, &fit, &pose), pose)
        });
        found.truncate(KEPT_POSES);
        let best = found.first()?.0;
        let poses = found.into_iter().map(|(_, pose)| pose);
        Some((share * best, poses.collect()))
    }

    /// Log-likelihood of a pose.
    pub fn likelihood_at(
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
