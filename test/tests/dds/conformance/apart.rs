//! Processes that are to stay apart: with `OFF` from everybody, with `LOCALHOST` from other machines, which are
//! network namespaces here.

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use lattice_runtime::Runtime;
use lattice_runtime::env::{Network, TransportKind};
use lattice_runtime::ros_args::RosArgs;
use lattice_test::domain::TestDomain;

use super::{DOMAIN, Echo, PATIENCE, Talk, program};
use crate::machines::Machines;

const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";

/// Environment variable with the result that [`hears_an_echo`] expects.
const EXPECTED: &str = "LATTICE_TEST_EXPECTED";

/// Time in which nobody is to be found: several announcements of 2 s.
const IN_VAIN: Duration = Duration::from_secs(8);

#[test]
fn who_is_off_is_found_by_nobody() {
    let transport = TransportKind::BUILT_IN[0];
    let domain = TestDomain::take();
    let _off = [(); 2].map(|()| {
        let mut off = Command::new(program());
        off.env(RANGE, "OFF");
        Echo::start_by(off, &domain, transport)
    });
    // Several rounds, as those that are off may start later than the first.
    for round in 0..5 {
        let talk = Talk::start(&domain, transport);
        let _echo = Echo::start(&domain, transport);
        for word in 0..40 {
            talk.until_echoed(&format!("{round} {word}"), PATIENCE);
        }
        assert_eq!(talk.publisher.subscriber_count(), 1, "{round}");
    }
}

/// A test of this program on one of the machines.
fn end_on(
    machines: &Machines,
    machine: usize,
    domain: &TestDomain,
    test: &str,
    range: &str,
) -> Command {
    let mut command = machines.run(machine, test);
    command.env(DOMAIN, domain.id().to_string());
    command.env(RANGE, range).stdout(Stdio::null());
    command
}

struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn other_machines_are_met_on_the_subnet_and_not_on_localhost() {
    let domain = TestDomain::take();
    let Some(machines) = Machines::new(&domain) else {
        return;
    };
    for (range, expected) in [("SUBNET", "heard"), ("LOCALHOST", "alone")] {
        let mut echo = end_on(&machines, 1, &domain, "conformance::echo", "SUBNET");
        // Told where the other machine is: nothing that reaches its ports may count there.
        let echo = echo.env("ROS_STATIC_PEERS", "10.79.0.1").spawn();
        let _echo = Running(echo.unwrap());
        let test = "conformance::apart::hears_an_echo";
        let mut ours = end_on(&machines, 0, &domain, test, range);
        let status = ours.env(EXPECTED, expected).status().unwrap();
        assert!(status.success(), "{range}");
    }
}

#[test]
#[ignore = "the other end of a test here, not one itself"]
fn hears_an_echo() {
    let (Ok(id), Ok(expected)) = (std::env::var(DOMAIN), std::env::var(EXPECTED)) else {
        return;
    };
    let network = Network {
        domain_id: id.parse().unwrap(),
        ..Network::from_env().unwrap()
    };
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let talk = Talk::with(Runtime::with_transport("talk", args, &network).unwrap());
    match expected.as_str() {
        "heard" => drop(talk.until_echoed("word", PATIENCE)),
        _ => {
            assert!(every_socket_is_on_loopback());
            std::thread::sleep(IN_VAIN);
            assert_eq!(talk.publisher.subscriber_count(), 0);
        }
    }
}

/// True if the kernel gives the datagram sockets of this namespace nothing from another machine.
fn every_socket_is_on_loopback() -> bool {
    let listed = Command::new("ss").args(["-u", "-a", "-n", "-H"]).output();
    let listed = String::from_utf8(listed.unwrap().stdout).unwrap();
    let mut local = listed
        .lines()
        .filter_map(|line| line.split_whitespace().nth(3));
    !listed.is_empty()
        && local.all(|address| address.contains("%lo:") || address.starts_with("127."))
}
