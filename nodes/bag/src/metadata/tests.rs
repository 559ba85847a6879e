//! `metadata.yaml` of all versions, and of hostile authors.

use std::path::Path;

use super::*;

fn parse(body: &str) -> Result<Metadata, BagError> {
    Metadata::parse(
        Path::new("metadata.yaml"),
        &format!("rosbag2_bagfile_information:\n{body}"),
    )
}

#[test]
fn version_1_has_the_least() {
    let metadata = parse(
        "  version: 1\n  storage_identifier: sqlite3\n  relative_file_paths:\n    - bag.db3\n  \
         duration:\n    nanoseconds: 8\n  starting_time:\n    nanoseconds_since_epoch: 5\n  message_count: 2\n  \
         topics_with_message_count:\n    - topic_metadata:\n        name: /a\n        type: std_msgs/String\n        \
         serialization_format: cdr\n      message_count: 2\n",
    )
    .unwrap();
    let topic = &metadata.topics_with_message_count[0].topic_metadata;
    assert_eq!(topic.offered_qos_profiles, vec![]);
    let compression = metadata.compression(Path::new("m"));
    assert_eq!(compression.unwrap(), CompressionMode::None);
    assert_eq!(metadata.starting_time.nanoseconds_since_epoch, 5);
}

#[test]
fn version_4_has_qos_as_text_and_version_9_as_a_list() {
    for profiles in [
        r#""- history: 3\n  depth: 0\n  reliability: 1\n  durability: 1""#,
        "[{history: unknown, depth: 0, reliability: reliable, durability: transient_local}]",
    ] {
        let metadata = parse(&format!(
            "  version: 9\n  topics_with_message_count:\n  - message_count: 2\n    topic_metadata: {{name: /a, type: x/msg/Y, \
             serialization_format: cdr, offered_qos_profiles: {profiles}}}\n"
        ))
        .unwrap();
        let topic = &metadata.topics_with_message_count[0].topic_metadata;
        let qos = &topic.offered_qos_profiles[0];
        assert!(qos.latched && qos.reliable);
    }
}

#[test]
fn versions_out_of_range_are_refused() {
    let error = |body: &str| parse(body).unwrap_err().to_string();
    assert!(error("  version: 10\n").contains("version 10"));
    assert!(error("  storage_identifier: mcap\n").contains("without a version"));
    assert!(parse("  version: [\n").is_err());
}

#[test]
fn paths_stay_in_the_bag() {
    let bag = Path::new("/bags/run");
    let paths = |version: u32, entry: &str| {
        Metadata {
            version,
            relative_file_paths: vec![entry.into()],
            ..Metadata::default()
        }
        .storage_paths(bag, Path::new("metadata.yaml"))
        .map(|paths| paths[0].1.clone())
    };
    assert_eq!(paths(9, "run_0.mcap").unwrap(), bag.join("run_0.mcap"));
    assert_eq!(paths(3, "run/run_0.db3").unwrap(), bag.join("run_0.db3"));
    let below = "data/run_0.db3";
    assert_eq!(paths(9, below).unwrap(), bag.join(below));
    let bad = "../x.db3 /etc/passwd a/../../b ..\\x ./../x".split(' ');
    for bad in bad.chain([""]) {
        for version in [2, 9] {
            let refused = matches!(paths(version, bad), Err(BagError::PathTraversal { .. }));
            assert!(refused, "{bad}");
        }
    }
}

#[test]
fn compression_names_are_checked() {
    let mode = |mode: &str, format: &str| {
        Metadata {
            compression_mode: mode.into(),
            compression_format: format.into(),
            ..Metadata::default()
        }
        .compression(Path::new("m"))
    };
    assert_eq!(mode("FILE", "zstd").unwrap(), CompressionMode::File);
    assert_eq!(mode("message", "zstd").unwrap(), CompressionMode::Message);
    assert_eq!(mode("NONE", "").unwrap(), CompressionMode::None);
    assert!(mode("file", "lz4").unwrap_err().to_string().contains("lz4"));
    assert!(mode("chunk", "zstd").is_err());
}
