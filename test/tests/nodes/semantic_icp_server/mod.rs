//! The server's logic with a search that answers as it is told, and once with the true one.

mod bench;
mod looks;
mod requests;
mod searches;
