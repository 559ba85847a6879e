//! Height of a pose that rests on level surfaces which the two clouds may have seen from opposite sides.

use nalgebra::{Isometry3, Point3, RowVector6, Vector3, Vector6};

use super::candidates::{Candidate, RegistrationContext};
use super::covariance::PoseCovariance;

/// Absolute vertical component of the normal of a level surface.
const LEVEL: f64 = 0.8;
/// Largest distance of a point on a surface from it, in standard deviations: boards are thin.
const ON_SURFACE: f64 = 1.0;
/// Observations on level surfaces of certain side that determine the height.
const CERTAIN: f64 = 8.0;
/// Distance from a surface within which another one above or below it is searched, metres.
const REACH_M: f64 = 4.0;
/// Distance to that surface from which a sensor may have seen both from between, metres: ceilings and steps are nearer.
const ROOM_M: f64 = 0.4;
/// Distance to the sides within which it is searched too: not all of the floor beneath a table is seen, metres.
const BESIDE_M: f64 = 0.4;
/// Ratio of the stated standard deviation of the height to that of the likelihood: the error is the thickness of a board,
/// not normally distributed.
const WIDENED: f64 = 2.0;

/// Observations on level surfaces of a map.
#[derive(Default)]
struct Level {
    /// Observations on surfaces that both clouds saw from the same side.
    certain: f64,
    /// Points on surfaces that the clouds may have seen from opposite sides.
    is_doubtful: Vec<bool>,
}

impl RegistrationContext<'_> {
    /// Increases the variance of the height to that without surfaces of uncertain side, if hardly any others are level.
    ///
    /// The headset sees the top of a table and a robot its underside: a pose that takes the two for one surface is off
    /// by the thickness of the table, and fits.
    pub fn with_uncertain_sides(
        &self,
        candidate: &Candidate,
        covariance: PoseCovariance,
    ) -> PoseCovariance {
        let level = self.level(&candidate.target_from_source);
        if level.certain >= CERTAIN {
            return covariance;
        }
        let fit = self.fit.without(&level.is_doubtful);
        let variance = WIDENED.powi(2) * self.vertical_variance(candidate, &fit);
        let pose = &candidate.target_from_source;
        let gravity = self.options.gravity_sigma_rad;
        covariance.with_height_variance(pose, &self.centroid(), variance, gravity)
    }

    /// Points on level surfaces of the map at a pose.
    fn level(&self, pose: &Isometry3<f64>) -> Level {
        let (source, map) = (&self.source.full, &self.map.cloud);
        let scale = self.map.scale(self.options.noise_m);
        let sensor_z = self.source.sensor_m.map(|sensor_m| (pose * sensor_m).z);
        let mut level = Level::default();
        let points = source.points_m().iter().zip(source.normals());
        for (i, (point, normal)) in points.enumerate() {
            let place = pose * point;
            let is_level = |normal: &Vector3<f64>| normal.z.abs() > LEVEL;
            let near = map.nearest(&place, scale.gate_m());
            let partner = near.and_then(|(j, _)| map.points_m().get(j).zip(map.normals().get(j)));
            let both = partner.filter(|(_, theirs)| is_level(theirs) && is_level(&(pose * normal)));
            let Some((q, theirs)) = both else {
                level.is_doubtful.push(false);
                continue;
            };
            let has = |up: f64| self.has_room(q, &(Vector3::z() * up));
            let is_doubtful = match sensor_z {
                Some(sensor_z) if sensor_z > place.z => has(-1.0),
                Some(_) => has(1.0),
                None => has(-1.0) && has(1.0),
            };
            level.is_doubtful.push(is_doubtful);
            let off_m = theirs.dot(&(place - q)).abs();
            if !is_doubtful && off_m < ON_SURFACE * scale.normal_m {
                level.certain += self.fit.weight(i);
            }
        }
        level
    }

    /// Tests whether the map's sensor may have seen a surface from the side of a vertical direction: it has room there,
    /// and another surface at its end.
    fn has_room(&self, place_m: &Point3<f64>, direction: &Vector3<f64>) -> bool {
        let occupied = &self.map.occupied;
        let way_m = 2.0 * occupied.cell_m()..REACH_M;
        let sides = [0.0, -BESIDE_M, BESIDE_M];
        let mut columns = sides
            .iter()
            .flat_map(|x| sides.map(|y| Vector3::new(*x, y, 0.0)));
        columns.any(|side| {
            let other_m = occupied.distance_m(&(place_m + side), direction, way_m.clone());
            other_m.is_some_and(|other_m| other_m >= ROOM_M)
        })
    }
}

