//! The voxel list of a map, which threads of Python share.

use std::sync::Arc;

use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::MapContents;
use parking_lot::RwLock;
use pyo3::prelude::*;

use crate::threads::{PATIENCE, on_pool};

/// A list behind one lock.
///
/// Nobody waits for the lock with the GIL or on a thread of the pool, and no Python runs under the lock: so none of the
/// three waits for another.
#[derive(Clone)]
pub struct SharedList(Arc<RwLock<VoxelList>>);

impl SharedList {
    pub fn new(list: VoxelList) -> SharedList {
        SharedList(Arc::new(RwLock::new(list)))
    }

    /// Runs on the list beside other readers, for well below a second.
    pub fn read<T: Send>(
        &self,
        py: Python<'_>,
        run: impl FnOnce(&VoxelList) -> T + Send,
    ) -> PyResult<T> {
        let mut run = Some(run);
        loop {
            let answer = py.detach(|| {
                let list = self.0.try_read_for(PATIENCE)?;
                run.take().map(|run| run(&list))
            });
            py.check_signals()?;
            if let Some(answer) = answer {
                return Ok(answer);
            }
        }
    }

    /// Changes the list, for well below a second.
    pub fn write<T: Send>(
        &self,
        py: Python<'_>,
        run: impl FnOnce(&mut VoxelList) -> T + Send,
    ) -> PyResult<T> {
        let mut run = Some(run);
        loop {
            let answer = py.detach(|| {
                let mut list = self.0.try_write_for(PATIENCE)?;
                run.take().map(|run| run(&mut list))
            });
            py.check_signals()?;
            if let Some(answer) = answer {
                return Ok(answer);
            }
        }
    }

    /// Runs on the list from a thread without the GIL, however long.
    pub fn read_away<T>(&self, run: impl FnOnce(&VoxelList) -> T) -> T {
        run(&self.0.read())
    }

    /// Changes the list from a thread without the GIL, however long.
    pub fn write_away<T>(&self, run: impl FnOnce(&mut VoxelList) -> T) -> T {
        run(&mut self.0.write())
    }

    /// A copy from a thread without the GIL.
    pub fn copied(&self) -> PyResult<MapContents> {
        self.read_away(|list| on_pool(|| MapContents::from_list(list)))
    }
}
