//! Every message has the same bytes here as in the rosbags library for Python.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

use lattice_msgs::{
    MessageVisitor, RosAction, RosMessage, RosService, cdr, hash_of, know_message, know_service,
    type_hash, visit_messages,
};
use lattice_test::data::shared;
use lattice_test::my_msgs::{self, Battery, Beat, Cell, Recharge, SwapAction};
use lattice_test::python::{python, script};
use serde_json::{Value, json};

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

fn from_hex(text: &Value) -> Vec<u8> {
    let text = text.as_str().unwrap();
    (0..text.len())
        .step_by(2)
        .map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap())
        .collect()
}

/// One line for each type: what the peer is to know of it.
#[derive(Default)]
struct Questions(String);

impl MessageVisitor for Questions {
    fn visit<M: RosMessage>(&mut self) {
        let default = to_hex(&cdr::to_vec(&M::default()).unwrap());
        let question = json!({"type": M::TYPE, "definition": M::definition(), "default": default});
        writeln!(self.0, "{question}").unwrap();
    }
}

/// Compares the peer's answers, which come in the order of the visit.
struct Compare<I> {
    answers: I,
    in_jazzy: usize,
}

impl<I: Iterator<Item = Value>> MessageVisitor for Compare<I> {
    fn visit<M: RosMessage>(&mut self) {
        let answer = self
            .answers
            .next()
            .unwrap_or_else(|| panic!("no answer on {}", M::TYPE));
        assert_eq!(answer["type"], M::TYPE);
        assert_eq!(answer["jazzy"], Value::Null, "{}", M::TYPE);
        self.in_jazzy += usize::from(answer["in_jazzy"] == true);

        // From here to there and back.
        let default = cdr::to_vec(&M::default()).unwrap();
        assert_eq!(from_hex(&answer["default"]), default, "{}", M::TYPE);

        // From there to here and back, empty and filled.
        let samples = answer["samples"].as_array().unwrap();
        assert_eq!(samples.len(), 4);
        for sample in samples {
            let theirs = from_hex(&sample["bytes"]);
            let message: M = cdr::from_slice(&theirs).unwrap();
            assert_eq!(
                serde_json::to_value(&message).unwrap(),
                sample["value"],
                "{}",
                M::TYPE
            );
            let ours = cdr::to_vec(&message).unwrap();
            assert_eq!(ours, theirs, "{}", M::TYPE);
        }
    }
}

/// Passes our messages and those of a user's package.
fn visit_all(visitor: &mut impl MessageVisitor) {
    visit_messages(visitor);
    my_msgs::visit_messages(visitor);
}

#[test]
fn bytes_and_values_agree_with_rosbags() {
    let Some(python) = python() else { return };
    let mut questions = Questions::default();
    visit_all(&mut questions);

    let mut peer = Command::new(python)
        .arg(script("msgs_peer.py"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = peer.stdin.take().unwrap();
    let text = questions.0;
    let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let output = peer.wait_with_output().unwrap();
    assert!(
        output.status.success(),
        "the peer failed: {}",
        output.status
    );
    writer.join().unwrap().unwrap();

    let lines = String::from_utf8(output.stdout).unwrap();
    let answers = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    let mut compare = Compare {
        answers,
        in_jazzy: 0,
    };
    visit_all(&mut compare);
    assert!(compare.answers.next().is_none());
    assert!(
        compare.in_jazzy > 40,
        "only {} types are in Jazzy",
        compare.in_jazzy
    );
}

#[test]
fn type_hashes_agree_with_jazzy() {
    let Some(path) = shared("ros2/type_hashes_jazzy.json") else {
        return;
    };
    let data: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let mut compared = 0;
    for (ros_type, expected) in data["hashes"].as_object().unwrap() {
        // Changed since the list was made: history_checksum and voxels_total.
        if [
            "lattice_msgs/msg/LatticeMap",
            "lattice_msgs/msg/LatticeMapUpdate",
        ]
        .contains(&&**ros_type)
        {
            continue;
        }
        if let Some(hash) = hash_of(ros_type) {
            assert_eq!(expected, hash, "{ros_type}");
            compared += 1;
        }
    }
    assert!(compared > 80, "only {compared} hashes compared");
}

#[test]
fn messages_of_a_user_have_constants_defaults_and_hashes() {
    assert_eq!(Battery::LI_ION, 1);
    assert_eq!(Battery::MODEL, "4S #2");
    assert_eq!(Battery::LOWEST_V, 3.0);
    let battery = Battery::default();
    assert_eq!(
        (battery.volts, battery.type_, battery.charging),
        (24.0, 1, true)
    );
    assert_eq!((battery.name.as_str(), battery.counts), ("main", [1, 2, 3]));
    assert_eq!(battery.history, [0.0; 40]);

    // Small messages of fixed size are Copy, and ordered without floating-point numbers.
    let (cell, beat) = (Cell::default(), Beat::default());
    let copies = [cell, cell];
    assert_eq!(copies[0], cell);
    assert!(beat <= Beat::default());

    assert_eq!(hash_of(Battery::TYPE), None);
    know_message::<Battery>();
    know_service::<Recharge>();
    let expected = type_hash(Battery::TYPE, &Battery::definition());
    assert_eq!(hash_of(Battery::TYPE), expected.as_deref());
    assert!(hash_of(Cell::TYPE).is_some() && hash_of(Recharge::TYPE).is_some());

    let parts = [
        <SwapAction as RosAction>::Goal::TYPE,
        <<SwapAction as RosAction>::SendGoal as RosService>::Request::TYPE,
        <SwapAction as RosAction>::FeedbackMessage::TYPE,
    ];
    assert_eq!(
        parts.map(|part| part.strip_prefix("my_msgs/action/Swap_").unwrap()),
        ["Goal", "SendGoal_Request", "FeedbackMessage"]
    );
}
