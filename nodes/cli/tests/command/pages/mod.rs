//! Every command of README and of the pages in `docs`, as a user types it.

pub mod blocks;
mod links;
mod rules;

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader, Write, stderr};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};

use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};
use tempfile::TempDir;
use wait_timeout::ChildExt;

use crate::nodes::simulated;
use crate::record::signal;
use crate::viewer::{map_of, scene};
use crate::{PATIENCE, text};
use blocks::{Block, blocks, root};
use rules::{RULES, Rule, rule_of};

/// Folder of a reader of the pages, with the files that they name, and a ROS domain.
struct Place {
    home: TempDir,
    domain: LoopbackDomain,
}

impl Place {
    /// Files of small sizes: `LOG`, `map.lattice`, `scan.ply`, `params/`, `robot.yaml` of README.
    fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let inside = |name: &str| home.path().join(name);
        fs::rename(simulated(home.path(), "mcap", "2"), inside("LOG")).unwrap();
        let map = map_of(&scene(home.path(), 5.0), "fcc");
        fs::rename(map, inside("map.lattice")).unwrap();
        // Parameters, but for ports that another viewer may have.
        fs::create_dir(inside("params")).unwrap();
        for entry in fs::read_dir(root().join("params")).unwrap() {
            let entry = entry.unwrap();
            let yaml = fs::read_to_string(entry.path()).unwrap();
            let yaml = yaml.replace("port: 8765", "port: 0");
            fs::write(inside("params").join(entry.file_name()), yaml).unwrap();
        }
        let yaml = blocks("yaml");
        let robot = yaml.iter().find(|block| block.page == "README.md").unwrap();
        fs::write(inside("robot.yaml"), &robot.text).unwrap();
        // The program on the PATH, and the repository where a page has it.
        fs::create_dir(inside("bin")).unwrap();
        symlink(env!("CARGO_BIN_EXE_lattice"), inside("bin/lattice")).unwrap();
        symlink(root(), inside("lattice")).unwrap();
        let domain = LoopbackDomain::take().unwrap();
        let place = Self { home, domain };
        place.run("scan.ply", "lattice map export map.lattice -o scan.ply");
        place
    }

    fn command(&self, script: &str) -> Command {
        let path = std::env::var("PATH").unwrap_or_default();
        let bin = self.home.path().join("bin");
        let mut command = Command::new("bash");
        command
            .args(["-euc", script])
            .current_dir(self.home.path())
            .env("PATH", format!("{}:{path}", bin.display()))
            .env("HOME", self.home.path())
            .env_remove("XDG_STATE_HOME")
            .env("ROS_DOMAIN_ID", self.domain.id().to_string())
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs a script to its end.
    fn run(&self, of: &str, script: &str) {
        let output = self.command(script).output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{of}: {script}\n{words}");
    }

    fn start(&self, command: &str) -> Server {
        let mut process = self.command(&format!("exec {command}")).spawn().unwrap();
        let (told, lines) = channel();
        let out = process.stdout.take().unwrap();
        let err = process.stderr.take().unwrap();
        for stream in [
            Box::new(out) as Box<dyn std::io::Read + Send>,
            Box::new(err),
        ] {
            let told = told.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(stream).lines().map_while(Result::ok) {
                    let _ = told.send(line);
                }
            });
        }
        Server { process, lines }
    }

    /// Listens to the nodes of the domain.
    fn listen(&self) -> Listener {
        let network = Network {
            domain_id: self.domain.id(),
            localhost_only: true,
            ..Network::from_env().unwrap()
        };
        let runtime = Runtime::with_transport("reader", RosArgs::default(), &network).unwrap();
        let node = runtime.node("reader").unwrap();
        let (told, nodes) = channel();
        let handler = move |message: std::sync::Arc<DiagnosticArray>| {
            let names = message.status.iter().map(|status| status.name.clone());
            let _ = told.send(names.collect());
        };
        let of = ("/diagnostics", Qos::DIAGNOSTICS);
        let subscription = node
            .subscribe(of.0, of.1, SubscriptionExecutor::Shared, handler)
            .unwrap();
        Listener {
            nodes,
            _subscription: subscription,
            _runtime: runtime,
        }
    }
}

/// Subscription to `/diagnostics`.
struct Listener {
    nodes: Receiver<Vec<String>>,
    _subscription: lattice_runtime::Subscription,
    _runtime: Runtime,
}

impl Listener {
    fn wait_for(&self, node: &str, of: &str) {
        let of_node = |name: &String| name.split(':').next() == Some(node);
        loop {
            let names = self.nodes.recv_timeout(PATIENCE);
            let names = names.unwrap_or_else(|_| panic!("{of}: no word of {node}"));
            if names.iter().any(of_node) {
                return;
            }
        }
    }
}

/// A process that runs until it is ended.
struct Server {
    process: Child,
    lines: Receiver<String>,
}

impl Server {
    fn wait_for(&self, text: &str, of: &str) {
        let mut seen = Vec::new();
        while !seen.last().is_some_and(|line: &String| line.contains(text)) {
            let line = self.lines.recv_timeout(PATIENCE);
            seen.push(line.unwrap_or_else(|_| panic!("{of}: no '{text}' in {seen:#?}")));
        }
    }

