//! `bag_recorder`: records topics of any type as a rosbag2 log.

mod cache;
mod choice;
mod controls;
mod definitions;
mod offered;
mod session;
mod writing;

use std::io::{IsTerminal, Write, stderr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::executables::{Files, start_runtime};
use crate::start::{NodeError, check_topics, open_params};
use cache::Cache;
use definitions::Definitions;
use lattice_bag::{BagWriter, Storage, WriterOptions};
use lattice_runtime::lock;
use lattice_runtime::ros_args::RosArgs;
use session::Session;
use writing::Written;

pub use choice::Choice;
pub use session::RecordedTopic;

/// Default name of the node.
pub const NAME: &str = "bag_recorder";

/// Discovery time if discovery is off afterwards.
const FIRST_LOOK: Duration = Duration::from_secs(3);
/// Period of status lines and of loss warnings.
const STATUS_PERIOD: Duration = Duration::from_secs(1);

/// Options of a recording.
#[derive(Clone, Debug)]
pub struct RecorderOptions {
    /// Folder of the bag, which must not exist.
    pub bag: PathBuf,
    /// Storage format.
    pub storage: Storage,
    /// Splitting and compression.
    pub writer: WriterOptions,
    /// Topics to record.
    pub choice: Choice,
    /// Folders with a subfolder per message package.
    pub msg_paths: Vec<PathBuf>,
    /// Limit of bytes that wait to be written.
    pub cache_bytes: usize,
    /// Duration of the recording.
    pub duration: Option<Duration>,
    /// False: only topics present at the start.
    pub discovery: bool,
    /// Period of topic discovery.
    pub polling: Duration,
    /// True: nothing is recorded before `~/resume`.
    pub start_paused: bool,
}

/// Result of a recording.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RecorderReport {
    /// Messages in the bag.
    pub messages: u64,
    /// Bytes of these messages.
    pub bytes: u64,
    /// Duration in seconds.
    pub seconds: f64,
    /// Topics.
    pub topics: Vec<RecordedTopic>,
}

/// Records until a signal or the end of the duration.
pub fn run(options: RecorderOptions, args: RosArgs) -> Result<RecorderReport, NodeError> {
    let runtime = start_runtime(NAME, args, &[(NAME, None)], Files::Shared)?;
    let node = runtime.node(NAME)?;
    let mut choice = options.choice;
    for topic in choice.topics.iter_mut().chain(&mut choice.exclude) {
        *topic = node.resolve(topic)?;
    }
    check_topics(node.params(), |_| false)?;
    open_params(node.params(), |_| Ok(()));
    let bag = BagWriter::create(&options.bag, options.storage, options.writer)?;
    let cache = Arc::new(Cache::new(options.cache_bytes));
    let written = Arc::new(Written::default());
    let shutdown = runtime.shutdown_handle();
    let writer = writing::spawn(bag, cache.clone(), written.clone(), shutdown.clone())?;
    let definitions = Definitions::new(&options.msg_paths);
    let mut session = Session::new(node, choice, definitions, cache, options.start_paused);
    let servers = controls::serve(&session)?;
    log::info!("recording to {}", options.bag.display());
    let begin = Instant::now();
    let mut status = Status::new(begin);
    let mut first_look_end = begin + FIRST_LOOK;
    while !shutdown.is_requested() && options.duration.is_none_or(|most| begin.elapsed() < most) {
        if !session.has_time() {
            first_look_end = Instant::now() + FIRST_LOOK;
        }
        if options.discovery || Instant::now() < first_look_end {
            session.look();
        }
        status.show(&session, &written);
        let left = options
            .duration
            .map(|most| most.saturating_sub(begin.elapsed()));
        shutdown.wait_timeout(options.polling.min(left.unwrap_or(options.polling)));
    }
    status.end();
    let topics = session.report();
    session.cache.close();
    let ended = writer.join();
    drop((servers, session));
    ended.map_err(|_| "the thread that writes the bag has failed")??;
    let refused = lock(&written.refused);
    let topics = topics.into_iter().map(|(place, mut topic)| {
        topic.not_written += refused.get(&place).copied().unwrap_or(0);
        topic
    });
    Ok(RecorderReport {
        messages: written.messages.load(Relaxed),
        bytes: written.bytes.load(Relaxed),
        seconds: begin.elapsed().as_secs_f64(),
        topics: topics.collect(),
    })
}

/// Status line in a terminal, and loss warnings.
struct Status {
    begin: Instant,
    due: Instant,
    before: (u64, u64),
    lost: u64,
    terminal: bool,
}

impl Status {
    fn new(begin: Instant) -> Self {
        Self {
            begin,
            due: begin + STATUS_PERIOD,
            before: (0, 0),
            lost: 0,
            terminal: stderr().is_terminal(),
        }
    }

    fn show(&mut self, session: &Session, written: &Written) {
        let now = Instant::now();
        if now < self.due {
            return;
        }
        let period_s = (now - self.due + STATUS_PERIOD).as_secs_f64();
        self.due = now + STATUS_PERIOD;
        let lost = session.lost();
        if lost > self.lost {
            let more = lost - self.lost;
            log::warn!("{more} messages lost in the last second, {lost} in total");
            self.lost = lost;
        }
        let (messages, bytes) = (written.messages.load(Relaxed), written.bytes.load(Relaxed));
        if self.terminal {
            let rate = (messages - self.before.0) as f64 / period_s;
            let rate_mb = (bytes - self.before.1) as f64 / period_s / 1e6;
            let paused = if session.paused.load(Relaxed) {
                ", paused"
            } else {
                ""
            };
            eprint!(
                "\r\x1b[K{:.0} s: {} topics, {messages} messages ({rate:.0}/s), {:.1} MB ({rate_mb:.1} MB/s), \
                 {lost} lost{paused}",
                self.begin.elapsed().as_secs_f64(),
                session.topics.len(),
                bytes as f64 / 1e6,
            );
            let _ = stderr().flush();
        }
        self.before = (messages, bytes);
    }

    fn end(&self) {
        if self.terminal {
            eprintln!();
        }
    }
}
