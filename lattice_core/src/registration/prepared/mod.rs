//! A cloud ready to be registered.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::plane;
use super::surface::Surface;
use super::tree::{MAX_NEIGHBORS, Nearest, Neighbors};
use super::{LabelDistribution, RegistrationError, SemanticCloud, UNLABELED};

/// Largest coordinate that is taken, metres.
pub const MAX_COORDINATE_M: f64 = 1e8;
/// Neighbours whose labels are blurred into one, as the authors of Semantic-ICP do.
const BLUR: usize = 20;

/// How a cloud is prepared.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PrepareOptions {
    /// Points of the neighbourhood of a covariance, the point itself among them.
    pub neighbors: usize,
    /// Variance across the plane, where those along it are 1 m^2.
    pub plane_epsilon: f64,
    /// Fewest points of a cloud.
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

/// A cloud ready to be registered: points, plane-regularised covariances, nearest neighbours, labels.
///
/// Points are kept in the order of the tree, near points near each other; indices are places in this
/// order and [`order`](Self::order) tells where each was in the cloud.
pub struct PreparedCloud {
    surface: Surface,
    labels: Vec<LabelDistribution>,
    options: PrepareOptions,
    classes: OnceLock<Vec<(u16, Surface)>>,
    blurred: OnceLock<Vec<LabelDistribution>>,
}

impl PreparedCloud {
    /// Builds the tree and the covariances; the same on any number of threads.
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

    /// Number of points.
    pub fn len(&self) -> usize {
        self.surface.points_m.len()
    }

    /// Whether there is no point; never, for a prepared cloud.
    pub fn is_empty(&self) -> bool {
        self.surface.points_m.is_empty()
    }

    /// Points, metres, in the order of the tree.
    pub fn points_m(&self) -> &[Point3<f64>] {
        &self.surface.points_m
    }

    /// Place of each point in the cloud that was prepared.
    pub fn order(&self) -> &[u32] {
        &self.surface.order
    }

    /// Unit normals of the planes through the neighbourhoods; their signs are arbitrary.
    pub fn normals(&self) -> &[Vector3<f64>] {
        &self.surface.normals
    }

    /// Covariance of each point, m^2: U diag(1, 1, epsilon) U^T (Segal et al. 2009, section III.B).
    pub fn covariances_m2(&self) -> impl ExactSizeIterator<Item = Matrix3<f64>> + '_ {
        let flat = 1.0 - self.options.plane_epsilon;
        let covariance = move |n: &Vector3<f64>| Matrix3::identity() - flat * n * n.transpose();
        self.surface.normals.iter().map(covariance)
    }

    /// Variance across the planes, where those along them are 1 m^2.
    pub fn plane_epsilon(&self) -> f64 {
        self.options.plane_epsilon
    }

    /// Whether the cloud came with labels.
    pub fn is_labelled(&self) -> bool {
        !self.labels.is_empty()
    }

    /// What is known of the class of point `i`.
    pub fn label(&self, i: usize) -> LabelDistribution {
        let label = self.labels.get(i).copied();
        label.unwrap_or(LabelDistribution::UNKNOWN)
    }

    /// The nearest point and its squared distance (m^2), at most `max_distance_m` away; of equally near
    /// points the one with the lowest index.
    pub fn nearest(&self, query: &Point3<f64>, max_distance_m: f64) -> Option<(usize, f64)> {
        let mut nearest = Nearest {
            index: u32::MAX,
            squared: squared_reach(max_distance_m),
        };
        self.surface.tree.search(query, &mut nearest);
        (nearest.index != u32::MAX).then_some((nearest.index as usize, nearest.squared))
    }

    /// The `k` nearest points (at most [`MAX_NEIGHBORS`]), at most `max_distance_m` away.
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

    /// One for each point, or none.
    pub(super) fn labels(&self) -> &[LabelDistribution] {
        &self.labels
    }

    /// The points of each class, by their most probable one, with trees and covariances of their own; made
    /// when first asked for. Classes with fewer points than a neighbourhood are left out.
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

    /// Shares of the most probable classes of the nearest points of each point; made when first asked for.
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

/// Square of a distance; a bound that nothing is within for what is not a distance.
pub(super) fn squared_reach(max_distance_m: f64) -> f64 {
    if max_distance_m >= 0.0 {
        (max_distance_m * max_distance_m).min(f64::MAX)
    } else {
        -1.0
    }
}

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
mod tests {
    use super::*;

    fn options(neighbors: usize) -> PrepareOptions {
        PrepareOptions {
            neighbors,
            min_points: 3,
            ..PrepareOptions::default()
        }
    }

    /// Two walls and a floor, unevenly sampled.
    fn corner(n: usize) -> Vec<Point3<f64>> {
        let fraction = |i: usize, by: f64| (i as f64 * by).fract() * 3.0;
        let place = |i| {
            let (u, v) = (fraction(i, 0.618_033_988_7), fraction(i, 0.754_877_666_2));
            match i % 3 {
                0 => Point3::new(u, v, 0.0),
                1 => Point3::new(u, 0.0, v),
                _ => Point3::new(0.0, u, v),
            }
        };
        (0..n).map(place).collect()
    }

