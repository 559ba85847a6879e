//! Maps to files and back, in memory.

use lattice_core::voxels::VoxelStore;
use lattice_core::voxels::file::{MapContents, WriteOptions, read_occupancy};

use super::{Report, timed};

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
    res_m: f64,
) -> Result<Report, Box<dyn std::error::Error + Send + Sync>> {
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
    let mut report = Report::new(sys, store.lattice().kind().name(), res_m, spent);
    report.n = store.len() as u64;
    report.voxels = store.len() as u64;
    report.bytes = bytes.len() as u64;
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{InsertOptions, Store, insert};
    use lattice_core::lattice::{Lattice, LatticeKind};

    #[test]
    fn both_ways_report_the_same_file() {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.001).unwrap();
        let points = (0..500).map(|i| [0.05 * i as f32, 0.3, 1.0]).collect();
        let options = InsertOptions {
            store: Store::Occupancy,
            res_m: 0.1,
        };
        let (_, store) = insert(options, &lattice, points, None).unwrap();
        for zstd_level in [None, Some(3)] {
            let run = |method| file(method, store.as_ref(), zstd_level, 0.1).unwrap();
            let (saved, loaded) = (run(FileMethod::Save), run(FileMethod::Load));
            assert!(saved.bytes > 0 && saved.bytes == loaded.bytes);
            assert!(saved.voxels > 100 && saved.voxels == loaded.voxels);
        }
    }
}
