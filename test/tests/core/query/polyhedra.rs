//! Distance between polyhedra by trying every pair of corners, edges and triangles.

use nalgebra::Vector3;

type Point = Vector3<f64>;

/// A convex body as triangles, or as a point or line.
#[derive(Clone, Debug)]
pub struct Body {
    pub corners: Vec<Point>,
    pub edges: Vec<[Point; 2]>,
    pub triangles: Vec<[Point; 3]>,
}

impl Body {
    /// From triangles that turn counter-clockwise seen from outside.
    pub fn solid(triangles: Vec<[Point; 3]>) -> Body {
        let edges = triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        Body {
            corners: triangles.iter().flatten().copied().collect(),
            edges: edges.collect(),
            triangles,
        }
    }

    /// A line or, with equal ends, a point.
    pub fn line(a: Point, b: Point) -> Body {
        Body {
            corners: vec![a, b],
            edges: vec![[a, b]],
            triangles: Vec::new(),
        }
    }

    fn contains(&self, p: &Point) -> bool {
        let below = |[a, b, c]: &[Point; 3]| (b - a).cross(&(c - a)).dot(&(p - a)) <= 0.0;
        !self.triangles.is_empty() && self.triangles.iter().all(below)
    }

    /// Distance to another body, 0 if they touch or overlap.
    pub fn distance(&self, other: &Body) -> f64 {
        let inside = |a: &Body, b: &Body| a.corners.iter().any(|p| b.contains(p));
        let pierced = |a: &Body, b: &Body| {
            let hit = |e: &[Point; 2]| b.triangles.iter().any(|t| pierces(e, t));
            a.edges.iter().any(hit)
        };
        if inside(self, other)
            || inside(other, self)
            || pierced(self, other)
            || pierced(other, self)
        {
            return 0.0;
        }
        let mut least = f64::MAX;
        for (a, b) in [(self, other), (other, self)] {
            for p in &a.corners {
                for t in &b.triangles {
                    least = least.min(to_triangle(p, t));
                }
            }
        }
        for e in &self.edges {
            for f in &other.edges {
                least = least.min(between_lines(e, f));
            }
        }
        least
    }
}

fn pierces([p, q]: &[Point; 2], [a, b, c]: &[Point; 3]) -> bool {
    let normal = (b - a).cross(&(c - a));
    let (above, below) = (normal.dot(&(p - a)), normal.dot(&(q - a)));
    if above * below >= 0.0 {
        return false;
    }
    let hit = p + (q - p) * (above / (above - below));
    let left = |s: &Point, t: &Point| (t - s).cross(&(hit - s)).dot(&normal) >= 0.0;
    left(a, b) && left(b, c) && left(c, a)
}

/// To the inside of a triangle; its border is left to the edges.
fn to_triangle(p: &Point, [a, b, c]: &[Point; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a)).normalize();
    let foot = p - normal * normal.dot(&(p - a));
    let left = |s: &Point, t: &Point| (t - s).cross(&(foot - s)).dot(&normal) >= 0.0;
    if left(a, b) && left(b, c) && left(c, a) {
        (p - foot).norm()
    } else {
        f64::MAX
    }
}

fn to_line(p: &Point, [a, b]: &[Point; 2]) -> f64 {
    let along = b - a;
    let t = (p - a).dot(&along) / along.norm_squared();
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    (p - (a + along * t)).norm()
}

/// Either the feet of the common perpendicular are on both lines, or an end is nearest.
fn between_lines(e: &[Point; 2], f: &[Point; 2]) -> f64 {
    let ends = [
        to_line(&e[0], f),
        to_line(&e[1], f),
        to_line(&f[0], e),
        to_line(&f[1], e),
    ];
    let least = ends.into_iter().fold(f64::MAX, f64::min);
    let (u, v, w) = (e[1] - e[0], f[1] - f[0], f[0] - e[0]);
    let n = u.cross(&v);
    let s = w.cross(&v).dot(&n) / n.norm_squared();
    let t = w.cross(&u).dot(&n) / n.norm_squared();
    let within = |x: f64| (0.0..=1.0).contains(&x);
    if within(s) && within(t) {
        least.min((w + v * t - u * s).norm())
    } else {
        least
    }
}
