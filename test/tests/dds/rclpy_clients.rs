//! Servers of ours asked by fresh participants of rclpy over Fast DDS.

use std::path::Path;
use std::process::Command;

use lattice_msgs::rcl_interfaces::{
    GetParameters, GetParametersRequest, GetParametersResponse, ParameterValue,
};
use lattice_runtime::Runtime;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::domain::TestDomain;
use lattice_test::python::{ros_pythons, script};
use lattice_test::random::Random;
use serde_json::Value;

/// Median of calls after the first one of a client.
const MAX_MEDIAN_S: f64 = 0.02;

/// CRC-32 as zlib has it.
fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| (crc >> 1) ^ (0xedb8_8320 * (crc & 1));
    let add = |crc: u32, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), step);
    !bytes.iter().fold(!0, add)
}

/// Letters of the length that is asked for, and their CRC.
fn letters(asked: GetParametersRequest) -> GetParametersResponse {
    let mut random = Random(1);
    let length = asked.names[0].parse().unwrap();
    let letter = |_| char::from(b'a' + random.below(26) as u8);
    let text: String = (0..length).map(letter).collect();
    let crc = crc(text.as_bytes()).to_string();
    let value = |string_value| ParameterValue {
        string_value,
        ..ParameterValue::default()
    };
    GetParametersResponse {
        values: vec![value(text), value(crc)],
    }
}

fn fresh_clients(python: &Path, count: usize) -> Value {
    let domain = TestDomain::take();
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport("server", args, &domain.transport()).unwrap();
    let node = runtime.node("server").unwrap();
    let _served = node.service::<GetParameters>("~/letters", letters).unwrap();
    let mut command = Command::new(python);
    let output = command
        .arg(script("rclpy_clients.py"))
        .args([
            &domain.id().to_string(),
            "/server/letters",
            &count.to_string(),
        ])
        .args(std::env::var("LATTICE_TEST_CLIENTS").ok())
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", python.display());
    serde_json::from_slice(&output.stdout).unwrap()
}

fn all_are_answered(count: usize) {
    for python in ros_pythons() {
        let found = fresh_clients(&python, count);
        println!("{}: {found}", python.display());
        assert_eq!(
            (&found["lost_first"], &found["lost"]),
            (&0.into(), &0.into())
        );
        assert!(
            found["median_s"].as_f64().unwrap() < MAX_MEDIAN_S,
            "{found}"
        );
    }
}

#[test]
fn fresh_clients_over_fast_dds_are_answered() {
    all_are_answered(10);
}

#[test]
#[ignore = "takes minutes"]
fn two_hundred_fresh_clients_over_fast_dds_are_answered() {
    all_are_answered(200);
}
