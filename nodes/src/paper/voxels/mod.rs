//! Ryde & Brünig, "Lattice Occupied Voxel Lists for Representation of Spatial Occupancy".
