//! rosbag2 directories: reading, writing and playing.
