//! Services between ours and fresh participants of rclpy over Fast DDS, also where datagrams are lost.
//!
//! Ours is this test program once more, so that the interposer `test/peers/lossy.c` is preloaded into both ends: netem
//! needs a module of the kernel that not every machine has.

use std::fs;
use std::io::{Write, stderr};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use lattice_msgs::cdr;
use lattice_msgs::rcl_interfaces::{
    GetParameters, GetParametersRequest, GetParametersResponse, ParameterValue,
};
use lattice_runtime::Runtime;
use lattice_runtime::env::Network;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::domain::{TestDomain, localhost_only};
use lattice_test::python::{ros_pythons, script};
use serde::{Deserialize, Serialize};

/// For one call; one that takes longer is lost.
const PATIENCE: Duration = Duration::from_secs(30);

const DOMAIN: &str = "LATTICE_TEST_FRESH_DOMAIN";
const RESULT: &str = "LATTICE_TEST_FRESH_RESULT";
const CALLS: &str = "LATTICE_TEST_FRESH_CALLS";

/// Lengths of answers, B.
const LENGTHS: [usize; 6] = [1, 100, 1300, 5000, 60_000, 300_000];

/// Datagrams lost, %.
const LOSS: u32 = 5;

#[derive(Debug, Serialize, Deserialize)]
struct Found {
    calls: usize,
    lost: usize,
    median_s: f64,
    max_s: f64,
}

struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Loss of datagrams at both ends, in percent.
pub struct Loss {
    percent: u32,
    library: PathBuf,
    report: PathBuf,
    _directory: tempfile::TempDir,
}

impl Loss {
    /// None, with a line on standard error, where there is no C compiler to build the interposer.
    pub fn new(percent: u32) -> Option<Self> {
        let directory = tempfile::tempdir().unwrap();
        let library = directory.path().join("lossy.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/lossy.c");
        let built = Command::new("cc")
            .args(["-O1", "-shared", "-fPIC", "-o"])
            .args([&library, &source])
            .arg("-ldl")
            .status();
        if !built.is_ok_and(|status| status.success()) {
            let _ = writeln!(stderr(), "SKIPPED: cannot compile {}", source.display());
            return None;
        }
        Some(Self {
            percent,
            library,
            report: directory.path().join("report"),
            _directory: directory,
        })
    }

    pub fn on(&self, command: &mut Command) {
        if self.percent > 0 {
            command
                .env("LD_PRELOAD", &self.library)
                .env("LATTICE_TEST_LOSS_PERCENT", self.percent.to_string())
                .env("LATTICE_TEST_LOSS_FILE", &self.report);
        }
    }

    /// Loss counted by the processes that have ended. Panics if it is far from the share.
    pub fn check(&self) {
        if self.percent == 0 {
            return;
        }
        let report = fs::read_to_string(&self.report).unwrap();
        let (mut sent, mut lost) = (0.0, 0.0);
        for line in report.lines() {
            let counts: Vec<f64> = line
                .split(' ')
                .skip(1)
                .map(|n| n.parse().unwrap())
                .collect();
            sent += counts[0];
            lost += counts[1];
        }
        println!("lost {lost} of {sent} datagrams");
        let share = 100.0 * lost / sent;
        assert!((share - f64::from(self.percent)).abs() < 2.0, "{share} %");
    }
}

/// This program once more, as one of its tests.
fn ours(domain: &TestDomain, test: &str, loss: &Loss) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command
        .args(["--exact", &format!("fresh_clients::{test}"), "--ignored"])
        .env(DOMAIN, domain.id().to_string())
        .stdout(Stdio::null());
    loss.on(&mut command);
    command
}

fn asked_by_rclpy(participants: usize, percent: u32) {
    for python in ros_pythons() {
        let Some(loss) = Loss::new(percent) else {
            return;
        };
        let domain = TestDomain::take();
        let _server = Running(ours(&domain, "server", &loss).spawn().unwrap());
        let mut client = Command::new(&python);
        client.arg(script("fresh_clients.py"));
        client.args(["ask", &domain.id().to_string(), &participants.to_string()]);
        loss.on(&mut client);
        let output = client.stderr(Stdio::inherit()).output().unwrap();
        assert!(output.status.success(), "{}", output.status);
        let text = String::from_utf8(output.stdout).unwrap();
        let found: Found = serde_json::from_str(&text).unwrap();
        println!("{percent} % loss, rclpy asks: {}", text.trim());
        loss.check();
        assert_eq!(found.calls, participants * LENGTHS.len());
        assert_eq!(found.lost, 0);
        assert!(found.median_s < 0.02, "{found:?}");
    }
}