    #[test]
    fn normals_and_covariances_are_those_of_the_planes() {
        let labels: Vec<_> = (0..3000)
            .map(|i| LabelDistribution::hard(i as u16 % 3))
            .collect();
        let cloud = SemanticCloud {
            points_m: corner(3000),
            labels,
        };
        let prepared = PreparedCloud::new(cloud.clone(), &PrepareOptions::default()).unwrap();
        let axes = [Vector3::z(), Vector3::y(), Vector3::x()];
        let mut checked = 0;
        for (i, covariance) in prepared.covariances_m2().enumerate() {
            let point = prepared.points_m()[i];
            let original = prepared.order()[i] as usize;
            assert_eq!(cloud.points_m[original], point);
            assert_eq!(cloud.label(original), prepared.label(i));
            if point.coords.iter().filter(|c| **c > 0.6).count() == 2 {
                let axis = axes[original % 3];
                let expected: Matrix3<f64> = Matrix3::identity() - 0.999 * axis * axis.transpose();
                assert!((covariance - expected).norm() < 1e-12, "{covariance}");
                checked += 1;
            }
        }
        assert!(checked > 1500);
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let cloud = SemanticCloud::unlabelled(corner(20_000));
            pool.install(|| PreparedCloud::new(cloud, &options(10)).unwrap())
        };
        let one = on(1);
        for threads in [2, 4] {
            let many = on(threads);
            assert_eq!(many.points_m(), one.points_m());
            assert_eq!(many.normals(), one.normals());
            assert_eq!(many.order(), one.order());
        }
    }

    #[test]
    fn nearest_respects_the_gate() {
        let prepared =
            PreparedCloud::new(SemanticCloud::unlabelled(corner(300)), &options(10)).unwrap();
        let above = prepared.points_m()[17] - Vector3::new(0.5, 0.5, 0.5);
        let (index, squared) = prepared.nearest(&above, 10.0).unwrap();
        let distance = |p: &Point3<f64>| nalgebra::distance_squared(p, &above);
        let least = prepared
            .points_m()
            .iter()
            .map(distance)
            .fold(f64::MAX, f64::min);
        assert!((squared - least).abs() < 1e-15);
        assert!((distance(&prepared.points_m()[index]) - least).abs() < 1e-15);
        assert_eq!(prepared.nearest(&above, 0.9 * least.sqrt()), None);
        for gate in [f64::NAN, -1.0] {
            assert_eq!(prepared.nearest(&above, gate), None);
        }
        let mut found = Neighbors::default();
        prepared.nearest_k(&above, 5, f64::INFINITY, &mut found);
        assert_eq!(found.len(), 5);
        assert_eq!(found.iter().next(), Some((index, squared)));
    }

    #[test]
    fn clouds_that_cannot_be_registered_are_refused() {
        let refused = |points_m: Vec<Point3<f64>>| {
            PreparedCloud::new(SemanticCloud::unlabelled(points_m), &options(10)).err()
        };
        use RegistrationError as E;
        assert_eq!(
            refused(vec![]),
            Some(E::TooFewPoints {
                points: 0,
                least: 3
            })
        );
        let with = |x: f64| {
            let mut points_m = corner(50);
            points_m[41].y = x;
            points_m
        };
        for bad in [f64::NAN, f64::INFINITY, -1e300] {
            assert_eq!(refused(with(bad)), Some(E::NotFinite { index: 41 }));
        }
        let equal = vec![Point3::new(1e6, 2.3, -0.1); 100];
        assert_eq!(refused(equal), Some(E::Collinear));
        let line = |i: i32| {
            Point3::new(1e3, -7.0, 0.1) + 0.3 * f64::from(i) * Vector3::new(0.1, 0.7, -0.3)
        };
        assert_eq!(refused((0..100).map(line).collect()), Some(E::Collinear));
        let mut cloud = SemanticCloud::unlabelled(corner(50));
        cloud.labels = vec![LabelDistribution::hard(1); 49];
        let error = PreparedCloud::new(cloud, &options(10)).err();
        assert_eq!(
            error,
            Some(E::LabelCount {
                labels: 49,
                points: 50
            })
        );
        let asked =
            |options| PreparedCloud::new(SemanticCloud::unlabelled(corner(50)), &options).err();
        assert!(matches!(asked(options(2)), Some(E::Neighbors { .. })));
        assert!(matches!(asked(options(65)), Some(E::Neighbors { .. })));
        let plane_epsilon = f64::NAN;
        let flat = PrepareOptions {
            plane_epsilon,
            ..options(10)
        };
        assert!(matches!(asked(flat), Some(E::PlaneEpsilon { .. })));
    }

    #[test]
    fn repeated_points_are_fine() {
        let mut points_m = corner(60);
        points_m.extend(vec![points_m[7]; 500]);
        let prepared =
            PreparedCloud::new(SemanticCloud::unlabelled(points_m), &options(20)).unwrap();
        assert!(
            prepared
                .normals()
                .iter()
                .all(|n| (n.norm() - 1.0).abs() < 1e-12)
        );
    }
}
