//! Network and intra-process delivery of bytes and messages, behind one abstract transport.

pub(crate) mod arrivals;
#[expect(unsafe_code, reason = "borrows sockets of the transport")]
pub(crate) mod confine;
#[expect(unsafe_code, reason = "calls the C API of Cyclone DDS")]
pub(crate) mod cyclone;
pub(crate) mod gaps;
pub(crate) mod local_bus;
pub(crate) mod loopback_domain;
pub(crate) mod outbox;
pub(crate) mod peers;
pub(crate) mod port;
pub mod qos;
pub(crate) mod remote;
#[cfg(feature = "zenoh")]
pub(crate) mod rmw_zenoh;