impl PoseCovariance {
    /// Increases the variance of the height of a source point, given gravity, to `variance`, m^2.
    fn with_height_variance(
        self,
        target_from_source: &Isometry3<f64>,
        point: &Point3<f64>,
        variance: f64,
        gravity_sigma_rad: f64,
    ) -> PoseCovariance {
        let held = self.with_gravity(target_from_source, gravity_sigma_rad);
        let held = held.unwrap_or(self).at_source;
        let up = target_from_source.inverse_transform_vector(&Vector3::z());
        let turning = point.coords.cross(&up);
        let lever = RowVector6::new(up.x, up.y, up.z, turning.x, turning.y, turning.z);
        let missing = variance - (lever * held * lever.transpose())[0];
        let motion = Vector6::new(up.x, up.y, up.z, 0.0, 0.0, 0.0);
        PoseCovariance {
            at_source: self.at_source + missing.max(0.0) * motion * motion.transpose(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::CalibrationMap;
    use super::super::request::{CalibrationOptions, CalibrationRequest, SourceCloud};
    use super::super::source::PreparedSource;
    use super::*;
    use crate::registration::SemanticCloud;

    /// Points of a level square about the vertical axis, 4 cm apart.
    fn level(half_m: f64, z_m: f64) -> impl Iterator<Item = Point3<f64>> {
        let n = (half_m / 0.04) as i32;
        let places = (-n..=n).flat_map(move |x| (-n..=n).map(move |y| (x, y)));
        places.map(move |(x, y)| Point3::new(0.04 * f64::from(x), 0.04 * f64::from(y), z_m))
    }

    /// Observations of certain side and number of doubtful points in a map of a table and the floor.
    fn seen(points_m: Vec<Point3<f64>>, sensor_m: Option<Point3<f64>>) -> (f64, usize) {
        let map_m = level(1.0, 0.7).chain(level(2.0, 0.0)).collect();
        let map = CalibrationMap::new(SemanticCloud::unlabelled(map_m), 0.05).unwrap();
        let cloud = SemanticCloud::unlabelled(points_m);
        let request = CalibrationRequest {
            source_clouds: &[SourceCloud { cloud, sensor_m }],
            start: None,
            confusion: None,
        };
        let options = CalibrationOptions::default();
        let source = PreparedSource::new(&request, &options, 0.05).unwrap();
        let context = RegistrationContext::new(&map, &source, &options, None);
        let level = context.level(&Isometry3::identity());
        let doubtful = level.is_doubtful.iter().filter(|is| **is).count();
        (level.certain, doubtful)
    }

    #[test]
    fn a_table_above_a_floor_may_have_been_seen_from_below() {
        let table: Vec<_> = level(1.0, 0.7).collect();
        let (certain, doubtful) = seen(table.clone(), Some(Point3::new(0.0, 0.0, 1.6)));
        assert!(certain == 0.0 && doubtful > 1000, "{certain} {doubtful}");
        // Its top cannot have been seen: nothing is above it.
        let (certain, doubtful) = seen(table.clone(), Some(Point3::new(0.0, 0.0, 0.3)));
        assert!(certain > CERTAIN && doubtful == 0, "{certain} {doubtful}");
        let (certain, doubtful) = seen(table, None);
        assert!(certain > CERTAIN && doubtful == 0, "{certain} {doubtful}");
    }

    #[test]
    fn a_floor_has_one_side() {
        let floor = level(1.5, 0.0).collect();
        let (certain, doubtful) = seen(floor, Some(Point3::new(0.0, 0.0, 1.6)));
        assert!(certain > CERTAIN && doubtful == 0, "{certain} {doubtful}");
    }

    #[test]
    fn the_variance_of_the_height_grows_to_a_value_and_never_falls() {
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 0.2, 0.3));
        let point = Point3::new(4.0, 5.0, 6.0);
        let covariance = PoseCovariance {
            at_source: nalgebra::Matrix6::identity() * 1e-6,
        };
        let height = |covariance: &PoseCovariance| {
            let directions = covariance.directions(&pose, &point);
            let of_place = directions.iter().take(3);
            of_place.map(|d| (d.axis.z * d.sigma).powi(2)).sum::<f64>()
        };
        let wide = covariance.with_height_variance(&pose, &point, 0.04, f64::INFINITY);
        assert!((height(&wide) - 0.04).abs() < 1e-9);
        assert_eq!(
            wide.with_height_variance(&pose, &point, 0.01, f64::INFINITY),
            wide
        );
    }
}
