//! Shared threads of calls, and signal handling while they work.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use lattice_core::registration::{Progress, Stage};
use parking_lot::Mutex;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Time between two checks for signals, well below a second.
pub const PATIENCE: Duration = Duration::from_millis(50);

/// Thread pool of this process; a forked child creates its own.
static POOL: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);

/// Runs on the pool of this process, with `RAYON_NUM_THREADS` threads or one per core.
pub fn on_pool<T: Send>(run: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = {
        let mut known = POOL.lock();
        match *known {
            Some((process, pool)) if process == std::process::id() => pool,
            _ => {
                let pool: &'static ThreadPool = Box::leak(Box::new(pool_of(0)?));
                *known = Some((std::process::id(), pool));
                pool
            }
        }
    };
    Ok(pool.install(run))
}

/// Runs on `threads` threads of its own, or on the pool of this process.
pub fn on_threads<T: Send>(threads: Option<usize>, run: impl FnOnce() -> T + Send) -> PyResult<T> {
    match threads {
        Some(threads) => Ok(pool_of(threads)?.install(run)),
        None => on_pool(run),
    }
}

fn pool_of(threads: usize) -> PyResult<ThreadPool> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| PyRuntimeError::new_err(format!("no threads: {error}")))
}

/// Runs a part of a call, well below a second, without the GIL, then the signal handlers.
pub fn step<T: Send>(py: Python<'_>, run: impl FnOnce() -> T + Send) -> PyResult<T> {
    let answer = py.detach(|| on_pool(run))?;
    py.check_signals()?;
    Ok(answer)
}

/// Set when the waiting call was interrupted.
#[derive(Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl Progress for Stop {
    fn report(&self, _stage: Stage, _fraction: f64) -> ControlFlow<()> {
        match self.is_set() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// Runs an indivisible call on its own thread without the GIL, and the signal handlers meanwhile.
///
/// If a handler raises, the work is detached: it owns its data, and ends where it checks `Stop`.
pub fn background<T: Send + 'static>(
    py: Python<'_>,
    run: impl FnOnce(&Stop) -> T + Send + 'static,
) -> PyResult<T> {
    let stop = Stop::default();
    let (send, receive) = sync_channel(1);
    let of_work = stop.clone();
    let thread = std::thread::Builder::new().spawn(move || {
        // The result of an interrupted call is dropped.
        let _ = send.send(run(&of_work));
    });
    thread.map_err(|error| PyRuntimeError::new_err(format!("no thread: {error}")))?;
    wait(py, &stop, receive)
}

fn wait<T: Send>(py: Python<'_>, stop: &Stop, receive: Receiver<T>) -> PyResult<T> {
    // The receiver is not `Sync`, but only such values may be used without the GIL.
    let receive = Mutex::new(receive);
    loop {
        match py.detach(|| receive.lock().recv_timeout(PATIENCE)) {
            Ok(answer) => return Ok(answer),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(raised) = py.check_signals() {
                    stop.0.store(true, Ordering::Relaxed);
                    return Err(raised);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the thread of the call panicked"));
            }
        }
    }
}

/// [`background`] for work that borrows and ends soon after `Stop` is set: the call waits for it.
pub fn watched<T: Send>(py: Python<'_>, run: impl FnOnce(&Stop) -> T + Send) -> PyResult<T> {
    let stop = Stop::default();
    let (send, receive) = sync_channel(1);
    std::thread::scope(|scope| {
        let of_work = stop.clone();
        let thread = std::thread::Builder::new().spawn_scoped(scope, move || {
            let _ = send.send(run(&of_work));
        });
        thread.map_err(|error| PyRuntimeError::new_err(format!("no thread: {error}")))?;
        wait(py, &stop, receive)
    })
}
