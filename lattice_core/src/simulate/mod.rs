//! Simulated machines and sites with a noise-free truth.
