//! A person who walks over the site, for maps that must forget what moves.

use super::ground::ground_height_m;
use super::obstacles::Post;
use super::site::Hit;
use nalgebra::{Vector2, Vector3};

/// Way over the ground east of the pit, in sight of the loader, m.
const WAY_M: [[f64; 2]; 4] = [[-5.0, 26.5], [-6.5, 19.0], [-3.0, 12.0], [0.0, 9.5]];
const SPEED_MPS: f64 = 1.3;
/// Steps that are ahead of the loader's first move, s.
const START_S: f64 = 0.5;
const RADIUS_M: f64 = 0.25;
const HEIGHT_M: f64 = 1.75;
const REFLECTIVITY: f64 = 0.4;

/// An upright cylinder of the size of a person that walks through the yard once and is gone.
#[derive(Clone, Copy, Debug)]
pub struct Person;

impl Person {
    /// Times of the first and last step, s.
    #[cfg(test)]
    pub fn span_s() -> [f64; 2] {
        let legs = WAY_M.windows(2).map(|leg| match leg {
            [from, to] => (Vector2::from(*to) - Vector2::from(*from)).norm(),
            _ => 0.0,
        });
        [START_S, START_S + legs.sum::<f64>() / SPEED_MPS]
    }

    /// The cylinder at a time, `None` before the first and after the last step.
    pub fn at(time_s: f64) -> Option<Post> {
        let mut left_m = (time_s - START_S) * SPEED_MPS;
        if left_m < 0.0 {
            return None;
        }
        for leg in WAY_M.windows(2) {
            let [from, to] = <[[f64; 2]; 2]>::try_from(leg).ok()?.map(Vector2::from);
            let length_m = (to - from).norm();
            if left_m <= length_m {
                let center_m = from + (to - from) * (left_m / length_m);
                let foot_m = ground_height_m(center_m.x, center_m.y);
                return Some(Post {
                    center_m,
                    radius_m: RADIUS_M,
                    span_m: [foot_m, foot_m + HEIGHT_M],
                });
            }
            left_m -= length_m;
        }
        None
    }

    /// The hit of a ray on the person, if that is nearer than `hit`; `hit` otherwise.
    pub(super) fn before(
        hit: Option<Hit>,
        time_s: f64,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<Hit> {
        let Some((range_m, normal)) = Self::at(time_s).and_then(|p| p.cast(origin, direction))
        else {
            return hit;
        };
        if hit.is_some_and(|hit| hit.range_m <= range_m) {
            return hit;
        }
        Some(Hit {
            range_m,
            cos_incidence: -normal.dot(direction),
            reflectivity: REFLECTIVITY,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{loader::Loader, site::Site};

    #[test]
    fn walks_on_the_ground_clear_of_the_loader_and_of_what_stands_there() {
        let (site, loader) = (Site::earth_moving(), Loader::new(1));
        let [start_s, end_s] = Person::span_s();
        assert!(Person::at(start_s - 0.1).is_none() && Person::at(end_s + 0.1).is_none());
        for step in 0..=100 {
            let time_s = start_s + (end_s - start_s) * f64::from(step) * 0.009_999;
            let person = Person::at(time_s).unwrap();
            let machine = loader.map_from_base(time_s).translation.vector.xy();
            assert!((person.center_m - machine).norm() > 3.0, "{time_s} s");
            for obstacle in site.obstacles() {
                let clearance_m = obstacle.ground_clearance_m(&person.center_m);
                assert!(clearance_m > RADIUS_M, "{clearance_m} m at {time_s} s");
            }
        }
    }
}