fn answered_by_rclpy(calls: usize, percent: u32) {
    for python in ros_pythons() {
        let Some(loss) = Loss::new(percent) else {
            return;
        };
        let domain = TestDomain::take();
        let mut server = Command::new(&python);
        server.arg(script("fresh_clients.py"));
        server.args(["serve", &domain.id().to_string()]);
        loss.on(&mut server);
        let _server = Running(server.spawn().unwrap());
        let result = tempfile::NamedTempFile::new().unwrap();
        let mut client = ours(&domain, "client", &loss);
        client.env(RESULT, result.path());
        client.env(CALLS, calls.to_string());
        assert!(client.status().unwrap().success());
        let text = fs::read_to_string(result.path()).unwrap();
        println!("{percent} % loss, rclpy answers: {text}");
        loss.check();
        let found: Found = serde_json::from_str(&text).unwrap();
        assert_eq!((found.calls, found.lost), (calls, 0));
    }
}

fn start(name: &str) -> Option<Runtime> {
    let id = std::env::var(DOMAIN).ok()?;
    let network = Network {
        domain_id: id.parse().unwrap(),
        localhost_only: localhost_only(),
        ..Network::from_env().unwrap()
    };
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    Some(Runtime::with_transport(name, args, &network).unwrap())
}

fn value(text: String, number: i64) -> ParameterValue {
    ParameterValue {
        string_value: text,
        integer_value: number,
        ..ParameterValue::default()
    }
}

fn crc32(data: &[u8]) -> i64 {
    let next = |crc: u32, byte: &u8| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    };
    i64::from(!data.iter().fold(u32::MAX, next))
}

fn answer(asked: GetParametersRequest) -> GetParametersResponse {
    let (number, length) = asked.names[0].split_once(':').unwrap();
    let (number, length): (u64, u64) = (number.parse().unwrap(), length.parse().unwrap());
    let letter = |i: u64| char::from(b'a' + u8::try_from((number + i * i) % 26).unwrap());
    let body: String = (0..length).map(letter).collect();
    let crc = crc32(body.as_bytes());
    let number = i64::try_from(number).unwrap();
    GetParametersResponse {
        values: vec![
            value(body, 0),
            value(String::new(), crc),
            value(String::new(), number),
        ],
    }
}

#[test]
#[ignore = "the other end of the tests here, not one itself"]
fn server() {
    let Some(runtime) = start("server") else {
        return;
    };
    let node = runtime.node("server").unwrap();
    let _served = node.service::<GetParameters>("~/answer", answer).unwrap();
    runtime.spin().unwrap();
}

#[test]
#[ignore = "the other end of the tests here, not one itself"]
fn client() {
    let (Ok(result), Ok(calls)) = (std::env::var(RESULT), std::env::var(CALLS)) else {
        return;
    };
    let calls: usize = calls.parse().unwrap();
    let mut times = Vec::new();
    // A new participant for every few calls.
    for first in (0..calls).step_by(5) {
        let runtime = start("client").unwrap();
        let node = runtime.node("client").unwrap();
        let client = node.client::<GetParameters>("/server/answer").unwrap();
        for number in first..calls.min(first + 5) {
            let length = LENGTHS[number % LENGTHS.len()];
            let names = vec![format!("{number}:{length}")];
            let request = cdr::to_vec(&GetParametersRequest { names }).unwrap();
            let begin = Instant::now();
            let Ok(reply) = smol::block_on(client.call(request, PATIENCE)) else {
                continue;
            };
            let reply: GetParametersResponse = cdr::from_slice(&reply).unwrap();
            let [body, crc, of] = &reply.values[..] else {
                panic!("{} values", reply.values.len());
            };
            assert_eq!(body.string_value.len(), length);
            assert_eq!(crc32(body.string_value.as_bytes()), crc.integer_value);
            assert_eq!(of.integer_value, i64::try_from(number).unwrap());
            times.push(begin.elapsed().as_secs_f64());
        }
    }
    times.sort_by(f64::total_cmp);
    let found = Found {
        calls,
        lost: calls - times.len(),
        median_s: times[times.len() / 2],
        max_s: times[times.len() - 1],
    };
    fs::write(result, serde_json::to_string(&found).unwrap()).unwrap();
}

#[test]
fn fresh_clients_of_fast_dds_are_answered() {
    asked_by_rclpy(10, 0);
}

#[test]
fn fresh_clients_of_fast_dds_are_answered_despite_loss() {
    asked_by_rclpy(10, LOSS);
}

#[test]
fn our_fresh_clients_are_answered_by_fast_dds() {
    answered_by_rclpy(20, 0);
}

#[test]
fn our_fresh_clients_are_answered_by_fast_dds_despite_loss() {
    answered_by_rclpy(20, LOSS);
}

#[test]
#[ignore = "takes minutes"]
fn two_hundred_fresh_clients_of_fast_dds_are_answered() {
    asked_by_rclpy(200, 0);
    answered_by_rclpy(100, 0);
    asked_by_rclpy(200, LOSS);
}
