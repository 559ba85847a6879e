//! Prepared clouds: nearest neighbours ([`kd_tree`](crate::kd_tree)), surface normals ([`plane`], [`surface`]) and
//! labels.

mod plane;
pub(super) mod surface;

use std::collections::BTreeMap;
use std::sync::OnceLock;

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use surface::Surface;

use super::{LabelDistribution, RegistrationError, SemanticCloud, UNLABELED};
use crate::kd_tree::{MAX_NEIGHBORS, Nearest, Neighbors};

/// Largest accepted coordinate, metres.
pub const MAX_COORDINATE_M: f64 = 1e8;
/// Neighbours whose labels are averaged, as in the code of the Semantic-ICP authors.
const BLUR: usize = 20;

/// Options of the preparation of a cloud.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PrepareOptions {
    /// Number of points in the neighbourhood of a covariance, the point itself included.
    pub neighbors: usize,
    /// Variance across the plane, relative to 1 m^2 along it.
    pub plane_epsilon: f64,
    /// Minimum number of points of a cloud.
    pub min_points: usize,
}

impl Default for PrepareOptions {
    /// Semantic-ICP as published: 20 neighbours, epsilon 1e-3.
    fn default() -> PrepareOptions {
        PrepareOptions {
            neighbors: 20,
            plane_epsilon: 1e-3,
            min_points: 20,
        }
    }
}

/// Point cloud with plane-regularized covariances, a k-d tree and labels.
///
/// Points are in the order of the tree, which places neighbours close to each other. Indices refer to this order;
/// [`order`](Self::order) maps them to the input cloud.
pub struct PreparedCloud {
    surface: Surface,
    labels: Vec<LabelDistribution>,
    options: PrepareOptions,
    classes: OnceLock<Vec<(u16, Surface)>>,
    blurred: OnceLock<Vec<LabelDistribution>>,
}

impl PreparedCloud {
    /// Builds the tree and the covariances; the result is the same on any number of threads.
    pub fn new(
        cloud: SemanticCloud,
        options: &PrepareOptions,
    ) -> Result<PreparedCloud, RegistrationError> {
        check(&cloud, options)?;
        let surface = Surface::new(&cloud.points_m, options.neighbors);
        let labels = if cloud.labels.is_empty() {
            Vec::new()
        } else {
            let label = |&i: &u32| cloud.label(i as usize);
            surface.order.iter().map(label).collect()
        };
        Ok(PreparedCloud {
            surface,
            labels,
            options: *options,
            classes: OnceLock::new(),
            blurred: OnceLock::new(),
        })
    }

    /// Replaces normals by known ones, given by the index in the input cloud.
    pub(super) fn with_normals(
        mut self,
        normal: impl Fn(usize) -> Option<Vector3<f64>>,
    ) -> PreparedCloud {
        let Surface { normals, order, .. } = &mut self.surface;
        for (own, &place) in normals.iter_mut().zip(order.iter()) {
            *own = normal(place as usize).unwrap_or(*own);
        }
        self
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.surface.points_m.len()
    }

    /// Tests whether there are no points; never true for a prepared cloud.
    pub fn is_empty(&self) -> bool {
        self.surface.points_m.is_empty()
    }

    /// Points, metres, in the order of the tree.
    pub fn points_m(&self) -> &[Point3<f64>] {
        &self.surface.points_m
    }

    /// Index of each point in the input cloud.
    pub fn order(&self) -> &[u32] {
        &self.surface.order
    }

    /// Unit normals of the planes fitted to the neighbourhoods; their signs are arbitrary.
    pub fn normals(&self) -> &[Vector3<f64>] {
        &self.surface.normals
    }

