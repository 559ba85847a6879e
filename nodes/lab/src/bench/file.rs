//! Maps to files and back, in memory.

use super::{Report, timed};
use crate::AnyError;
use lattice_core::voxels::VoxelStore;
use lattice_core::voxels::file::{MapContents, WriteOptions, read_occupancy};

/// Direction of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileMethod {
    /// Store to the bytes of a file.
    Save,
    /// Bytes of a file to a store.
    Load,
}

/// Saves or loads the occupied cells of a store; `bytes` is the size of the file.
pub fn file(
    method: FileMethod,
    store: &dyn VoxelStore,
    zstd_level: Option<i32>,
) -> Result<Report, AnyError> {
    let options = WriteOptions {
        zstd_level,
        occupancy_only: true,
    };
    let mut bytes = Vec::new();
    let (saved, saving) = timed(|| MapContents::from_store(store).write(&mut bytes, &options));
    saved?;
    let (loaded, loading) = timed(|| read_occupancy(&bytes[..], usize::MAX));
    let loaded = loaded?;
    if loaded.sorted_keys() != store.sorted_keys() {
        return Err("the map that was loaded is not the one that was saved".into());
    }
    let (sys, spent) = match method {
        FileMethod::Save => ("lattice-save", saving),
        FileMethod::Load => ("lattice-load", loading),
    };
    Ok(Report {
        n: store.len() as u64,
        voxels: store.len() as u64,
        bytes: bytes.len() as u64,
        ..Report::new(sys, store.lattice(), spent)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{Store, insert};
    use lattice_core::lattice::{Lattice, LatticeKind};

    #[test]
    fn both_ways_report_the_same_file() {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.001).unwrap();
        let points = (0..500).map(|i| [0.05 * i as f32, 0.3, 1.0]).collect();
        let (_, store) = insert(Store::Occupancy, &lattice, points, None).unwrap();
        for zstd_level in [None, Some(3)] {
            let run = |method| file(method, store.as_ref(), zstd_level).unwrap();
            let (saved, loaded) = (run(FileMethod::Save), run(FileMethod::Load));
            assert!(saved.bytes > 0 && saved.bytes == loaded.bytes);
            assert!(saved.voxels > 100 && saved.voxels == loaded.voxels);
        }
    }
}
