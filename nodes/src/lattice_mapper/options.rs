//! Parameters of the mapper.

use lattice_core::lattice::{Lattice, LatticeKind, Orientation};
use lattice_core::voxels::{OccupancyList, Payload, VoxelList, WhenFull};
use nalgebra::Vector3;

use super::free_options::MappedFreeSpace;
use crate::convert::semantic::LabelOptions;
use crate::options;
use crate::stamps::StampGate;
use lattice_runtime::params::{ParamError, Params};

/// Options of a [`super::LatticeMapper`].
#[derive(Clone, Debug)]
pub struct MapperOptions {
    /// Lattice, cell volume and orientation.
    pub lattice: Lattice,
    /// Frame of the map, required of clouds.
    pub map_frame: String,
    /// Position in the map frame near the datum, metres.
    pub datum_near_m: Vector3<f64>,
    /// True if this position is used for any points; otherwise it is replaced by a position near the first
    /// points if those are out of range.
    pub datum_is_given: bool,
    /// Voxel limit.
    pub max_voxels: usize,
    /// Memory limit for voxels, which may be reached before `max_voxels`; 0: none.
    pub max_map_bytes: usize,
    /// Policy for points in new cells of a full map.
    pub when_full: WhenFull,
    /// Age limit of a voxel by the stamps of clouds, ns; 0: none. Requires stamps of all voxels.
    pub forget_after_ns: i64,
    /// Limit of points per cloud.
    pub max_cloud_points: usize,
    /// Label conversion for label counts in each voxel; `None`: labels are not kept.
    pub labels: Option<LabelOptions>,
    /// True if colours are summed in each voxel.
    pub keep_color: bool,
    /// Largest serialized message of `voxel_map`, `voxel_map_updates` and `free`, bytes.
    pub chunk_bytes: usize,
    /// Payload of a voxel: one bit, or count and mean point.
    pub payload: MapPayload,
    /// Free space options.
    pub free_space: MappedFreeSpace,
}

const SECOND_NS: i64 = 1_000_000_000;
/// Consecutive clouds whose stamps must agree on another time before it is accepted.
const AGREEING_CLOUDS: u32 = 5;

/// Payload of voxels.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum MapPayload {
    /// Count and mean of the points, with optional stamps or labels.
    #[default]
    Centroid,
    /// Occupancy only: 2 to 3 bytes a voxel.
    Occupancy,
}

/// Values of the parameter `payload`.
const PAYLOADS: [(&str, MapPayload); 2] = [
    ("centroid", MapPayload::Centroid),
    ("occupancy", MapPayload::Occupancy),
];

/// Values of the parameter `when_full`.
const WHEN_FULL: [(&str, WhenFull); 2] = [
    ("refuse", WhenFull::Refuse),
    ("forget_oldest", WhenFull::ForgetOldest),
];

impl MapperOptions {
    /// Defaults for a lattice: frame `map`, datum at its origin.
    pub fn new(lattice: Lattice) -> Self {
        Self {
            lattice,
            map_frame: "map".into(),
            datum_near_m: Vector3::zeros(),
            datum_is_given: false,
            max_voxels: 20_000_000,
            max_map_bytes: 0,
            when_full: WhenFull::Refuse,
            forget_after_ns: 0,
            max_cloud_points: 4_000_000,
            labels: None,
            keep_color: false,
            chunk_bytes: 60_000,
            payload: MapPayload::Centroid,
            free_space: MappedFreeSpace::default(),
        }
    }

    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let name = params.string("lattice", "fcc")?;
        let kind: LatticeKind = name
            .parse()
            .map_err(|e| params.invalid("lattice", format!("{e}")))?;
        let lattice = Lattice::new(kind, cell_volume_m3(params)?)
            .map_err(|e| params.invalid("cell_volume_m3", format!("{e}")))?;
        let lattice = Self::orientation_from(params)
            .map(|orientation| lattice.with_orientation(orientation))?
            .map_err(|e| params.invalid("lattice_orientation", format!("{e}")))?;
        let defaults = Self::new(lattice);
        let read = Self {
            map_frame: options::frame(params, "map_frame", &defaults.map_frame)?,
            datum_near_m: options::place_m(params, "datum_m")?,
            datum_is_given: params.is_given("datum_m"),
            max_voxels: params.positive("max_voxels", defaults.max_voxels)?,
            max_map_bytes: params.usize("max_map_bytes", defaults.max_map_bytes)?,
            when_full: options::one_of(params, "when_full", &WHEN_FULL)?,
            forget_after_ns: forget_after_ns(params)?,
            max_cloud_points: params.positive("max_cloud_points", defaults.max_cloud_points)?,
            labels: Self::labels_from(params)?,
            keep_color: params.bool("keep_color", false)?,
            chunk_bytes: options::chunk_bytes(params, defaults.chunk_bytes)?,
            payload: options::one_of(params, "payload", &PAYLOADS)?,
            free_space: MappedFreeSpace::from_params(params)?,
            ..defaults
        };
        if read.payload == MapPayload::Occupancy && !read.payload().is_plain() {
            let problem = "occupancy has no stamps, labels or colours: needs centroid with \
                           forget_after_s, keep_labels or keep_color";
            return Err(params.invalid("payload", problem));
        }
        if read.payload == MapPayload::Occupancy && read.when_full != WhenFull::Refuse {
            let problem = "payload occupancy has no stamps to find the oldest voxel: needs refuse";
            return Err(params.invalid("when_full", problem));
        }
        if read.voxel_limit() == 0 {
            let problem = "less memory than one voxel needs; a small map needs 1000000";
            return Err(params.invalid("max_map_bytes", problem));
        }
        Ok(read)
    }

    fn labels_from(params: &Params) -> Result<Option<LabelOptions>, ParamError> {
        let options = LabelOptions::from_params(params)?;
        Ok(params.bool("keep_labels", false)?.then_some(options))
    }

    /// Orientation of the lattice given by the parameters.
    pub fn orientation_from(params: &Params) -> Result<Orientation, ParamError> {
        let name = params.string("lattice_orientation", "paper")?;
        name.parse()
            .map_err(|e| params.invalid("lattice_orientation", format!("{e}")))
    }

    /// Stamp check of clouds, if voxels expire.
    pub(super) fn stamp_gate(&self) -> Option<StampGate> {
        let age_ns = self.forget_after_ns;
        let step_ns = (age_ns / 2).max(SECOND_NS);
        (age_ns > 0).then(|| StampGate::new(step_ns, step_ns, AGREEING_CLOUDS))
    }

    /// Payload columns of centroid voxels.
    pub(super) fn payload(&self) -> Payload {
        Payload {
            stamps: self.forget_after_ns > 0,
            labels: self.labels.is_some(),
            color: self.keep_color,
        }
    }

    /// Voxel limit that satisfies both limits.
    pub(super) fn voxel_limit(&self) -> usize {
        match self.max_map_bytes {
            0 => self.max_voxels,
            bytes if self.payload == MapPayload::Occupancy => {
                (self.max_voxels).min(OccupancyList::max_voxels_within(bytes))
            }
            bytes => (self.max_voxels).min(VoxelList::voxels_within(bytes, self.payload())),
        }
    }
}

