//! The server's logic with a search whose answers a test sets, and once with the true one.

mod bench;
mod looks;
mod requests;
mod searches;