    /// Ends it as Ctrl-C does.
    fn end(mut self, of: &str) {
        signal(&self.process, "-INT");
        let status = self.process.wait_timeout(PATIENCE).unwrap();
        let status = status.unwrap_or_else(|| panic!("{of}: does not end"));
        // `view` of a file has nothing to save.
        let by_signal = std::os::unix::process::ExitStatusExt::signal(&status) == Some(2);
        let rest: Vec<String> = self.lines.iter().collect();
        assert!(status.success() || by_signal, "{of}: {status}: {rest:#?}");
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The program as the pages name it.
fn installed(command: &str) -> String {
    let command = command.replace("target/release/lattice ", "lattice ");
    match command.split_once("--bin lattice -- ") {
        Some((_, arguments)) => format!("lattice {arguments}"),
        None => command,
    }
}

/// A command with more options, before the arguments of its nodes.
fn with_options(command: &str, more: &str) -> String {
    match command.split_once(" -- ") {
        Some((own, of_nodes)) => format!("{own} {more} -- {of_nodes}"),
        None => format!("{command} {more}"),
    }
}

/// Fails unless a command of `lattice` exists, with its options.
fn check_options(command: &str, of: &str) {
    let mut words = command.split(' ').skip(1);
    let mut path = Vec::new();
    let mut help = text(&["--help"]);
    let mut options = Vec::new();
    for word in &mut words {
        let word = word.trim_end_matches('&');
        let is_command =
            |line: &str| line.starts_with("  ") && line.split_whitespace().next() == Some(word);
        if word == "--" || word == "--ros-args" {
            break;
        } else if word.starts_with("--") {
            options.push(word.to_owned());
        } else if options.is_empty() && help.contains("Commands:") && help.lines().any(is_command) {
            path.push(word.to_owned());
            // Options are those of another program, or of the node.
            if ["fleet", "node"].contains(&word) {
                return;
            }
            let arguments: Vec<&str> = path.iter().map(String::as_str).collect();
            help = text(&[&arguments[..], &["--help"]].concat());
        } else {
            // What follows an option may be its value: `calibrate` has options and commands.
            assert!(
                !options.is_empty() || !help.contains("Commands:"),
                "{of}: no command {word} of {path:?}"
            );
        }
    }
    for option in options {
        let known = help.split(|c: char| !(c.is_alphanumeric() || c == '-'));
        assert!(
            { known }.any(|word| word == option),
            "{of}: {path:?} has no {option}"
        );
    }
}

#[test]
fn every_command_of_the_pages_works() {
    let place = Place::new();
    let listener = place.listen();
    // For the recorder: a domain where something is said.
    let player = "lattice node bag_player --ros-args -p bag:=LOG -p loop:=true -p keyboard:=false";
    let mut used = BTreeSet::new();
    let mut wrong = Vec::new();
    for block in blocks("sh") {
        let of = format!("{}:{}", block.page, block.number);
        let _player = (block.page == "docs/recording.md").then(|| place.start(player));
        for command in block.commands() {
            let command = installed(&command);
            let Some(rule) = rule_of(&block.page, &command) else {
                wrong.push(format!("{of}: {command}"));
                continue;
            };
            used.insert(rule);
            let _ = writeln!(stderr(), "{of}: {command}");
            match RULES[rule].2 {
                Rule::Runs(more) => place.run(&of, &format!("{command} {more}")),
                Rule::Serves(more, line) => {
                    let server = place.start(&with_options(&command, more));
                    server.wait_for(line, &of);
                    server.end(&of);
                }
                Rule::Works(node) => {
                    let server = place.start(&command);
                    listener.wait_for(node, &of);
                    server.end(&of);
                }
                Rule::Script => {
                    place.run(&of, &block.text);
                    break;
                }
                Rule::NotHere(reason) => {
                    let _ = writeln!(stderr(), "  not run: {reason}");
                    if command.starts_with("lattice") {
                        check_options(&command, &of);
                    }
                }
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "commands without a rule in rules.rs: {wrong:#?}"
    );
    let unused: Vec<_> = (0..RULES.len())
        .filter(|rule| !used.contains(rule))
        .collect();
    let unused: Vec<_> = unused.iter().map(|rule| RULES[*rule]).collect();
    assert!(unused.is_empty(), "rules of no command: {unused:#?}");
    check_keystore(place.home.path());
}

/// The keystore of docs/security.md: what is signed holds, and the files are where nodes look for them.
fn check_keystore(home: &Path) {
    let enclave: PathBuf = home.join("keystore/enclaves/lattice_mapper");
    for what in ["governance", "permissions"] {
        let verified = Command::new("openssl")
            .args(["smime", "-verify", "-text", "-in", &format!("{what}.p7s")])
            .args(["-CAfile", "permissions_ca.cert.pem"])
            .current_dir(&enclave)
            .output()
            .unwrap();
        let words = String::from_utf8_lossy(&verified.stderr);
        assert!(verified.status.success(), "{what}: {words}");
    }
    for file in ["cert.pem", "key.pem", "identity_ca.cert.pem"] {
        assert!(enclave.join(file).exists(), "{file}");
    }
}

#[test]
fn options_of_commands_that_are_not_run_are_checked() {
    check_options("lattice paper voxels --out report --quick", "");
    let refused = std::panic::catch_unwind(|| check_options("lattice paper voxels --fast", ""));
    assert!(refused.is_err());
    let refused = std::panic::catch_unwind(|| check_options("lattice evaluate nothing", ""));
    assert!(refused.is_err());
}

#[test]
fn blocks_of_all_pages_are_found() {
    let pages: BTreeSet<String> = { blocks("sh") }
        .into_iter()
        .map(|block: Block| block.page)
        .collect();
    for page in [
        "README.md",
        "docs/recording.md",
        "docs/security.md",
        "docs/viewer.md",
    ] {
        assert!(pages.contains(page), "{page}");
    }
}
