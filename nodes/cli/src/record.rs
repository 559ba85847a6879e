//! `lattice record`: records topics as a rosbag2 log, with the options of `ros2 bag record`.

use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use clap::{Args, ValueEnum};
use lattice_bag::{Compression, Storage, WriterOptions};
use lattice_nodes::bag_recorder::{self, Choice, RecorderOptions, RecorderReport};
use lattice_runtime::ros_args::RosArgs;
use regex::Regex;

use crate::{CliResult, calendar};

/// Storage format.
#[derive(Clone, Copy, ValueEnum)]
enum StorageName {
    Mcap,
    Sqlite3,
}

/// Unit of compression.
#[derive(Clone, Copy, ValueEnum)]
enum CompressionMode {
    None,
    File,
    Message,
}

/// Compression format.
#[derive(Clone, Copy, ValueEnum)]
enum CompressionFormat {
    Zstd,
}

/// Record topics of any type as a rosbag2 log, until Ctrl-C
#[derive(Args)]
pub struct Record {
    /// Topics
    topics: Vec<String>,
    /// Record all topics
    #[arg(long, short)]
    all: bool,
    /// Record topics whose names match
    #[arg(long, short = 'e')]
    regex: Option<Regex>,
    /// Exclude topics whose names match
    #[arg(long, short = 'x', alias = "exclude")]
    exclude_regex: Option<Regex>,
    /// Exclude these topics
    #[arg(long, num_args = 1.., value_name = "TOPIC")]
    exclude_topics: Vec<String>,
    /// Record hidden topics too: those with a part that begins with `_`
    #[arg(long)]
    include_hidden_topics: bool,
    /// Folder of the log, which must not exist; by default rosbag2_ and the time (UTC)
    #[arg(long, short)]
    output: Option<PathBuf>,
    /// Storage format
    #[arg(long, short, value_enum, default_value = "mcap")]
    storage: StorageName,
    /// Message bytes after which a new file begins; 0: never
    #[arg(long, short = 'b', default_value_t = 0, value_name = "BYTES")]
    max_bag_size: u64,
    /// Duration in seconds after which a new file begins; 0: never
    #[arg(long, short = 'd', default_value_t = 0, value_name = "S")]
    max_bag_duration: u32,
    /// Unit of compression
    #[arg(long, value_enum, default_value = "none")]
    compression_mode: CompressionMode,
    /// Compression format
    #[arg(long, value_enum, default_value = "zstd")]
    compression_format: CompressionFormat,
    /// Limit of message bytes that wait to be written; excess messages are lost, and counted
    #[arg(long, default_value_t = 100 << 20, value_name = "BYTES")]
    max_cache_size: usize,
    /// Duration of the recording, s
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// Record only topics present at the start
    #[arg(long)]
    no_discovery: bool,
    /// Period of topic discovery, ms
    #[arg(long, short, default_value_t = 100, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..))]
    polling_interval: u32,
    /// Stamp messages with /clock; only latched messages are recorded before its first message,
    /// with its stamp
    #[arg(long)]
    use_sim_time: bool,
    /// Record nothing until a call of ~/resume
    #[arg(long)]
    start_paused: bool,
    /// Folder with a subfolder per message package, such as /opt/ros/jazzy/share; those of
    /// AMENT_PREFIX_PATH are always searched
    #[arg(long, value_name = "DIR")]
    msg_path: Vec<PathBuf>,
    /// Name of the node
    #[arg(long, value_name = "NAME")]
    node_name: Option<String>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
    /// As for any ROS node: `-- --ros-args -r from:=to -p name:=value ...`
    #[arg(last = true)]
    ros_args: Vec<String>,
}

