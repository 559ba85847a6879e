//! The DDS side of the runtime: everything that names a RustDDS type.

pub(crate) mod barrier;
pub(crate) mod events;
pub(crate) mod participant;
pub(crate) mod payload;
pub(crate) mod queue;
pub(crate) mod reader;
pub(crate) mod writer;
