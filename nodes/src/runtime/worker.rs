//! A thread that runs tasks until it is told to stop.

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use smol::channel::{Receiver, Sender, bounded};
use smol::{Executor, Task};

use super::shutdown::Shutdown;
use super::sync::lock;

/// One thread with its tasks. A task that panics ends the process in good order, with a message.
pub(crate) struct Worker {
    executor: Mutex<Option<Arc<Executor<'static>>>>,
    stop: Sender<()>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl Worker {
    pub(crate) fn start(name: &'static str, shutdown: Shutdown) -> std::io::Result<Self> {
        let executor = Arc::new(Executor::new());
        let (stop, stopped) = bounded(1);
        let runner = Arc::clone(&executor);
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || {
                guarded(name, &shutdown, || run(&runner, &stopped));
            })?;
        Ok(Self {
            executor: Mutex::new(Some(executor)),
            stop,
            thread: Mutex::new(Some(thread)),
        })
    }

    /// Runs a task on this thread. Dropping the handle ends the task. `None`: stopped already.
    pub(crate) fn spawn<T: Send + 'static>(
        &self,
        task: impl Future<Output = T> + Send + 'static,
    ) -> Option<Task<T>> {
        lock(&self.executor).as_ref().map(|executor| executor.spawn(task))
    }

    /// Stops the thread and drops its tasks. Not from one of them.
    pub(crate) fn stop(&self) {
        self.stop.close();
        if let Some(thread) = lock(&self.thread).take() {
            // Its panic has been reported by the thread itself.
            let _ = thread.join();
        }
        let executor = lock(&self.executor).take();
        drop(executor);
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop();
    }
}

fn run(executor: &Executor<'static>, stopped: &Receiver<()>) {
    smol::block_on(executor.run(async {
        // Ends when the sender closes.
        let _ = stopped.recv().await;
    }));
}

/// Runs the body of a thread; a panic asks the process to shut down instead of passing unseen.
pub(crate) fn guarded(name: &'static str, shutdown: &Shutdown, body: impl FnOnce()) {
    if catch_unwind(AssertUnwindSafe(body)).is_err() {
        log::error!("thread {name} panicked; shutting down");
        shutdown.fail(name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_run_and_a_panic_asks_for_shutdown() {
        let shutdown = Shutdown::default();
        let worker = Worker::start("test", shutdown.clone()).unwrap();
        assert_eq!(smol::block_on(worker.spawn(async { 6 * 7 }).unwrap()), 42);
        let task = worker.spawn(async { panic!("on purpose") }).unwrap();
        task.detach();
        shutdown.wait();
        assert_eq!(shutdown.failed_thread(), Some("test"));
        worker.stop();
        assert!(worker.spawn(async {}).is_none());
    }
}
