//! Map files written by commands.

use std::io::Write;
use std::path::Path;

use clap::Args;
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_core::voxels::label_names::{LabelNames, write_named};
use lattice_nodes::files::atomic_write;
use serde::Serialize;

use crate::CliResult;

/// Form of a map file.
#[derive(Args)]
pub struct Form {
    /// Compress with zstd, at a level from 1 to 19 (--zstd=LEVEL)
    #[arg(
        long, value_name = "LEVEL", num_args = 0..=1, require_equals = true,
        default_missing_value = "3", value_parser = clap::value_parser!(i32).range(1..=19),
    )]
    zstd: Option<i32>,
    /// Omit the counts and mean offsets of the voxels
    #[arg(long)]
    pub occupancy_only: bool,
}

/// Size of a written map file.
#[derive(Serialize)]
pub struct Written {
    voxels: usize,
    points: u64,
    file_bytes: u64,
    bytes_per_voxel: f64,
}

impl Form {
    /// Writes a map with the names of its labels, atomically.
    pub fn write(&self, map: &MapContents, names: &LabelNames, out: &Path) -> CliResult<Written> {
        let none = LabelNames::new();
        let kept = map.payload().labels && !self.occupancy_only;
        let names = if kept { names } else { &none };
        let options = WriteOptions {
            zstd_level: self.zstd,
            occupancy_only: self.occupancy_only,
        };
        let file_bytes = atomic_write::write(out, |writer| {
            let mut file = Counted { writer, bytes: 0 };
            write_named(map, names, &mut file, &options).map(|()| file.bytes)
        })?;
        let voxels = map.keys().len();
        Ok(Written {
            voxels,
            points: map.distortion().points,
            file_bytes,
            bytes_per_voxel: file_bytes as f64 / voxels.max(1) as f64,
        })
    }
}

impl Written {
    /// Prints the size, as JSON on request.
    pub fn print(&self, json: bool) -> Result<(), serde_json::Error> {
        if json {
            println!("{}", serde_json::to_string_pretty(self)?);
        } else {
            println!(
                "{} voxels, {} bytes, {:.2} a voxel",
                self.voxels, self.file_bytes, self.bytes_per_voxel
            );
        }
        Ok(())
    }
}

struct Counted<W> {
    writer: W,
    bytes: u64,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.writer.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.writer.flush()
    }
}
