//! What rcl does and ros2-client does not.
