//! Solids of a town, and the distances at which rays meet them.

use nalgebra::{Point3, Vector3};

/// Depth of windows, metres, and their spacing along a wall and up it.
const WINDOW_M: f64 = 0.2;
const WINDOWS_M: [f64; 2] = [2.6, 3.0];

/// Form of a solid, metres.
#[derive(Clone, Debug)]
pub(in crate::simulate) enum Form {
    /// A box; with windows in its walls or none.
    Block {
        low: Point3<f64>,
        high: Point3<f64>,
        windows: bool,
    },
    /// An upright cylinder.
    Pillar {
        foot: Point3<f64>,
        radius: f64,
        height: f64,
    },
    /// A sphere of leaves that rays go into.
    Crown { center: Point3<f64>, radius: f64 },
}

/// A form with its class.
#[derive(Clone, Debug)]
pub(in crate::simulate) struct Solid {
    pub form: Form,
    pub label: u16,
}

impl Solid {
    /// The solid at another place.
    pub fn moved(&self, by: &Vector3<f64>) -> Solid {
        let mut moved = self.clone();
        match &mut moved.form {
            Form::Block { low, high, .. } => {
                *low += by;
                *high += by;
            }
            Form::Pillar { foot, .. } => *foot += by,
            Form::Crown { center, .. } => *center += by,
        }
        moved
    }

    /// Middle and radius of a circle about it in the plane, metres.
    pub fn circle(&self) -> (Point3<f64>, f64) {
        match &self.form {
            Form::Block { low, high, .. } => {
                let middle = nalgebra::center(low, high);
                (middle, (high - low).xy().norm() / 2.0)
            }
            Form::Pillar { foot, radius, .. } => (*foot, *radius),
            Form::Crown { center, radius } => (*center, *radius),
        }
    }

    /// Distance along a ray, metres; `depth` in [0, 1) says how far it goes into leaves.
    pub fn hit(&self, eye: &Point3<f64>, way: &Vector3<f64>, depth: f64) -> Option<f64> {
        match &self.form {
            Form::Block { low, high, windows } => {
                let (distance, axis) = enter(eye, way, low, high)?;
                let place = eye + way * distance;
                let is_window = *windows && axis < 2 && is_window(place[1 - axis], place.z);
                let recess = if is_window {
                    WINDOW_M / way[axis].abs().max(0.3)
                } else {
                    0.0
                };
                Some(distance + recess)
            }
            Form::Pillar {
                foot,
                radius,
                height,
            } => {
                let off = eye - foot;
                let (distance, _) = chord(&off.xy().push(0.0), &way.xy().push(0.0), *radius)?;
                let z = off.z + way.z * distance;
                (0.0..=*height).contains(&z).then_some(distance)
            }
            Form::Crown { center, radius } => {
                let (from, to) = chord(&(eye - center), way, *radius)?;
                Some(from + depth * 0.7 * (to - from))
            }
        }
    }
}

/// Distance at which a ray enters a box, and the axis of the sides that it enters through.
fn enter(
    eye: &Point3<f64>,
    way: &Vector3<f64>,
    low: &Point3<f64>,
    high: &Point3<f64>,
) -> Option<(f64, usize)> {
    let (mut from, mut to, mut side) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for axis in 0..3 {
        let [a, b] = [low, high].map(|end| (end[axis] - eye[axis]) / way[axis]);
        let (near, far) = (a.min(b), a.max(b));
        if near > from {
            (from, side) = (near, axis);
        }
        to = to.min(far);
    }
    (from > 0.0 && from <= to).then_some((from, side))
}

/// Distances at which a ray enters and leaves a sphere about 0, or a cylinder if z is 0 in both.
fn chord(off: &Vector3<f64>, way: &Vector3<f64>, radius: f64) -> Option<(f64, f64)> {
    let a = way.norm_squared();
    let half = off.dot(way);
    let root = half * half - a * (off.norm_squared() - radius * radius);
    let width = (root >= 0.0).then(|| root.sqrt())?;
    let from = (-half - width) / a;
    (from > 0.0).then_some((from, (-half + width) / a))
}

/// True in the windows of a wall, by the place along and up it.
fn is_window(along_m: f64, up_m: f64) -> bool {
    let part = |place: f64, spacing: f64| (place / spacing).rem_euclid(1.0);
    (0.25..0.7).contains(&part(along_m, WINDOWS_M[0]))
        && (0.3..0.75).contains(&part(up_m, WINDOWS_M[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_solids_where_they_stand() {
        let eye = Point3::new(0.0, 0.1, 1.0);
        let block = |windows| Solid {
            form: Form::Block {
                low: Point3::new(5.0, -3.0, 0.0),
                high: Point3::new(9.0, 3.0, 6.0),
                windows,
            },
            label: 1,
        };
        let ahead = Vector3::x();
        assert_eq!(block(false).hit(&eye, &ahead, 0.0), Some(5.0));
        assert_eq!(block(false).hit(&eye, &-ahead, 0.0), None);
        assert_eq!(
            block(true).hit(&eye, &ahead, 0.0),
            Some(5.0),
            "beside a window"
        );
        let up = Point3::new(0.0, 1.0, 1.2);
        assert_eq!(block(true).hit(&up, &ahead, 0.0), Some(5.0 + WINDOW_M));
        let pillar = Solid {
            form: Form::Pillar {
                foot: Point3::new(4.0, 0.1, 0.0),
                radius: 0.5,
                height: 2.0,
            },
            label: 2,
        };
        assert_eq!(pillar.hit(&eye, &ahead, 0.0), Some(3.5));
        assert_eq!(pillar.hit(&(eye + Vector3::z() * 2.0), &ahead, 0.0), None);
        let crown = Solid {
            form: Form::Crown {
                center: Point3::new(4.0, 0.1, 1.0),
                radius: 1.0,
            },
            label: 3,
        };
        assert_eq!(crown.hit(&eye, &ahead, 0.0), Some(3.0));
        assert!(
            crown
                .hit(&eye, &ahead, 0.9)
                .is_some_and(|d| d > 4.0 && d < 5.0)
        );
    }
}
