//! Distance between convex shapes (Gilbert, Johnson & Keerthi 1988).
//!
//! Sub-simplices are found by exhaustive tests, which are slower than Johnson's recursion but robust against flat
//! ones.

use nalgebra::Vector3;

/// Relative error of the squared distance at which the iteration stops.
const PRECISION: f64 = 1e-13;
/// Distance relative to the size of the shapes below which they are in contact.
const CONTACT: f64 = 1e-12;
/// Maximum number of iterations, far above what polytopes need.
const MAX_STEPS: usize = 100;

/// Distance between two convex shapes, 0 if they touch or overlap.
///
/// `support` returns the point of the difference of the shapes (all a - b) farthest in a direction.
pub(super) fn distance_m(support: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> f64 {
    let mut simplex = Simplex::default();
    simplex.push(support(&Vector3::x()));
    let mut nearest = simplex.points[0];
    let mut size_squared = nearest.norm_squared();
    for _ in 0..MAX_STEPS {
        let squared = nearest.norm_squared();
        if squared <= CONTACT * CONTACT * size_squared {
            return 0.0;
        }
        let next = support(&-nearest);
        size_squared = size_squared.max(next.norm_squared());
        // No point of the difference is nearer to 0 than the plane through `next`.
        if squared - nearest.dot(&next) <= PRECISION * squared {
            break;
        }
        simplex.push(next);
        let (reduced, candidate) = simplex.nearest_to_origin();
        if candidate.norm_squared() >= squared {
            break;
        }
        (simplex, nearest) = (reduced, candidate);
    }
    nearest.norm()
}

#[derive(Clone, Copy, Default)]
struct Simplex {
    points: [Vector3<f64>; 4],
    len: usize,
}

impl Simplex {
    fn push(&mut self, point: Vector3<f64>) {
        if let Some(slot) = self.points.get_mut(self.len) {
            *slot = point;
            self.len += 1;
        }
    }

    fn without(&self, index: usize) -> Simplex {
        let mut rest = Simplex::default();
        for (i, point) in self.points.iter().enumerate().take(self.len) {
            if i != index {
                rest.push(*point);
            }
        }
        rest
    }

    /// Smallest sub-simplex that contains its point nearest to 0, and that point.
    fn nearest_to_origin(&self) -> (Simplex, Vector3<f64>) {
        let [a, b, c, d] = self.points;
        let inner = match self.len {
            0 | 1 => return (*self, a),
            2 => nearest_in_line(a, b),
            3 => nearest_in_triangle(a, b, c),
            _ => origin_in_tetrahedron(a, b, c, d).then(Vector3::zeros),
        };
        if let Some(nearest) = inner {
            return (*self, nearest);
        }
        let mut best = self.without(0).nearest_to_origin();
        for i in 1..self.len {
            let other = self.without(i).nearest_to_origin();
            if other.1.norm_squared() < best.1.norm_squared() {
                best = other;
            }
        }
        best
    }
}

/// Point of the line nearest to 0, if it is between the ends.
fn nearest_in_line(a: Vector3<f64>, b: Vector3<f64>) -> Option<Vector3<f64>> {
    let along = b - a;
    let t = -a.dot(&along) / along.norm_squared();
    (t > 0.0 && t < 1.0).then(|| a + along * t)
}

/// Point of the plane nearest to 0, if it is in the triangle and the triangle is not flat.
fn nearest_in_triangle(a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>) -> Option<Vector3<f64>> {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(&ac);
    let area_squared = normal.norm_squared();
    if area_squared <= 1e-24 * ab.norm_squared() * ac.norm_squared() {
        return None;
    }
    let inside = |p: Vector3<f64>, q: Vector3<f64>| p.cross(&q).dot(&normal) >= 0.0;
    (inside(a, b) && inside(b, c) && inside(c, a)).then(|| normal * (a.dot(&normal) / area_squared))
}

/// Tests whether 0 is inside the tetrahedron; false for a flat one.
fn origin_in_tetrahedron(
    a: Vector3<f64>,
    b: Vector3<f64>,
    c: Vector3<f64>,
    d: Vector3<f64>,
) -> bool {
    let (ab, ac, ad) = (b - a, c - a, d - a);
    let volume = ab.cross(&ac).dot(&ad);
    let size = ab.norm() * ac.norm() * ad.norm();
    if volume.abs() <= 1e-12 * size {
        return false;
    }
    // 0 is on the same side of each face as the opposite corner.
    let same_side = |p: Vector3<f64>, q: Vector3<f64>, r: Vector3<f64>, apex: Vector3<f64>| {
        let normal = (q - p).cross(&(r - p));
        normal.dot(&(apex - p)) * -normal.dot(&p) >= 0.0
    };
    same_side(a, b, c, d) && same_side(a, c, d, b) && same_side(a, d, b, c) && same_side(b, d, c, a)
}
