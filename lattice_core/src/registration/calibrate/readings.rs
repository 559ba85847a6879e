//! Readings of a cloud's axes: those under which it would fit tell how it was misread.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::super::likelihood::Fit;
use super::super::search::{Region, SearchSource, search};
use super::super::{PrepareOptions, PreparedCloud, SemanticCloud};
use super::candidates::{Candidate, Workbench};
use crate::pose::Axes;

/// Hypotheses of a search with other axes.
const MISREAD: usize = 48;
/// Those of them that get all steps of a first look.
const FIRST_LOOK: usize = 16;
/// Hypotheses of a rough search.
const ROUGH_PLACES: usize = 4;
/// Readings that are looked at closely: the right one and its mirror image lead a rough search.
const LOOKED_AT: usize = 2;
/// Log-likelihood by which a reading is certainly better.
const MARGIN: f64 = 40.0;
/// Score by which a right reading may fall behind a wrong one in it.
const ROUGH: f64 = 0.03;

/// Axes that a cloud may have instead of forward, left, up.
///
/// Turns about the vertical are searched anyway, so the axis that points up and the handedness tell all.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Reading {
    /// The matrix that mends the points.
    matrix: Matrix3<f64>,
}

impl Reading {
    /// One axis has the wrong sign.
    const MIRRORED: Reading = Reading {
        matrix: Matrix3::new(1., 0., 0., 0., -1., 0., 0., 0., 1.),
    };

    /// All that turn the vertical, of both hands.
    fn on_their_side() -> Vec<Reading> {
        let signed = |i: usize| [1.0, -1.0].map(|sign| (i, sign));
        let up = (0..3).flat_map(signed).filter(|up| *up != (2, 1.0));
        let hands = |(i, sign): (usize, f64)| {
            [1.0, -1.0].map(|hand| {
                let unit = |i: usize| Vector3::ith(i % 3, 1.0);
                let (up, forward) = (sign * unit(i), unit(i + 1));
                let left = hand * up.cross(&forward);
                let matrix = Matrix3::from_columns(&[forward, left, up]).transpose();
                Reading { matrix }
            })
        };
        up.flat_map(hands).collect()
    }

    /// True if two differ by a turn about the vertical only.
    fn is_like(&self, matrix: &Matrix3<f64>) -> bool {
        let same_up = self.matrix.row(2) == matrix.row(2);
        same_up && self.matrix.determinant() * matrix.determinant() > 0.0
    }

    /// The reading in words, for a cloud that was read as one of `axes`.
    pub fn reason(&self, axes: Axes) -> String {
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

/// A reading of a cloud that fits better than the one it has.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Better {
    pub reading: Reading,
    /// True if it is beyond doubt.
    pub clearly: bool,
}

/// The best reading under which the cloud fits better than as it is, after a first look.
///
/// A rough search leaves out those that cannot be it.
pub(super) fn misread(
    bench: &Workbench<'_>,
    straight: &[Candidate],
    region: Option<&Region>,
) -> Option<Better> {
    let likelihoods = straight.iter().map(|c| c.likelihood.total());
    let straight = likelihoods.fold(0.0, f64::max);
    let as_it_is = Mended::new(bench, &Matrix3::identity())?;
    let rough = as_it_is.rough_score(bench, region);
    let mut readings = vec![(Reading::MIRRORED, region)];
    // A cloud that may lean is not of a headset, whose axes are often mistaken.
    if bench.options.gravity_sigma_rad.is_finite() {
        let on_their_side = Reading::on_their_side().into_iter();
        readings.extend(on_their_side.map(|reading| (reading, None)));
    }
    let hopeful = readings.par_iter().filter_map(|(reading, region)| {
        let mended = Mended::new(bench, &reading.matrix)?;
        let score = mended.rough_score(bench, *region);
        (score >= rough - ROUGH).then_some((score, *reading, *region, mended))
    });
    let mut hopeful: Vec<_> = hopeful.collect();
    hopeful.sort_by(|a, b| b.0.total_cmp(&a.0));
    hopeful.truncate(LOOKED_AT);
    let fits = hopeful
        .par_iter()
        .filter_map(|(_, reading, region, mended)| {
            let likelihood = mended.likelihood(bench, *region)?;
            Some((likelihood, *reading))
        });
    let (best, reading) = fits.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let observations = bench.few.observations();
    let clearly = best > straight + MARGIN.max(0.25 * observations) && best > 0.5 * observations;
    let better = clearly || best > straight + 0.5 * MARGIN;
    better.then_some(Better { reading, clearly })
}

/// The few points in other axes.
struct Mended {
    cloud: PreparedCloud,
    source: SearchSource,
}

impl Mended {
    fn new(bench: &Workbench<'_>, matrix: &Matrix3<f64>) -> Option<Mended> {
        let few = &bench.input.few;
        let labels = match few.is_labelled() {
            true => (0..few.len()).map(|i| few.label(i)).collect(),
            false => Vec::new(),
        };
        let points_m = few.points_m().iter().map(|p| matrix * p).collect();
        let cloud = SemanticCloud { points_m, labels };
        let cloud = PreparedCloud::new(cloud, &PrepareOptions::default()).ok()?;
        let cloud = cloud.with_normals(|i| few.normals().get(i).map(|n| matrix * n));
        let sensor_m = bench.input.sensor_m.map(|p| matrix * p);
        let source = SearchSource::by_surface(&cloud, sensor_m);
        Some(Mended { cloud, source })
    }

    /// Share of the full score at the best place of a rough search.
    fn rough_score(&self, bench: &Workbench<'_>, region: Option<&Region>) -> f64 {
        let found = search(&bench.map.rough, &self.source, region, ROUGH_PLACES);
        found.first().map_or(0.0, |hypothesis| hypothesis.score)
    }

    /// The best likelihood after a first look.
    fn likelihood(&self, bench: &Workbench<'_>, region: Option<&Region>) -> Option<f64> {
        let hypotheses = search(&bench.map.surfaces, &self.source, region, MISREAD);
        let scale = bench.map.scale(bench.options.noise_m).coarser(2.0);
        let fit = Fit::new(&self.cloud, &bench.map.cloud, scale);
        let found = bench.refine_best(&self.cloud, &hypotheses, FIRST_LOOK, |pose| {
            let partners = fit.partners(&pose);
            let (likelihood, _) = fit.likelihood(&partners, &bench.known, bench.options.agreement);
            (likelihood.total(), ())
        });
        found.first().map(|(likelihood, ())| *likelihood)
    }
}
