//! Files and messages against foreign libraries.

mod bags;
mod compatibility;
mod damaged_bags;
mod map_file_python;
mod msgs_conformance;
mod octrees;
mod point_files;
