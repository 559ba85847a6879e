//! Helpers of the tests.

pub mod clouds;
pub mod data;
pub mod domain;
pub mod flat;
pub mod maps;
pub mod peer;
pub mod python;
pub mod random;
pub mod static_layer;

lattice_msgs::include_messages! {
    /// Messages of a package that is not in `lattice_msgs`, made as a user makes them (`build.rs`).
    my_msgs,
}
