//! The transport over Eclipse Cyclone DDS, whose C interface is the crate `lattice_cyclone_sys`. All unsafe
//! Rust of the project is here and in `confine`.
//!
//! Topics are of any type name, samples are serialised bytes.

mod config;
mod discovery;
mod domain;
mod endpoint;
mod entity;
mod log;
mod names;
mod participant;
mod qos;
mod reader;
mod sample;
mod security;
mod unauthenticated_participants;
mod writer;

pub(crate) use participant::Cyclone;
