//! Structs, definitions and bytes of the messages.

mod definitions;
mod hostile;
mod shape;
