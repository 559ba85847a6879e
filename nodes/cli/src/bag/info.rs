//! `lattice bag info`.

use std::path::PathBuf;

use clap::Args;
use lattice_bag::BagReader;
use serde::Serialize;

use super::frames::{self, Frames};
use crate::{CliResult, calendar};

/// Options of `lattice bag info`.
#[derive(Args)]
pub struct Info {
    /// rosbag2 directory, an .mcap or .db3 file of one, or a ROS 1 bag
    bag: PathBuf,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
}

/// Summary of a log.
#[derive(Serialize)]
struct Summary {
    /// `mcap`, `sqlite3` or `rosbag1`.
    storage: &'static str,
    /// True if messages and types are converted from ROS 1.
    is_ros1: bool,
    /// ROS distribution of the recorder; null if not recorded.
    ros_distro: Option<String>,
    files: usize,
    bytes: u64,
    messages: u64,
    /// Count by `metadata.yaml`; null if it agrees with the storage files.
    metadata_messages: Option<u64>,
    start_ns: Option<i64>,
    end_ns: Option<i64>,
    start: Option<String>,
    end: Option<String>,
    duration_s: f64,
    topics: Vec<Topic>,
}

#[derive(Serialize)]
struct Topic {
    name: String,
    #[serde(rename = "type")]
    type_name: String,
    messages: u64,
    /// Mean rate over the log; null for fewer than two messages.
    hz: Option<f64>,
    /// Message bytes; null if the storage does not provide them.
    bytes: Option<u64>,
    /// Frame of the first message.
    frame_id: Option<String>,
    child_frame_id: Option<String>,
    /// Parent and child of each transform in the first messages.
    transforms: Vec<[String; 2]>,
    type_hash: String,
    is_latched: bool,
    has_definition: bool,
}

impl Info {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let reader = BagReader::open(&self.bag)?;
        let summary = Summary::of(&reader)?;
        match self.json {
            true => println!("{}", serde_json::to_string_pretty(&summary)?),
            false => summary.print(),
        }
        Ok(())
    }
}

impl Summary {
    fn of(reader: &BagReader) -> CliResult<Summary> {
        let (start_ns, end_ns) = (reader.start_ns(), reader.end_ns());
        let span_ns = end_ns.unwrap_or(0).saturating_sub(start_ns.unwrap_or(0));
        let duration_s = span_ns as f64 / 1e9;
        let size = |path| std::fs::metadata(path).map_or(0, |file| file.len());
        let mut frames = frames::of_log(reader)?;
        let topics = reader.topics().iter().enumerate().map(|(index, topic)| {
            let intervals = topic.message_count.saturating_sub(1) as f64;
            let Frames {
                frame_id,
                child_frame_id,
                transforms,
            } = frames.remove(&index).unwrap_or_default();
            Topic {
                name: topic.name.clone(),
                type_name: topic.type_name.clone(),
                messages: topic.message_count,
                hz: (intervals > 0.0 && duration_s > 0.0).then(|| intervals / duration_s),
                bytes: topic.message_bytes,
                frame_id,
                child_frame_id,
                transforms: transforms.into_iter().collect(),
                type_hash: topic.type_hash.clone(),
                is_latched: topic.is_latched(),
                has_definition: topic.definition.is_some(),
            }
        });
        let topics = topics.collect();
        Ok(Summary {
            storage: reader.storage_name(),
            is_ros1: reader.is_ros1(),
            ros_distro: Some(reader.ros_distro().to_owned()).filter(|name| !name.is_empty()),
            files: reader.files().count(),
            bytes: reader.files().map(size).sum(),
            messages: reader.message_count(),
            metadata_messages: reader.miscounted(),
            start_ns,
            end_ns,
            start: start_ns.map(calendar::iso_8601),
            end: end_ns.map(calendar::iso_8601),
            duration_s,
            topics,
        })
    }

    fn print(&self) {
        let files = if self.files == 1 { "file" } else { "files" };
        let (number, bytes) = (self.files, megabytes(self.bytes));
        let storage = match self.is_ros1 && self.storage != "rosbag1" {
            true => format!("{} of ROS 1", self.storage),
            false => self.storage.to_owned(),
        };
        println!("storage   {storage}, {number} {files}, {bytes}");
        if let Some(name) = &self.ros_distro {
            println!("distro    {}", plain(name));
        }
        if let (Some(start), Some(end)) = (&self.start, &self.end) {
            println!("start     {start}");
            println!("end       {end}");
            println!("duration  {}", calendar::duration(self.duration_s));
        }
        match self.metadata_messages {
            None => println!("messages  {}\n", self.messages),
            Some(claimed) => println!(
                "messages  {} ({claimed} by metadata.yaml, which is wrong)\n",
                self.messages
            ),
        }
        let has_bytes = self.topics.iter().any(|topic| topic.bytes.is_some());
        let mut rows = vec![Topic::head(has_bytes)];
        rows.extend(self.topics.iter().map(|topic| topic.row(has_bytes)));
        print_table(&rows);
        for topic in self.topics.iter().filter(|t| !t.transforms.is_empty()) {
            println!("\ntransforms of {}", plain(&topic.name));
            for [parent, child] in &topic.transforms {
                println!("  {} -> {}", plain(parent), plain(child));
            }
        }
    }
}

impl Topic {
    fn head(has_bytes: bool) -> Vec<String> {
        let bytes = has_bytes.then_some("bytes");
        let names = ["topic", "type", "messages", "mean Hz"].into_iter();
        let names = names.chain(bytes).chain(["frame", "notes"]);
        names.map(str::to_owned).collect()
    }

    fn row(&self, has_bytes: bool) -> Vec<String> {
        let mut row = vec![plain(&self.name), plain(&self.type_name)];
        row.push(self.messages.to_string());
        row.push(self.hz.map_or("-".into(), |hz| format!("{hz:.2}")));
        if has_bytes {
            row.push(self.bytes.map_or("-".into(), megabytes));
        }
        let frame = match (&self.frame_id, &self.child_frame_id) {
            (Some(parent), Some(child)) => format!("{parent} -> {child}"),
            (Some(frame), None) if !frame.is_empty() => frame.clone(),
            (Some(_), None) => "(empty)".into(),
            _ => "-".into(),
        };
        row.push(plain(&frame));
        let notes = [
            (self.is_latched, "latched"),
            (!self.has_definition, "without definition"),
        ];
        let notes = notes.into_iter().filter(|(applies, _)| *applies);
        let notes: Vec<_> = notes.map(|(_, note)| note).collect();
        row.push(notes.join(", "));
        row
    }
}

/// Prints rows with aligned columns: the third and the fourth right-aligned.
fn print_table(rows: &[Vec<String>]) {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns)
        .map(|column| {
            let cells = rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        })
        .collect();
    for row in rows {
        let cells = row.iter().zip(&widths).enumerate();
        let cells = cells.map(|(column, (cell, &width))| match column {
            2 | 3 => format!("{cell:>width$}"),
            _ => format!("{cell:<width$}"),
        });
        println!("{}", cells.collect::<Vec<_>>().join("  ").trim_end());
    }
}

fn megabytes(bytes: u64) -> String {
    match bytes {
        0..10_000 => format!("{bytes} bytes"),
        _ => format!("{:.2} MB", bytes as f64 / 1e6),
    }
}

/// Text of a log without control characters.
fn plain(text: &str) -> String {
    match text.chars().any(char::is_control) {
        true => text.escape_debug().to_string(),
        false => text.to_owned(),
    }
}
