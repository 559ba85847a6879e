//! The thread that searches, and the way back of what it finds.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lattice_core::registration::Stage;

use super::search::{Done, Job, Search};
use crate::compute::{Compute, ComputeLimits, Inbox};
use lattice_runtime::Shutdown;

/// What the searching thread has to tell.
#[derive(Default)]
struct News {
    progress: Option<(u64, Stage, f64)>,
    done: Vec<(u64, Done)>,
}

/// Searches on a thread of its own, one job after another.
pub(super) struct Worker {
    compute: Compute<Option<Job>>,
    news: Arc<Mutex<News>>,
}

/// Takes jobs for a [`Worker`], and has what became of them.
pub(super) struct WorkerPort {
    inbox: Inbox<Option<Job>>,
    news: Arc<Mutex<News>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Worker {
    /// Starts the thread with a pool of `threads`; `wake` is called on it whenever there is news, and
    /// may fail to be heard: what is told stays until it is taken.
    pub fn spawn(
        name: &str,
        threads: usize,
        shutdown: Shutdown,
        mut search: impl Search,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let news = Arc::<Mutex<News>>::default();
        let told = Arc::clone(&news);
        let limits = ComputeLimits {
            events: 2,
            bytes: 0,
            threads,
        };
        let compute = Compute::spawn(name, limits, shutdown, move |job: Option<Job>| {
            let Some(job) = job else {
                return;
            };
            let id = job.id;
            let tell = |stage, fraction| {
                lock(&told).progress = Some((id, stage, fraction));
                wake();
            };
            let done = job.run(&mut search, tell);
            lock(&told).done.push((id, done));
            wake();
        })?;
        Ok(Self { compute, news })
    }

    /// Where jobs are handed in.
    pub fn port(&self) -> WorkerPort {
        WorkerPort {
            inbox: self.compute.inbox(),
            news: Arc::clone(&self.news),
        }
    }

    /// Waits for the job at work, and ends the thread.
    pub fn finish(self) {
        self.compute.finish_with(None);
    }
}

impl WorkerPort {
    /// Hands in a job. False: the thread has ended, or has two already.
    pub fn begin(&self, job: Job) -> bool {
        self.inbox.send(Some(job), 0)
    }

    /// How far the job at work is, if that is news.
    pub fn take_progress(&self) -> Option<(u64, Stage, f64)> {
        lock(&self.news).progress.take()
    }

    /// What has ended since the last call.
    pub fn take_done(&self) -> Vec<(u64, Done)> {
        std::mem::take(&mut lock(&self.news).done)
    }
}
