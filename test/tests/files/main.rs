//! Files and messages against foreign libraries.

mod bags;
mod compatibility;
mod damaged_bags;
mod map_file_python;
mod msgs_conformance;
mod point_files;
