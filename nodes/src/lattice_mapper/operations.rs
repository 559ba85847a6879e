//! Map operations of services: load, clear a box, query.

use std::sync::Arc;

use lattice_core::query::{Query, QueryError, Segment, Shells};
use lattice_core::voxels::file::{MapContents, OperationError};
use lattice_core::voxels::{Region, RegionError, VoxelStore};
use lattice_msgs::geometry_msgs::Point;
use lattice_msgs::lattice::{ClearBoxRequest, ClearBoxResponse, QueryMapRequest, QueryMapResponse};
use nalgebra::Vector3;
use thiserror::Error;

use super::state::LatticeMapper;

/// Reason why a map was not loaded. The current map is unchanged.
#[derive(Debug, Error)]
pub enum LoadRefusal {
    /// Lattice other than that of the parameters.
    #[error(
        "the file has the lattice {theirs}, this node {ours}: set `lattice` and `cell_volume_m3`"
    )]
    Lattice {
        /// The lattice of the mapper.
        ours: String,
        /// The lattice of the file.
        theirs: String,
    },
    /// Cell too far from the mapper's datum.
    #[error(transparent)]
    Datum(#[from] OperationError),
    /// Voxels without stamps, where they are to expire.
    #[error("the file has no stamps, which `forget_after_s` needs: save it where that is set")]
    Stamps,
    /// Voxel count above the limit.
    #[error("the file has {voxels} voxels, more than `max_voxels` {max_voxels}")]
    TooMany {
        /// Voxels of the file.
        voxels: usize,
        /// Limit of the parameters.
        max_voxels: usize,
    },
}

impl LatticeMapper {
    /// Copy of the map as file contents.
    pub fn contents(&self) -> MapContents {
        match &self.occupancy {
            Some(occupancy) => MapContents::from_store(occupancy),
            None => MapContents::from_list(&self.list),
        }
    }

    /// Replaces the map and begins a new epoch, as [`LatticeMapper::reset`] does; returns the number
    /// of voxels. The lattice must be the mapper's; keys are converted to its datum.
    pub fn load(&mut self, contents: MapContents, epoch: u64) -> Result<usize, LoadRefusal> {
        let (lattice, payload) = (&self.options.lattice, self.options.payload());
        if contents.lattice() != lattice {
            return Err(LoadRefusal::Lattice {
                ours: format!("{lattice:?}"),
                theirs: format!("{:?}", contents.lattice()),
            });
        }
        if payload.stamps && !contents.payload().stamps {
            return Err(LoadRefusal::Stamps);
        }
        let (voxels, max_voxels) = (contents.keys().len(), self.list.max_voxels());
        if voxels > max_voxels {
            return Err(LoadRefusal::TooMany { voxels, max_voxels });
        }
        let contents = contents.with_datum(self.list.datum_index())?;
        if let Some(occupancy) = &mut self.occupancy {
            let loaded = contents.into_occupancy(occupancy.max_bytes());
            if loaded.len() < voxels {
                let max_voxels = loaded.len();
                return Err(LoadRefusal::TooMany { voxels, max_voxels });
            }
            occupancy.replace(loaded);
            self.begin(epoch);
            return Ok(voxels);
        }
        let list = contents.into_list_with(payload, max_voxels);
        self.list = list.with_when_full(self.options.when_full);
        self.begin(epoch);
        Ok(voxels)
    }

    /// Adopts the map of another mapper of the same lattice and begins a new epoch, as [`LatticeMapper::reset`] does.
    pub(super) fn take_map(&mut self, other: LatticeMapper, epoch: u64) {
        (self.list, self.occupancy) = (other.list, other.occupancy);
        self.begin(epoch);
        (self.stamps, self.last_stamp_ns) = (other.stamps, other.last_stamp_ns);
        self.forgot_at_ns = other.forgot_at_ns;
        // Limits may have changed since.
        self.set_options(self.options.clone());
    }

    /// Removes the voxels in a box.
    pub fn clear_box(&mut self, request: &ClearBoxRequest) -> ClearBoxResponse {
        let removed = region_of(request).map(|region| match &mut self.occupancy {
            Some(occupancy) => occupancy.remove_region(&region),
            None => self.list.remove_region(&region),
        });
        match removed {
            Ok(removed) => ClearBoxResponse {
                success: true,
                message: format!("{removed} voxels removed"),
                removed: removed as u64,
            },
            Err(error) => ClearBoxResponse {
                message: error.to_string(),
                ..ClearBoxResponse::default()
            },
        }
    }

    /// Queries occupancy around a point.
    pub fn query(&self, request: &QueryMapRequest) -> QueryMapResponse {
        self.ask(&vector(&request.point))
            .unwrap_or_else(|error| QueryMapResponse {
                message: error.to_string(),
                ..QueryMapResponse::default()
            })
    }

    fn ask(&self, point_m: &Vector3<f64>) -> Result<QueryMapResponse, QueryError> {
        match &self.occupancy {
            Some(occupancy) => self.ask_store(occupancy, point_m),
            None => self.ask_store(&self.list, point_m),
        }
    }

    fn ask_store(
        &self,
        store: &impl VoxelStore,
        point_m: &Vector3<f64>,
    ) -> Result<QueryMapResponse, QueryError> {
        let shells = self
            .shells
            .get_or_init(|| Arc::new(Shells::new(store.lattice())));
        let query = Query::with_shells(store, Arc::clone(shells));
        let key = query.occupied(point_m);
        let mut answer = QueryMapResponse {
            success: true,
            message: "the map is empty".to_owned(),
            occupied: key.is_some(),
            points: key
                .and_then(|key| self.list.get(key))
                .map_or(0, |voxel| voxel.count),
            ..QueryMapResponse::default()
        };
        let clearance = query.clearance(&Segment::point(*point_m), f64::INFINITY)?;
        let nearest = query.nearest(point_m, 1)?;
        if let (Some(clearance), Some(nearest)) = (clearance, nearest.first()) {
            let [x, y, z] = nearest.center_m.into();
            answer.message = format!("{:.3} m to the nearest voxel", clearance.distance_m);
            answer.has_nearest = true;
            answer.clearance_m = clearance.distance_m;
            answer.nearest = Point { x, y, z };
            answer.nearest_distance_m = nearest.distance_m;
        }
        Ok(answer)
    }
}

/// The box of a request.
pub(super) fn region_of(request: &ClearBoxRequest) -> Result<Region, RegionError> {
    Region::cuboid(vector(&request.min), vector(&request.max))
}

pub(super) fn vector(point: &Point) -> Vector3<f64> {
    Vector3::new(point.x, point.y, point.z)
}