/// Cell volume, given by one of two parameters.
fn cell_volume_m3(params: &Params) -> Result<f64, ParamError> {
    let volume_m3 = params.f64("cell_volume_m3", 0.125)?;
    let size_m = params.f64("cell_size_m", 0.0)?;
    if size_m == 0.0 {
        return Ok(volume_m3);
    }
    let problem = if !(1e-3..=1e3).contains(&size_m) {
        "expected 0.001 to 1000 m, or 0.0 for that of `cell_volume_m3`"
    } else if params.is_given("cell_volume_m3") {
        "`cell_volume_m3` is given too: remove one of them"
    } else {
        return Ok(cube_m3(size_m));
    };
    Err(params.invalid("cell_size_m", problem))
}

/// Volume of a cube by its edge, m^3, rounded to fifteen digits: 0.05 m gives 0.000125, so that
/// cells by size and by volume are equal to the bit.
pub fn cube_m3(edge_m: f64) -> f64 {
    let cube = edge_m * edge_m * edge_m;
    format!("{cube:.14e}").parse().unwrap_or(cube)
}

fn forget_after_ns(params: &Params) -> Result<i64, ParamError> {
    let seconds = params.f64("forget_after_s", 0.0)?;
    // At most a century; less than a millisecond is not a useful age.
    if seconds == 0.0 || (1e-3..=3e9).contains(&seconds) {
        return Ok((seconds * 1e9) as i64);
    }
    let problem = format!("{seconds}, expected 0 (never) or 0.001 to 3e9");
    Err(params.invalid("forget_after_s", problem))
}

#[cfg(test)]
mod tests {
    use lattice_runtime::params::ParamValue;

    use super::*;

    fn volume_m3(values: &[(&str, f64)]) -> Result<f64, String> {
        let values = values.iter().map(|&(name, v)| (name, ParamValue::F64(v)));
        let params = Params::from_values("/lattice_mapper", values);
        let options = MapperOptions::from_params(&params);
        let volume = options.map(|options| options.lattice.cell_volume_m3());
        volume.map_err(|error| error.to_string())
    }

    #[test]
    fn cubes_are_as_one_types_them() {
        for (edge_m, cube) in [(0.05, 0.000125), (0.2, 0.008), (0.7, 0.343), (0.1, 0.001)] {
            assert_eq!(cube_m3(edge_m), cube);
        }
        assert_eq!((cube_m3(1e-3), cube_m3(1e3)), (1e-9, 1e9));
    }

    #[test]
    fn cells_have_a_volume_or_a_size() {
        assert_eq!(volume_m3(&[]), Ok(0.125));
        assert_eq!(volume_m3(&[("cell_volume_m3", 2.0)]), Ok(2.0));
        assert_eq!(volume_m3(&[("cell_size_m", 0.25)]), Ok(0.015625));
        let unset = [("cell_size_m", 0.0), ("cell_volume_m3", 2.0)];
        assert_eq!(volume_m3(&unset), Ok(2.0));
        let both = volume_m3(&[("cell_size_m", 0.25), ("cell_volume_m3", 2.0)]);
        let refusal = both.unwrap_err();
        let names_both = refusal.contains("`cell_volume_m3`") && refusal.contains("cell_size_m");
        assert!(names_both, "{refusal}");
        for size_m in [-0.2, 1e-4, 1e4, f64::INFINITY] {
            let refusal = volume_m3(&[("cell_size_m", size_m)]).unwrap_err();
            assert!(refusal.contains("expected 0.001 to 1000 m"), "{refusal}");
        }
    }
}
