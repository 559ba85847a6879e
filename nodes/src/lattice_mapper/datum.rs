//! Automatic datum: the median of the first points, if those are far from the origin of
//! the map frame, as with UTM and MGRS coordinates.

use lattice_core::cloud::Cloud;
use lattice_core::raycast::FreeSpaceError;
use lattice_core::voxels::VoxelStore;
use nalgebra::Vector3;

use super::options::MapperOptions;
use super::state::LatticeMapper;

/// Automatic datums are multiples of this, m.
const DATUM_TILE_M: f64 = 1024.0;

impl LatticeMapper {
    /// Moves the datum of an empty map to the median of a cloud, if the cloud is out of half
    /// the range of keys from the origin.
    pub(super) fn choose_datum(&mut self, cloud: &Cloud) {
        let options = &self.options;
        let is_chosen = options.datum_is_given || options.datum_near_m != Vector3::zeros();
        if is_chosen || !self.is_empty() {
            return;
        }
        if let Some(middle_m) = middle_m(cloud)
            && !self.reaches_twice(&middle_m)
            && let Err(problem) = self.begin_at(&middle_m)
        {
            log::warn!("no datum near the points: {problem}");
        }
    }

    /// Restarts an empty map with its datum near a position in the map frame.
    fn begin_at(&mut self, place_m: &Vector3<f64>) -> Result<(), FreeSpaceError> {
        let datum_near_m = place_m.map(|v| (v / DATUM_TILE_M).round() * DATUM_TILE_M);
        let options = MapperOptions {
            datum_near_m,
            ..self.options.clone()
        };
        let begun = Self::new(options, self.epoch.wrapping_add(1))?;
        let before = std::mem::replace(self, begun);
        (self.counts, self.origin) = (before.counts, before.origin);
        let [x, y, z] = datum_near_m.into();
        log::warn!(
            "points are far from the origin of {}: keys are counted from [{x:.1}, {y:.1}, {z:.1}] (`datum_m`)",
            self.options.map_frame
        );
        Ok(())
    }

    fn reaches_twice(&self, point_m: &Vector3<f64>) -> bool {
        let datum_m = self.list.datum_m();
        self.list
            .key_of(&(datum_m + 2.0 * (point_m - datum_m)))
            .is_some()
    }

    fn is_empty(&self) -> bool {
        match &self.occupancy {
            Some(occupancy) => occupancy.is_empty(),
            None => self.list.is_empty(),
        }
    }
}

/// Medians of the coordinates, robust to outliers; `None` without finite points.
fn middle_m(cloud: &Cloud) -> Option<Vector3<f64>> {
    let points = (0..cloud.offsets_m.len()).map(|i| cloud.point_m(i));
    let points: Vec<_> = points.filter(|p| p.iter().all(|v| v.is_finite())).collect();
    let median = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        let half = values.len() / 2;
        (half < values.len()).then(|| *values.select_nth_unstable_by(half, f64::total_cmp).1)
    };
    Some(Vector3::new(median(0)?, median(1)?, median(2)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::cloud::{Precision, message_from_points};
    use crate::convert::geometry::header;
    use lattice_core::lattice::{Lattice, LatticeKind};

    fn options() -> MapperOptions {
        MapperOptions::new(Lattice::new(LatticeKind::Fcc, 0.001).unwrap())
    }

    /// Voxels of two clouds, the second one 100 m from the first, and the datum.
    fn map_at(place_m: [f64; 3], options: MapperOptions) -> (usize, Vector3<f64>) {
        let mut mapper = LatticeMapper::new(options, 1).unwrap();
        for east_m in [0.0, 100.0] {
            let points: Vec<_> = (0..100)
                .map(|i| {
                    Vector3::from(place_m) + Vector3::new(east_m + 0.37 * f64::from(i), 0.0, 0.0)
                })
                .collect();
            let message = message_from_points(header("map", 1), &points, Precision::Float64);
            mapper.on_cloud(&message).unwrap();
        }
        (mapper.list.len(), mapper.list.datum_m())
    }

    #[test]
    fn a_map_in_utm_is_that_near_the_origin() {
        let (voxels, datum_m) = map_at([0.0, 0.0, 0.0], options());
        assert_eq!((voxels, datum_m.norm()), (200, 0.0));
        let utm = [448_000.0, 5_411_000.0, 300.0];
        let (voxels, datum_m) = map_at(utm, options());
        assert_eq!(voxels, 200);
        assert!(
            (datum_m - Vector3::from(utm)).amax() < DATUM_TILE_M,
            "{datum_m}"
        );
    }

    #[test]
    fn a_datum_that_is_given_stays() {
        let given = MapperOptions {
            datum_is_given: true,
            ..options()
        };
        let (voxels, datum_m) = map_at([448_000.0, 5_411_000.0, 300.0], given);
        assert_eq!((voxels, datum_m.norm()), (0, 0.0));
    }
}
