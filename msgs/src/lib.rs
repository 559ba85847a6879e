//! ROS 2 messages.
#![forbid(unsafe_code)]
