//! What a house cannot be used for.

use thiserror::Error;

use super::Scene;
use crate::mesh::MeshError;
use crate::options::OutOfRange;
use lattice_core::voxels::DatumError;

/// Why a house, a survey or a trial was not made.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum HouseError {
    /// The mesh itself.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The house stands too far from the origin of the map for a lattice.
    #[error(transparent)]
    Datum(#[from] DatumError),
    /// Wider than any house.
    #[error("the mesh is {size_m} m long, but at most {most_m} m are taken; check the unit")]
    TooLarge {
        /// Longest side, metres.
        size_m: f64,
        /// The most that is taken, metres.
        most_m: f64,
    },
    /// More things than there are numbers.
    #[error("the mesh has {regions} instances and patches of walls, at most 65000 are taken")]
    TooManyRegions {
        /// How many.
        regions: usize,
    },
    /// Nowhere to stand.
    #[error(
        "there is no free floor within walls; the mesh must have a floor, walls and room to stand between them"
    )]
    NoFreeSpace,
    /// No place from which the object of a scene is seen.
    #[error(
        "no free place from {near_m} to {far_m} m away from which the {object} of the scene is seen; does the mesh have one that is labelled so?"
    )]
    NoView {
        /// The scene.
        scene: Scene,
        /// Class of its object.
        object: &'static str,
        /// Nearest distance looked at, metres.
        near_m: f64,
        /// Farthest distance looked at, metres.
        far_m: f64,
    },
    /// An option out of its range.
    #[error(transparent)]
    Option(#[from] OutOfRange),
}
