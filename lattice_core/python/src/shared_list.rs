//! Voxel list of a map, shared between Python threads.

use std::sync::Arc;

use lattice_core::query::{PreparedNearest, Query, Shells};
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::MapContents;
use parking_lot::{Mutex, RwLock};
use pyo3::prelude::*;

use crate::threads::{PATIENCE, on_pool};

/// Queried neighbours per cell from which a tree of all cells pays off: building it takes the time of half a
/// neighbour per cell, and it is kept until the map changes.
const WORTH: usize = 8;

/// List behind one lock.
///
/// The lock is never awaited with the GIL or on a pool thread, and no Python runs under it, so they cannot deadlock.
#[derive(Clone)]
pub struct SharedList(Arc<Shared>);

struct Shared {
    list: RwLock<VoxelList>,
    asked: Mutex<Asked>,
}

/// Queries of the current list.
#[derive(Default)]
struct Asked {
    /// Number of neighbours requested.
    neighbors: usize,
    /// Tree of its cells, once it pays off.
    prepared: Option<PreparedNearest>,
}

impl SharedList {
    pub fn new(list: VoxelList) -> SharedList {
        SharedList(Arc::new(Shared {
            list: RwLock::new(list),
            asked: Mutex::default(),
        }))
    }

    /// Reads the list beside other readers. `run` has to take well below a second: signals are handled only before
    /// and after it.
    ///
    /// # Errors
    /// The exception of a signal handler, such as `KeyboardInterrupt`.
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

    /// Changes the list and drops its search tree. `run` has to take well below a second, as in [`SharedList::read`].
    ///
    /// # Errors
    /// The exception of a signal handler, such as `KeyboardInterrupt`.
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

    /// Reads the list from a thread without the GIL; `run` may take any time.
    pub fn read_away<T>(&self, run: impl FnOnce(&VoxelList) -> T) -> T {
        run(&self.0.list.read())
    }

    /// Changes the list from a thread without the GIL; `run` may take any time.
    pub fn write_away<T>(&self, run: impl FnOnce(&mut VoxelList) -> T) -> T {
        let mut list = self.0.list.write();
        *self.0.asked.lock() = Asked::default();
        run(&mut list)
    }

    /// Query on the read-locked list, for `neighbors` neighbours in total. To be called from a thread without the
    /// GIL.
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

    /// Copies the list, from a thread without the GIL.
    pub fn copied(&self) -> PyResult<MapContents> {
        self.read_away(|list| on_pool(|| MapContents::from_list(list)))
    }
}
