//! Rules of the architecture that the compiler does not know.

mod counters;
mod crates;
mod cycles;
mod docs;
mod launch;
mod modules;
mod params;
mod security;
mod source;
mod supply;
mod tokens;
mod words;

use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}
