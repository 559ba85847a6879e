//! Waits of the playback for subscribers, during which commands are executed.

use std::mem;
use std::thread;
use std::time::{Duration, Instant};

use lattice_runtime::Node;

use super::commands::SLICE;
use super::lockstep::Lockstep;
use super::playback::Playback;
use crate::start::{LAST_FLUSH, NodeError};

/// Flush timeout at the end.
const FLUSH_TIME: Duration = Duration::from_secs(20);

impl Playback {
    /// Waits until each of these topics has a subscriber, or until the timeout.
    pub(super) fn wait_for(&mut self, names: &[String], timeout: Duration) {
        let deadline = Instant::now() + timeout;
        for index in 0..self.topics.len() {
            let topic = self.player.topics().get(index);
            let name = topic.map(|topic| &topic.info.name);
            let Some(name) = name.filter(|name| names.contains(name)).cloned() else {
                continue;
            };
            while self.is_unheard(index) && self.obey() {
                if Instant::now() >= deadline {
                    log::warn!("{name}: no subscriber, playing without one");
                    break;
                }
                thread::sleep(SLICE);
            }
        }
    }

    fn is_unheard(&self, topic: usize) -> bool {
        let publisher = self.topics.get(topic);
        publisher.is_some_and(|publisher| publisher.subscriber_count() == 0)
    }

    /// Waits for `time`, or until shutdown.
    pub(super) fn settle(&mut self, time: Duration) {
        let deadline = Instant::now() + time;
        while Instant::now() < deadline && self.obey() {
            thread::sleep(SLICE);
        }
    }

    /// Starts the lockstep of pairs of topics.
    pub(super) fn start_lockstep(
        &mut self,
        pairs: &[String],
        node: &Node,
        timeout: Duration,
    ) -> Result<(), NodeError> {
        let topics = self.player.topics().iter();
        let played: Vec<String> = topics.map(|topic| topic.info.name.clone()).collect();
        self.lockstep = Lockstep::start(pairs, &played, node, timeout, &mut || self.obey())?;
        Ok(())
    }

    /// Waits for acknowledgements at the end.
    pub(super) fn flush(&mut self) {
        self.ended = true;
        let deadline = |hurried| {
            Instant::now()
                + match hurried {
                    true => LAST_FLUSH,
                    false => FLUSH_TIME,
                }
        };
        if let Some(steps) = self.steps.take() {
            steps.end();
        }
        let mut is_hurried = self.shutdown.is_requested();
        let mut end = deadline(is_hurried);
        let lockstep = mem::take(&mut self.lockstep);
        let shutdown = self.shutdown.clone();
        lockstep.finish(end - Instant::now(), &mut || {
            self.obey();
            is_hurried || !shutdown.is_requested()
        });
        self.report.acknowledged = true;
        for index in 0..self.topics.len() {
            let mut acknowledged = false;
            while let Some(publisher) = self.topics.get(index) {
                if self.shutdown.is_requested() && !is_hurried {
                    is_hurried = true;
                    end = end.min(deadline(true));
                }
                let left = end.saturating_duration_since(Instant::now());
                acknowledged = publisher.flush(left.min(SLICE));
                if acknowledged || left.is_zero() {
                    break;
                }
                self.obey();
            }
            if let Some(publisher) = self.topics.get(index).filter(|_| !acknowledged) {
                self.report.acknowledged = false;
                log::warn!("{}: not all messages were acknowledged", publisher.topic());
            }
        }
        self.obey();
        self.report.unacknowledged = self.unacknowledged();
        let (played, late_ms) = (self.report.messages, self.report.latest_ms);
        match self.report.losses() {
            None => log::info!("{played} messages played, at most {late_ms} ms late"),
            Some(losses) => {
                log::warn!("{played} messages played, at most {late_ms} ms late; {losses}");
            }
        }
    }
}
