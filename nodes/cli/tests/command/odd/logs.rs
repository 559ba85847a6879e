//! Logs whose metadata or static transforms are odd.

use std::fs;
use std::path::{Path, PathBuf};

use lattice_bag::{
    BagMessage, BagQos, BagReader, BagWriter, ReadOptions, Storage, TopicSpec, WriterOptions,
};
use lattice_msgs::cdr;
use lattice_msgs::tf2_msgs::TFMessage;
use serde_json::Value;

use super::driven;
use crate::nodes::{figures, simulated};
use crate::{json, lattice};

/// A log in a folder, changed from the reference.
type Change = fn(&Log, &Path);

/// A log and how it was recorded.
struct Log {
    topics: Vec<TopicSpec>,
    messages: Vec<BagMessage>,
}

const TF_STATIC: &str = "/tf_static";

impl Log {
    fn read(path: &Path) -> Log {
        let reader = BagReader::open(path).unwrap();
        let spec = |topic: &lattice_bag::TopicInfo| TopicSpec {
            name: topic.name.clone(),
            type_name: topic.type_name.clone(),
            type_hash: topic.type_hash.clone(),
            definition: topic.definition.clone(),
            offered_qos: topic.offered_qos.clone(),
        };
        let messages = reader.messages(&ReadOptions::default()).unwrap();
        Log {
            topics: reader.topics().iter().map(spec).collect(),
            messages: messages.collect::<Result<_, _>>().unwrap(),
        }
    }

    fn write(&self, path: &Path, storage: Storage) {
        let mut writer = BagWriter::create(path, storage, WriterOptions::default()).unwrap();
        for topic in &self.topics {
            writer.add_topic(topic.clone()).unwrap();
        }
        for message in &self.messages {
            let (topic, at_ns) = (message.topic, message.log_time_ns);
            writer.write(topic, at_ns, &message.data).unwrap();
        }
        writer.finish().unwrap();
    }

    fn tf_static(&self) -> usize {
        let mut topics = self.topics.iter();
        topics.position(|topic| topic.name == TF_STATIC).unwrap()
    }

    fn last_ns(&self) -> i64 {
        let times = self.messages.iter().map(|message| message.log_time_ns);
        times.max().unwrap()
    }

    /// The static transforms, each a message of its own, at these places in the log; 1 is its end.
    fn with_statics_at(&self, places: impl Fn(usize) -> f64) -> Log {
        let topic = self.tf_static();
        let (first_ns, last_ns) = (self.messages[0].log_time_ns, self.last_ns());
        let (statics, mut messages): (Vec<_>, Vec<_>) =
            (self.messages.iter().cloned()).partition(|message| message.topic == topic);
        let transforms = statics.iter().flat_map(|message| {
            cdr::from_slice::<TFMessage>(&message.data)
                .unwrap()
                .transforms
        });
        for (i, transform) in transforms.enumerate() {
            let transforms = vec![transform];
            messages.push(BagMessage {
                topic,
                log_time_ns: first_ns + ((last_ns - first_ns) as f64 * places(i)) as i64,
                data: cdr::to_vec(&TFMessage { transforms }).unwrap(),
            });
        }
        messages.sort_by_key(|message| message.log_time_ns);
        Log {
            topics: self.topics.clone(),
            messages,
        }
    }

    /// The topics of transforms in a namespace.
    fn in_namespace(mut self, space: &str) -> Log {
        for topic in &mut self.topics {
            if ["/tf", TF_STATIC].contains(&topic.name.as_str()) {
                topic.name = format!("{space}{}", topic.name);
            }
        }
        self
    }

    fn volatile(mut self) -> Log {
        let topic = self.tf_static();
        self.topics[topic].offered_qos = vec![BagQos::default()];
        self
    }
}

/// Writes the log with its `metadata.yaml` changed.
fn with_metadata(log: &Log, path: &Path, change: impl Fn(String) -> String) {
    log.write(path, Storage::Mcap);
    let metadata = path.join("metadata.yaml");
    let text = fs::read_to_string(&metadata).unwrap();
    let changed = change(text.clone());
    assert_ne!(changed, text);
    fs::write(&metadata, changed).unwrap();
}

/// The text with another value of each line of a key.
fn with_values(text: &str, key: &str, value: &str) -> String {
    let line = |line: &str| {
        let indent = line.len() - line.trim_start_matches([' ', '-']).len();
        let (before, rest) = line.split_at(indent);
        match rest.starts_with(key) {
            true => format!("{before}{key} {value}\n"),
            false => format!("{line}\n"),
        }
    };
    text.lines().map(line).collect()
}