    /// Covariance of each point, m^2: U diag(1, 1, epsilon) U^T (Segal et al. 2009, section III.B).
    pub fn covariances_m2(&self) -> impl ExactSizeIterator<Item = Matrix3<f64>> + '_ {
        let flat = 1.0 - self.options.plane_epsilon;
        let covariance = move |n: &Vector3<f64>| Matrix3::identity() - flat * n * n.transpose();
        self.surface.normals.iter().map(covariance)
    }

    /// Variance across the planes, relative to 1 m^2 along them.
    pub fn plane_epsilon(&self) -> f64 {
        self.options.plane_epsilon
    }

    /// Tests whether the cloud has labels.
    pub fn is_labelled(&self) -> bool {
        !self.labels.is_empty()
    }

    /// Label distribution of point `i`.
    pub fn label(&self, i: usize) -> LabelDistribution {
        let label = self.labels.get(i).copied();
        label.unwrap_or(LabelDistribution::UNKNOWN)
    }

    /// Nearest point within `max_distance_m` and its squared distance (m^2); of equally near points the lowest index.
    pub fn nearest(&self, query: &Point3<f64>, max_distance_m: f64) -> Option<(usize, f64)> {
        let mut nearest = Nearest {
            index: u32::MAX,
            squared: squared_reach(max_distance_m),
        };
        self.surface.tree.search(query, &mut nearest);
        (nearest.index != u32::MAX).then_some((nearest.index as usize, nearest.squared))
    }

    /// Finds up to `k` nearest points (at most [`MAX_NEIGHBORS`]) within `max_distance_m`.
    pub fn nearest_k(
        &self,
        query: &Point3<f64>,
        k: usize,
        max_distance_m: f64,
        out: &mut Neighbors,
    ) {
        out.start(k, squared_reach(max_distance_m));
        self.surface.tree.search(query, out);
    }

    pub(super) fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Label distributions: one per point, or none.
    pub(super) fn labels(&self) -> &[LabelDistribution] {
        &self.labels
    }

    /// Points of each class, by the most probable label, with their own trees and covariances; built on first use.
    ///
    /// Classes with fewer points than a neighbourhood are dropped.
    pub(super) fn classes(&self) -> &[(u16, Surface)] {
        self.classes.get_or_init(|| {
            let mut of_class: BTreeMap<u16, Vec<Point3<f64>>> = BTreeMap::new();
            for (point, label) in self.points_m().iter().zip(&self.labels) {
                if let Some(class) = label.top() {
                    of_class.entry(class).or_default().push(*point);
                }
            }
            let neighbors = self.options.neighbors;
            of_class.retain(|_, points_m| points_m.len() >= neighbors);
            let surface =
                |(class, points_m): (u16, Vec<_>)| (class, Surface::new(&points_m, neighbors));
            of_class.into_iter().map(surface).collect()
        })
    }

    /// Fractions of the most probable classes among the nearest points of each point; built on first use.
    pub(super) fn blurred_labels(&self) -> &[LabelDistribution] {
        self.blurred.get_or_init(|| {
            if self.labels.is_empty() {
                return Vec::new();
            }
            let blur = |found: &mut Neighbors, point: &Point3<f64>| {
                self.nearest_k(point, BLUR, f64::MAX, found);
                let share = 1.0 / found.len().max(1) as f32;
                let mut shares: Vec<(u16, f32)> = Vec::new();
                for (i, _) in found.iter() {
                    let class = self.label(i).top().unwrap_or(UNLABELED);
                    match shares.iter_mut().find(|(c, _)| *c == class) {
                        Some((_, sum)) => *sum += share,
                        None => shares.push((class, share)),
                    }
                }
                LabelDistribution::from_weights(shares)
            };
            let points_m = self.points_m().par_iter();
            points_m.map_init(Neighbors::default, blur).collect()
        })
    }
}

/// Square of a distance; negative for an invalid distance, so that no point is within it.
pub(super) fn squared_reach(max_distance_m: f64) -> f64 {
    if max_distance_m >= 0.0 {
        (max_distance_m * max_distance_m).min(f64::MAX)
    } else {
        -1.0
    }
}

/// Checks a cloud and its options.
fn check(cloud: &SemanticCloud, options: &PrepareOptions) -> Result<(), RegistrationError> {
    let (points, labels) = (cloud.len(), cloud.labels.len());
    let (least, most) = (options.min_points.max(3), u32::MAX as usize / 2);
    if !(3..=MAX_NEIGHBORS).contains(&options.neighbors) {
        return Err(RegistrationError::Neighbors {
            neighbors: options.neighbors,
            most: MAX_NEIGHBORS,
        });
    }
    let plane_epsilon = options.plane_epsilon;
    if !(plane_epsilon > 0.0 && plane_epsilon <= 1.0) {
        return Err(RegistrationError::PlaneEpsilon { plane_epsilon });
    }
    if points < least {
        return Err(RegistrationError::TooFewPoints { points, least });
    }
    if points > most {
        return Err(RegistrationError::TooManyPoints { points, most });
    }
    if labels != 0 && labels != points {
        return Err(RegistrationError::LabelCount { labels, points });
    }
    let near = |p: &Point3<f64>| p.iter().all(|c| c.abs() <= MAX_COORDINATE_M);
    if let Some(index) = cloud.points_m.iter().position(|p| !near(p)) {
        return Err(RegistrationError::NotFinite { index });
    }
    let largest_m = cloud
        .points_m
        .iter()
        .map(|p| p.coords.amax())
        .fold(0.0, f64::max);
    if plane::is_line(&plane::scatter(cloud.points_m.iter().copied()), largest_m) {
        return Err(RegistrationError::Collinear);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
