//! The voxel list of a map, which threads of Python share.

use std::sync::Arc;

use lattice_core::query::{PreparedNearest, Query, Shells};
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::MapContents;
use parking_lot::{Mutex, RwLock};
use pyo3::prelude::*;

use crate::threads::{PATIENCE, on_pool};

/// A tree of all cells takes the time of half a neighbour for each, so that it is soon worth it, and stays until the map
/// changes: from a neighbour for each so many cells on.
const WORTH: usize = 8;

/// A list behind one lock.
///
/// Nobody waits for the lock with the GIL or on a thread of the pool, and no Python runs under the lock: so none of the
/// three waits for another.
#[derive(Clone)]
pub struct SharedList(Arc<Shared>);

struct Shared {
    list: RwLock<VoxelList>,
    asked: Mutex<Asked>,
}

/// Questions about the list as it is now.
#[derive(Default)]
struct Asked {
    /// Neighbours that were asked for.
    neighbors: usize,
    /// The tree of its cells, once that is worth it.
    prepared: Option<PreparedNearest>,
}

impl SharedList {
    pub fn new(list: VoxelList) -> SharedList {
        SharedList(Arc::new(Shared {
            list: RwLock::new(list),
            asked: Mutex::default(),
        }))
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
                let list = self.0.list.try_read_for(PATIENCE)?;
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
                let mut list = self.0.list.try_write_for(PATIENCE)?;
                *self.0.asked.lock() = Asked::default();
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
        run(&self.0.list.read())
    }

    /// Changes the list from a thread without the GIL, however long.
    pub fn write_away<T>(&self, run: impl FnOnce(&mut VoxelList) -> T) -> T {
        let mut list = self.0.list.write();
        *self.0.asked.lock() = Asked::default();
        run(&mut list)
    }

    /// Questions about the list, from a thread without the GIL that will ask for so many neighbours. `list` is read-locked.
    pub fn questions<'a>(
        &self,
        list: &'a VoxelList,
        shells: Arc<Shells>,
        neighbors: usize,
    ) -> Query<'a, VoxelList> {
        let questions = Query::with_shells(list, shells);
        let mut asked = self.0.asked.lock();
        asked.neighbors = asked.neighbors.saturating_add(neighbors);
        if asked.prepared.is_none() && asked.neighbors > list.len() / WORTH {
            asked.prepared = on_pool(|| questions.prepare_nearest()).ok().flatten();
        }
        match &asked.prepared {
            Some(prepared) => questions.with_prepared(prepared.clone()),
            None => questions,
        }
    }

    /// A copy from a thread without the GIL.
    pub fn copied(&self) -> PyResult<MapContents> {
        self.read_away(|list| on_pool(|| MapContents::from_list(list)))
    }
}
