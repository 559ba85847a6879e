//! Between messages and the core, without logic.
