//! The occupied voxel list.