impl Record {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        if self.topics.is_empty() && !self.all && self.regex.is_none() {
            return Err("no topics are given: name them, or give --all or --regex".into());
        }
        let mut args = self.ros_args.clone();
        args.push("--ros-args".to_owned());
        if self.use_sim_time {
            args.extend(["-p", "use_sim_time:=true"].map(str::to_owned));
        }
        if let Some(name) = &self.node_name {
            args.extend(["-r".to_owned(), format!("__node:={name}")]);
        }
        let (args, json) = (RosArgs::parse(args)?, self.json);
        let options = self.options()?;
        let bag = options.bag.display().to_string();
        let report = bag_recorder::run(options, args)?;
        match json {
            true => println!("{}", serde_json::to_string_pretty(&report)?),
            false => print(&bag, &report),
        }
        Ok(())
    }

    fn options(self) -> CliResult<RecorderOptions> {
        let duration = self.duration.map(Duration::try_from_secs_f64);
        let CompressionFormat::Zstd = self.compression_format;
        Ok(RecorderOptions {
            bag: self.output.unwrap_or_else(default_folder),
            storage: match self.storage {
                StorageName::Mcap => Storage::Mcap,
                StorageName::Sqlite3 => Storage::Sqlite3,
            },
            writer: WriterOptions {
                overwrite: false,
                max_file_bytes: (self.max_bag_size > 0).then_some(self.max_bag_size),
                max_file_ns: (self.max_bag_duration > 0)
                    .then(|| i64::from(self.max_bag_duration) * 1_000_000_000),
                compression: match self.compression_mode {
                    CompressionMode::None => Compression::None,
                    CompressionMode::File => Compression::Files,
                    CompressionMode::Message => Compression::Messages,
                },
            },
            choice: Choice {
                topics: self.topics,
                all: self.all,
                regex: self.regex,
                exclude: self.exclude_topics,
                exclude_regex: self.exclude_regex,
                hidden: self.include_hidden_topics,
            },
            msg_paths: self.msg_path,
            cache_bytes: self.max_cache_size,
            duration: duration
                .transpose()
                .map_err(|e| format!("--duration: {e}"))?,
            discovery: !self.no_discovery,
            polling: Duration::from_millis(self.polling_interval.into()),
            start_paused: self.start_paused,
        })
    }
}

fn print(bag: &str, report: &RecorderReport) {
    let width = report.topics.iter().map(|topic| topic.name.len()).max();
    let width = width.unwrap_or(0).max("topic".len());
    println!(
        "{:width$} {:>9} {:>6} {:>11}  type",
        "topic", "heard", "lost", "not written"
    );
    for topic in &report.topics {
        let (name, heard, lost) = (&topic.name, topic.heard, topic.lost);
        let (not_written, of) = (topic.not_written, &topic.type_name);
        println!("{name:width$} {heard:>9} {lost:>6} {not_written:>11}  {of}");
    }
    let (messages, megabytes) = (report.messages, report.bytes as f64 / 1e6);
    let seconds = report.seconds;
    println!("{messages} messages, {megabytes:.1} MB, {seconds:.1} s in {bag}");
}

/// `rosbag2_2026_05_31-08_07_09`, in UTC; with `_1` and so on if the name exists.
fn default_folder() -> PathBuf {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let folder = folder_of(now.unwrap_or_default().as_secs());
    let numbered = (1..100).map(|number| PathBuf::from(format!("{}_{number}", folder.display())));
    let mut all = std::iter::once(folder.clone()).chain(numbered);
    all.find(|path| !path.exists()).unwrap_or(folder)
}

fn folder_of(seconds: u64) -> PathBuf {
    let [year, month, day, hour, minute, second] = calendar::utc(seconds);
    PathBuf::from(format!(
        "rosbag2_{year}_{month:02}_{day:02}-{hour:02}_{minute:02}_{second:02}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_named_by_the_calendar() {
        for (seconds, name) in [
            (0, "rosbag2_1970_01_01-00_00_00"),
            (1_709_251_199, "rosbag2_2024_02_29-23_59_59"),
        ] {
            assert_eq!(folder_of(seconds), PathBuf::from(name));
        }
    }
}