fn drivers() -> Vec<(&'static str, Vec<Change>)> {
    vec![
        (
            "`metadata.yaml` whose counts are not those of the storage files",
            vec![
                |log, to| with_metadata(log, to, |text| with_values(&text, "message_count:", "0")),
                |log, to| {
                    with_metadata(log, to, |text| {
                        with_values(&text, "message_count:", "99999")
                    })
                },
                |log, to| with_metadata(log, to, |text| with_values(&text, "message_count:", "-1")),
            ],
        ),
        (
            "`storage_identifier` empty, unknown or wrong",
            vec![
                |log, to| {
                    with_metadata(log, to, |text| {
                        with_values(&text, "storage_identifier:", "''")
                    })
                },
                |log, to| {
                    with_metadata(log, to, |text| {
                        with_values(&text, "storage_identifier:", "my_plugin")
                    })
                },
                |log, to| {
                    with_metadata(log, to, |text| {
                        with_values(&text, "storage_identifier:", "sqlite3")
                    })
                },
            ],
        ),
        (
            "a byte order mark before `metadata.yaml`, ends of line of Windows",
            vec![
                |log, to| with_metadata(log, to, |text| format!("\u{feff}{text}")),
                |log, to| {
                    with_metadata(log, to, |text| {
                        format!("\u{feff}{}", text.replace('\n', "\r\n"))
                    })
                },
            ],
        ),
        (
            "storage files with other names than `metadata.yaml` lists",
            vec![
                |log, to| {
                    log.write(to, Storage::Sqlite3);
                    let of = |name: &str| {
                        fs::read_dir(to)
                            .unwrap()
                            .map(|e| e.unwrap().path())
                            .find(|p| p.extension().is_some_and(|e| e == name))
                    };
                    fs::rename(of("db3").unwrap(), to.join("renamed.db3")).unwrap();
                },
                |log, to| with_metadata(log, to, |text| text.replace("_0.mcap", "_1.mcap")),
            ],
        ),
        (
            "`/tf_static` after the first clouds, also in a namespace",
            vec![
                |log, to| log.with_statics_at(|_| 1.0).write(to, Storage::Mcap),
                |log, to| {
                    log.with_statics_at(|i| 0.2 * i as f64 + 0.3)
                        .write(to, Storage::Sqlite3)
                },
                |log, to| {
                    log.with_statics_at(|_| 0.5)
                        .in_namespace("/robot")
                        .write(to, Storage::Mcap)
                },
            ],
        ),
        (
            "a static transform whose value changes",
            vec![|log, to| {
                // A wrong value behind the last cloud changes nothing before it.
                let mut log = log.with_statics_at(|_| 0.0);
                let wrong = log
                    .messages
                    .iter()
                    .find(|m| m.topic == log.tf_static())
                    .unwrap();
                let mut message: TFMessage = cdr::from_slice(&wrong.data).unwrap();
                message.transforms[0].transform.translation.x += 1.0;
                log.messages.push(BagMessage {
                    topic: wrong.topic,
                    log_time_ns: log.last_ns() + 1_000_000_000,
                    data: cdr::to_vec(&message).unwrap(),
                });
                log.write(to, Storage::Mcap);
            }],
        ),
    ]
}

/// The log of the tests and its direct replay.
fn reference(folder: &Path) -> (Log, Value) {
    let path = simulated(folder, "mcap", "2");
    let replayed = json(&["replay", "--direct", "--lattice", "fcc", &path]);
    (Log::read(path.as_ref()), replayed)
}

#[test]
fn odd_logs_become_what_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    let (log, expected) = reference(folder.path());
    for (row, changes) in driven("| of a log |", drivers()) {
        for (i, change) in changes.iter().enumerate() {
            let path: PathBuf = folder.path().join("odd");
            let _ = fs::remove_dir_all(&path);
            change(&log, &path);
            let name = path.display().to_string();
            let arguments = ["replay", "--direct", "--lattice", "fcc", "--json", &name];
            let output = lattice(&arguments);
            let errors = String::from_utf8(output.stderr).unwrap();
            assert!(output.status.success(), "{} {i}: {errors}", row.name);
            let replayed: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(
                figures(&replayed),
                figures(&expected),
                "{} {i}: {errors}",
                row.name
            );
            for text in &row.says {
                assert!(
                    errors.contains(text),
                    "{} {i}: no '{text}' in {errors}",
                    row.name
                );
            }
            // What the log has, by its storage.
            let info = json(&["bag", "info", &name]);
            let counts = info["topics"].as_array().unwrap().iter();
            let counts = counts.map(|topic| topic["messages"].as_u64().unwrap());
            assert_eq!(counts.sum::<u64>(), info["messages"].as_u64().unwrap());
            assert!(info["messages"].as_u64().unwrap() >= log.messages.len() as u64);
            let miscounted = row.says.iter().any(|text| text.contains("counts"));
            assert_eq!(
                info["metadata_messages"].is_null(),
                !miscounted,
                "{}",
                row.name
            );
        }
    }
}

#[test]
fn static_transforms_reach_nodes_whatever_their_qos_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let (log, expected) = reference(folder.path());
    let path = folder.path().join("odd");
    // As one that was recorded volatile, at the end, one by one.
    log.with_statics_at(|i| 1.0 - 0.1 * i as f64)
        .volatile()
        .write(&path, Storage::Mcap);
    let name = path.display().to_string();
    let info = json(&["bag", "info", &name]);
    let mut topics = info["topics"].as_array().unwrap().iter();
    let transforms = topics.find(|topic| topic["name"] == TF_STATIC).unwrap();
    assert_eq!(transforms["is_latched"], true);
    let played = json(&["replay", "--lattice", "fcc", &name]);
    assert_eq!(figures(&played), figures(&expected));
}
