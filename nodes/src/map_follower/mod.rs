//! Follower of `voxel_map` and `voxel_map_updates`: keyframes, deltas, gaps and late joining.

mod followed;
mod followed_map;
mod follower;
mod incomplete;
mod keyframe;

pub use followed::{FollowError, Followed};
pub use followed_map::FollowedMap;
pub use follower::MapFollower;
