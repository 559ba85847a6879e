//! Nothing: the tests are in `tests/ros2_client`.
