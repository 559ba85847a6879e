//! Transport over Eclipse Cyclone DDS; the crate `lattice_cyclone_sys` binds its C interface. Unsafe Rust is
//! confined to this module and `confine`.
//!
//! Topics may have any type name; samples are serialized bytes.

mod builtin_topic;
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
