//! Poses on SE(3): buffers that interpolate and never extrapolate.
