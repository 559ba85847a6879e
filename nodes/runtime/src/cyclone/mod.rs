//! The transport over Eclipse Cyclone DDS, whose C interface is the crate `cyclors`. All unsafe code of
//! the project is here and in `confine`.
//!
//! Endpoints are of "blob" topics: any type name, samples as serialised bytes.

mod arrivals;
mod blob;
mod config;
mod discovery;
mod domain;
mod endpoint;
mod entity;
mod log;
mod participant;
mod qos;
mod reader;
mod sample;
mod security;
mod strangers;
mod writer;

pub(crate) use participant::Cyclone;
