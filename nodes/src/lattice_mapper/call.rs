//! Requests of services for the compute thread.

use std::sync::Arc;

use lattice_core::voxels::file::MapContents;
use lattice_msgs::lattice::{
    ClearBoxRequest, ClearBoxResponse, LoadMapResponse, PlanPathRequest, PlanPathResponse,
    QueryMapRequest, QueryMapResponse, SaveMapRequest, SaveMapResponse,
};
use lattice_msgs::octomap_msgs::{BoundingBoxQueryResponse, GetOctomapResponse};
use lattice_runtime::Reply;

use super::plan::Planner;
use crate::octree::OctreeForm;

/// Request handled by the compute thread.
pub(super) enum Call {
    Save(SaveMapRequest, Reply<SaveMapResponse>),
    /// Load the map that was read.
    Load(Box<MapContents>, Reply<LoadMapResponse>),
    ClearBox(ClearBoxRequest, Reply<ClearBoxResponse>),
    ClearBoundingBox(ClearBoxRequest, Reply<BoundingBoxQueryResponse>),
    Query(QueryMapRequest, Reply<QueryMapResponse>),
    /// Encode an octree.
    Octomap(OctreeForm, Reply<GetOctomapResponse>),
    /// Plan a path with the reserved planner.
    Plan(PlanPathRequest, Reply<PlanPathResponse>, Arc<Planner>),
}
