//! Writes a bag of two topics and reads one of them in a range of time.
//!
//! `cargo run -p lattice_bag --example 1_write_and_read_a_bag`

use std::error::Error;

use lattice_bag::{BagReader, BagWriter, ReadOptions, Storage, TopicSpec, WriterOptions};

/// Log time of the first message, ns since the Unix epoch.
const START_NS: i64 = 1_700_000_000_000_000_000;
/// Period of the messages, ns.
const PERIOD_NS: i64 = 100_000_000;

/// CDR of a `std_msgs/msg/Float64`, encapsulation header first.
fn float64(value: f64) -> Vec<u8> {
    [[0, 1, 0, 0].as_slice(), &value.to_le_bytes()].concat()
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("my_bag");

    // Write ten messages on each topic.
    let mut writer = BagWriter::create(&path, Storage::Mcap, WriterOptions::default())?;
    let topic = |name: &str| TopicSpec {
        name: name.to_owned(),
        type_name: "std_msgs/msg/Float64".to_owned(),
        definition: Some("float64 data\n".to_owned()),
        ..TopicSpec::default()
    };
    let height = writer.add_topic(topic("/height"))?;
    let speed = writer.add_topic(topic("/speed"))?;
    for i in 0..10_i32 {
        let time_ns = START_NS + i64::from(i) * PERIOD_NS;
        writer.write(height, time_ns, &float64(f64::from(i)))?;
        writer.write(speed, time_ns, &float64(0.5))?;
    }
    writer.finish()?;

    // Read what is there.
    let bag = BagReader::open(&path)?;
    for topic in bag.topics() {
        println!(
            "{} messages on {} ({})",
            topic.message_count, topic.name, topic.type_name
        );
    }
    assert_eq!(bag.message_count(), 20);
    assert_eq!(bag.start_ns(), Some(START_NS));

    // Read the first half second of one topic.
    let options = ReadOptions {
        topics: Some(vec!["/height".to_owned()]),
        end_ns: Some(START_NS + 5 * PERIOD_NS),
        ..ReadOptions::default()
    };
    let mut heights = Vec::new();
    for message in bag.messages(&options)? {
        let value = message?.data.split_off(4);
        heights.push(f64::from_le_bytes(value.as_slice().try_into()?));
    }
    println!("heights of the first half second: {heights:?}");
    assert_eq!(heights, [0.0, 1.0, 2.0, 3.0, 4.0]);
    Ok(())
}
