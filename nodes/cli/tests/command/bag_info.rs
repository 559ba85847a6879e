//! `lattice bag info` of logs of both storages.

use std::fs;

use serde_json::Value;

use crate::{json, text};

#[test]
fn a_log_is_shown_with_its_dates_rates_sizes_and_frames() {
    let folder = tempfile::tempdir().unwrap();
    for storage in ["mcap", "sqlite3"] {
        let log = folder.path().join(storage);
        let name = log.display().to_string();
        let simulate = [
            "simulate",
            "bobcat",
            "--duration",
            "4",
            "--storage",
            storage,
        ];
        text(&[&simulate[..], &["--out", &name]].concat());
        let info = json(&["bag", "info", &name]);
        assert_eq!(info["storage"], storage);
        assert_eq!(info["ros_distro"], "lattice");
        let ending = if storage == "mcap" { "mcap" } else { "db3" };
        let file = fs::metadata(log.join(format!("{storage}_0.{ending}"))).unwrap();
        assert_eq!(
            (&info["files"], &info["bytes"]),
            (&1.into(), &file.len().into())
        );
        let duration_s = info["duration_s"].as_f64().unwrap();
        assert!((3.5..4.5).contains(&duration_s), "{duration_s}");
        let topics = info["topics"].as_array().unwrap();
        let counts = topics
            .iter()
            .map(|topic| topic["messages"].as_u64().unwrap());
        assert_eq!(info["messages"], counts.sum::<u64>());
        let of = |type_name: &str| {
            let mut found = topics.iter();
            found.find(|topic| topic["type"] == type_name).unwrap()
        };
        let (ins, cloud) = (
            of("novatel_oem7_msgs/msg/INSPVAX"),
            of("sensor_msgs/msg/PointCloud2"),
        );
        let hz = ins["hz"].as_f64().unwrap();
        assert!((95.0..105.0).contains(&hz), "{hz}");
        let frame = cloud["frame_id"].as_str().unwrap();
        assert!(!frame.is_empty());
        // MCAP's index has no bytes of a topic.
        let has_bytes = topics.iter().all(|topic| topic["bytes"].as_u64() > Some(0));
        assert_eq!(has_bytes, storage == "sqlite3");
        let edges = topics
            .iter()
            .map(|topic| topic["transforms"].as_array().unwrap());
        assert!(edges.flatten().any(|edge| edge[1] == frame), "{topics:?}");

        let shown = text(&["bag", "info", &name]);
        for part in [
            &format!("storage   {storage}, 1 file, "),
            "start     20",
            "duration  ",
            &format!(" -> {frame}\n"),
            "transforms of /tf_static",
        ] {
            assert!(shown.contains(part), "{part} in {shown}");
        }
        // Columns begin where their names do.
        let mut lines = shown.lines().skip_while(|line| !line.starts_with("topic "));
        let head = lines.next().unwrap();
        let column = head.find("type").unwrap();
        let rows: Vec<&str> = lines.take_while(|line| !line.is_empty()).collect();
        assert_eq!(rows.len(), topics.len());
        for row in rows {
            assert!(
                row[..column].ends_with("  ") && !row[column..].starts_with(' '),
                "{shown}"
            );
        }
    }
}

#[test]
fn a_log_without_messages_has_no_dates() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log").display().to_string();
    let options = lattice_bag::WriterOptions::default();
    let path = std::path::Path::new(&log);
    let storage = lattice_bag::Storage::Mcap;
    let writer = lattice_bag::BagWriter::create(path, storage, options).unwrap();
    writer.finish().unwrap();
    let info = json(&["bag", "info", &log]);
    assert_eq!(
        (&info["start"], &info["messages"]),
        (&Value::Null, &0.into())
    );
    assert!(!text(&["bag", "info", &log]).contains("start"));
}
