//! Two machines, which are network namespaces here.

use std::io::{Write, stderr};
use std::process::{Command, Stdio};

use lattice_test::domain::TestDomain;

/// Two namespaces with a cable between them; the first has 10.79.0.1, the second 10.79.0.2.
pub struct Machines([String; 2]);

impl Machines {
    /// None, with a line on standard error, where that is not permitted.
    pub fn new(domain: &TestDomain) -> Option<Self> {
        let names = ["a", "b"].map(|name| format!("lattice{}{name}", domain.id()));
        let this = Self(names);
        let [a, b] = &this.0;
        let steps = [
            format!("netns add {a}"),
            format!("netns add {b}"),
            format!("link add veth0 netns {a} type veth peer name veth0 netns {b}"),
            format!("-n {a} addr add 10.79.0.1/24 dev veth0"),
            format!("-n {b} addr add 10.79.0.2/24 dev veth0"),
            format!("-n {a} link set lo up"),
            format!("-n {b} link set lo up"),
            format!("-n {a} link set veth0 up"),
            format!("-n {b} link set veth0 up"),
        ];
        let made = steps.iter().all(|step| ip(step));
        if !made {
            let _ = writeln!(stderr(), "SKIPPED: no network namespaces");
        }
        made.then_some(this)
    }

    /// A test of this program on one of the machines, which finds the other by multicast.
    pub fn run(&self, machine: usize, test: &str) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.0[machine]]);
        command.arg(std::env::current_exe().unwrap());
        command.args(["--exact", test, "--ignored", "--nocapture"]);
        command.env("LATTICE_TEST_MULTICAST", "1");
        command
    }

    /// Pulls the cable out, or puts it in.
    pub fn set_link(&self, is_up: bool) {
        let state = if is_up { "up" } else { "down" };
        assert!(ip(&format!("-n {} link set veth0 {state}", self.0[0])));
    }

    /// Limits the packets of both ends to a number of bytes.
    pub fn set_mtu(&self, bytes: u32) {
        for name in &self.0 {
            assert!(ip(&format!("-n {name} link set veth0 mtu {bytes}")));
        }
    }
}

impl Drop for Machines {
    fn drop(&mut self) {
        for name in &self.0 {
            ip(&format!("netns del {name}"));
        }
    }
}

fn ip(arguments: &str) -> bool {
    let mut command = Command::new("ip");
    command.args(arguments.split(' ')).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
