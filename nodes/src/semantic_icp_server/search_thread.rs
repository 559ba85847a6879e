//! Search thread, and its events for the server.

use std::io;
use std::sync::{Arc, Mutex};

use lattice_core::registration::Stage;

use super::search::{Done, Job, Search};
use crate::compute::{Compute, ComputeLimits, Inbox};
use lattice_runtime::{Shutdown, lock};

/// Progress and results that the server has not taken yet.
#[derive(Default)]
struct SearchEvents {
    progress: Option<(u64, Stage, f64)>,
    done: Vec<(u64, Done)>,
}

/// Thread that runs one job after another.
pub(super) struct SearchThread {
    compute: Compute<Option<Job>>,
    events: Arc<Mutex<SearchEvents>>,
}

/// Port for jobs and events of a [`SearchThread`].
pub(super) struct SearchPort {
    inbox: Inbox<Option<Job>>,
    events: Arc<Mutex<SearchEvents>>,
}

impl SearchThread {
    /// Starts the thread with a pool of `threads`; it calls `wake` at each event. A failed
    /// `wake` loses nothing: events stay until they are taken.
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

    /// Port for jobs and events.
    pub fn port(&self) -> SearchPort {
        SearchPort {
            inbox: self.compute.inbox(),
            events: Arc::clone(&self.events),
        }
    }

    /// Waits for the running job, and ends the thread.
    pub fn finish(self) {
        self.compute.finish_with(None);
    }
}

impl SearchPort {
    /// Queues a job. False: the thread has ended, or has two jobs already.
    pub fn begin(&self, job: Job) -> bool {
        self.inbox.send(Some(job), 0)
    }

    /// New progress of the running job, if any.
    pub fn take_progress(&self) -> Option<(u64, Stage, f64)> {
        lock(&self.events).progress.take()
    }

    /// Jobs that have ended since the last call.
    pub fn take_done(&self) -> Vec<(u64, Done)> {
        std::mem::take(&mut lock(&self.events).done)
    }
}
