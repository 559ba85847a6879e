//! Thread that searches, and the way back of what it finds.

use std::io;
use std::sync::{Arc, Mutex};

use lattice_core::registration::Stage;

use super::search::{Done, Job, Search};
use crate::compute::{Compute, ComputeLimits, Inbox};
use lattice_runtime::{Shutdown, lock};

/// Progress and results of the search thread that the server has not taken yet.
#[derive(Default)]
struct SearchEvents {
    progress: Option<(u64, Stage, f64)>,
    done: Vec<(u64, Done)>,
}

/// Searches on a thread of its own, one job after another.
pub(super) struct SearchThread {
    compute: Compute<Option<Job>>,
    events: Arc<Mutex<SearchEvents>>,
}

/// Takes jobs for a [`SearchThread`], and has what became of them.
pub(super) struct SearchPort {
    inbox: Inbox<Option<Job>>,
    events: Arc<Mutex<SearchEvents>>,
}

impl SearchThread {
    /// Starts the thread with a pool of `threads`; `wake` is called on it whenever there is news, and
    /// may fail to be heard: news stay until they are taken.
    pub fn spawn(
        name: &str,
        threads: usize,
        shutdown: Shutdown,
        mut search: impl Search,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let events = Arc::<Mutex<SearchEvents>>::default();
        let results = Arc::clone(&events);
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
            let on_progress = |stage, fraction| {
                lock(&results).progress = Some((id, stage, fraction));
                wake();
            };
            let done = job.run(&mut search, on_progress);
            lock(&results).done.push((id, done));
            wake();
        })?;
        Ok(Self { compute, events })
    }

    /// Port at which jobs are handed in.
    pub fn port(&self) -> SearchPort {
        SearchPort {
            inbox: self.compute.inbox(),
            events: Arc::clone(&self.events),
        }
    }

    /// Waits for the job at work, and ends the thread.
    pub fn finish(self) {
        self.compute.finish_with(None);
    }
}

impl SearchPort {
    /// Hands in a job. False: the thread has ended, or has two already.
    pub fn begin(&self, job: Job) -> bool {
        self.inbox.send(Some(job), 0)
    }

    /// Progress of the running job, if that is news.
    pub fn take_progress(&self) -> Option<(u64, Stage, f64)> {
        lock(&self.events).progress.take()
    }

    /// Jobs that have ended since the last call.
    pub fn take_done(&self) -> Vec<(u64, Done)> {
        std::mem::take(&mut lock(&self.events).done)
    }
}
