//! A thread that runs tasks until it is stopped.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use futures::FutureExt;
use smol::channel::{Receiver, Sender, bounded};
use smol::{Executor, Task};

use super::shutdown::Shutdown;
use super::sync::lock;

/// Thread with an executor. A panicking task requests an orderly shutdown, with a message.
pub(crate) struct TaskThread {
    name: &'static str,
    shutdown: Shutdown,
    executor: Mutex<Option<Arc<Executor<'static>>>>,
    stop: Sender<()>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl TaskThread {
    pub(crate) fn start(name: &'static str, shutdown: Shutdown) -> std::io::Result<Self> {
        let executor = Arc::new(Executor::new());
        let (stop, stopped) = bounded(1);
        let runner = Arc::clone(&executor);
        let for_thread = shutdown.clone();
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || {
                run_catching_panics(name, &for_thread, || run(&runner, &stopped));
            })?;
        Ok(Self {
            name,
            shutdown,
            executor: Mutex::new(Some(executor)),
            stop,
            thread: Mutex::new(Some(thread)),
        })
    }

    /// Spawns a task on this thread. Dropping the handle cancels the task. `None`: already stopped.
    pub(crate) fn spawn(
        &self,
        task: impl Future<Output = ()> + Send + 'static,
    ) -> Option<Task<()>> {
        let (name, shutdown) = (self.name, self.shutdown.clone());
        // The executor stores a panic for the awaiting task, which does not exist.
        let task = AssertUnwindSafe(task).catch_unwind().map(move |result| {
            if result.is_err() {
                report_panic(name, &shutdown);
            }
        });
        let executor = lock(&self.executor);
        executor.as_ref().map(|executor| executor.spawn(task))
    }

    /// Stops the thread and drops its tasks. Not from one of them.
    pub(crate) fn stop(&self) {
        self.stop.close();
        if let Some(thread) = lock(&self.thread).take() {
            // The thread has reported its own panic.
            let _ = thread.join();
        }
        let executor = lock(&self.executor).take();
        drop(executor);
    }
}

impl Drop for TaskThread {
    fn drop(&mut self) {
        self.stop();
    }
}

fn run(executor: &Executor<'static>, stopped: &Receiver<()>) {
    // Without the reactor of smol: where two threads wait for it, the second one looks ten times after each event.
    smol::future::block_on(executor.run(async {
        // Ends when the sender closes.
        let _ = stopped.recv().await;
    }));
}

/// Runs the body of a thread; a panic is logged and requests a shutdown of the process.
pub fn run_catching_panics(name: &'static str, shutdown: &Shutdown, body: impl FnOnce()) {
    if catch_unwind(AssertUnwindSafe(body)).is_err() {
        report_panic(name, shutdown);
    }
}

fn report_panic(name: &'static str, shutdown: &Shutdown) {
    log::error!("thread {name} panicked; shutting down");
    shutdown.fail(name);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_run_and_a_panic_asks_for_shutdown() {
        let shutdown = Shutdown::default();
        let worker = TaskThread::start("test", shutdown.clone()).unwrap();
        let (sender, receiver) = bounded(1);
        let task = worker.spawn(async move { sender.send(42).await.unwrap() });
        assert_eq!(receiver.recv_blocking(), Ok(42));
        assert!(task.is_some());
        let task = worker.spawn(async { panic!("on purpose") }).unwrap();
        task.detach();
        shutdown.wait();
        assert_eq!(shutdown.failed_thread(), Some("test"));
        worker.stop();
        assert!(worker.spawn(async {}).is_none());
    }
}
