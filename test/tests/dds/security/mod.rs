//! DDS Security: who has a key and a permission is heard, nobody else is, and nothing can be read.
//!
//! Peers are processes: this test program once more, as the test `peer`.

mod keystore;

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lattice_msgs::std_msgs::String as RosString;
use lattice_nodes::executables;
use lattice_runtime::env::{Network, TransportKind};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::security::{self, Security};
use lattice_runtime::{Load, Runtime, RuntimeError, Subscription, lock, logging};
use lattice_test::domain::TestDomain;
use lattice_test::python::{python, script};

use self::keystore::{Keystore, NOW, OF_A_NODE, PAST, openssl_is_there};

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);
/// Between two words of a peer.
const PERIOD: Duration = Duration::from_millis(100);
/// Words that are heard from a friend while strangers are heard not once: 5 s.
const WORDS: usize = 50;
const QOS: Qos = Qos::reliable(100);

const DOMAIN: &str = "LATTICE_TEST_PEER_DOMAIN";
const WORD: &str = "LATTICE_TEST_PEER_WORD";

/// False, with a line on standard error, where there is nothing to test.
fn can_run() -> bool {
    if !security::BUILT_IN {
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: built without the feature `security`"
        );
    }
    security::BUILT_IN && openssl_is_there()
}

fn runtime(
    domain: &TestDomain,
    name: &str,
    enclave: &str,
    security: Option<Security>,
) -> Result<Runtime, RuntimeError> {
    let network = Network {
        transport: TransportKind::Cyclone,
        security,
        ..domain.transport()
    };
    let args = ["--ros-args", "--enclave", enclave].map(str::to_owned);
    Runtime::with_transport(name, RosArgs::parse(args).unwrap(), &network)
}

/// Topic of the talks in a domain, which no other test has.
fn topic(domain: u16) -> String {
    format!("/domain{domain}/talk")
}

/// Says a word again and again; others' words come to `heard`.
fn talk(
    runtime: &Runtime,
    (name, domain): (&str, u16),
    word: &str,
    heard: Sender<String>,
) -> Subscription {
    let node = runtime.node(name).unwrap();
    let out = node.publisher(&topic(domain), QOS).unwrap();
    let own = word.to_owned();
    let handler = move |message: Arc<RosString>| {
        if message.data != own {
            let _ = heard.send(message.data.clone());
        }
    };
    let subscription = node
        .subscribe(&topic(domain), QOS, Load::Small, handler)
        .unwrap();
    let data = word.to_owned();
    runtime.timer(PERIOD, move || {
        let _ = out.publish(RosString { data: data.clone() });
    });
    subscription
}

#[test]
#[ignore = "the other end of the tests here, not one itself"]
fn peer() {
    let (Ok(id), Ok(word)) = (std::env::var(DOMAIN), std::env::var(WORD)) else {
        return;
    };
    let network = Network {
        domain_id: id.parse().unwrap(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let args = ["--ros-args", "--enclave", &format!("/{word}")].map(str::to_owned);
    let args = RosArgs::parse(args).unwrap();
    logging::init(&args, "peer").unwrap();
    let runtime = Runtime::with_transport("peer", args, &network).unwrap();
    let (sender, heard) = channel();
    let _talk = talk(&runtime, ("peer", network.domain_id), &word, sender);
    for word in heard {
        println!("heard {word}");
    }
}

/// A process that talks, and writes down what it hears.
struct Peer {
    child: Child,
    heard: Arc<Mutex<Vec<String>>>,
    log: Arc<Mutex<Vec<String>>>,
}

impl Peer {
    fn start(domain: &TestDomain, word: &str, keystore: Option<&Keystore>) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "security::peer", "--ignored", "--nocapture"])
            .env(DOMAIN, domain.id().to_string())
            .env(WORD, word)
            .env("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        if let Some(keystore) = keystore {
            command
                .env("ROS_SECURITY_ENABLE", "true")
                .env("ROS_SECURITY_STRATEGY", "Enforce")
                .env("ROS_SECURITY_KEYSTORE", keystore.path(""));
        }
        let mut child = command.spawn().unwrap();
        Self {
            heard: lines(child.stdout.take().unwrap(), "heard "),
            log: lines(child.stderr.take().unwrap(), ""),
            child,
        }
    }

    fn count(&self, word: &str) -> usize {
        lock(&self.heard)
            .iter()
            .filter(|heard| *heard == word)
            .count()
    }

    fn all(&self) -> BTreeSet<String> {
        lock(&self.heard).iter().cloned().collect()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Rests of lines that begin with `start`, as they come.
fn lines(
    from: impl std::io::Read + Send + 'static,
    start: &'static str,
) -> Arc<Mutex<Vec<String>>> {
    let lines = Arc::new(Mutex::new(Vec::new()));
    let out = Arc::clone(&lines);
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            if let Some(rest) = line.strip_prefix(start) {
                lock(&out).push(rest.to_owned());
            }
        }
    });
    lines
}

/// Takes words until `enough` of them are there, and gives the last ones.
fn until(heard: &Receiver<String>, what: &str, mut enough: impl FnMut(&str) -> bool) {
    let start = Instant::now();
    loop {
        assert!(start.elapsed() < PATIENCE, "{what}: in vain");
        match heard.recv_timeout(PERIOD) {
            Ok(word) if enough(&word) => return,
            Ok(_) => {}
            Err(RecvTimeoutError::Timeout) if enough("") => return,
            Err(RecvTimeoutError::Timeout) => {}
            Err(error) => panic!("{error}"),
        }
    }
}

#[test]
fn permitted_peers_hear_each_other_and_nobody_else() {
    if !can_run() {
        return;
    }
    let topics = [&OF_A_NODE[..], &["rt/domain*/talk"]].concat();
    let (ours, others) = (Keystore::make(), Keystore::make());
    ours.add("ours", &topics, NOW);
    ours.add("friend", &topics, NOW);
    for name in ["stranger1", "stranger2"] {
        others.add(name, &topics, NOW);
    }
    let domain = TestDomain::take();
    let start = Instant::now();
    let talker = runtime(&domain, "talk", "/ours", Some(ours.enforced())).unwrap();
    let (sender, heard) = channel();
    let _talk = talk(&talker, ("talk", domain.id()), "ours", sender);
    let friend = Peer::start(&domain, "friend", Some(&ours));
    // Each stranger has one of its kind, who shows that it can be heard.
    let strangers = [("stranger", Some(&others)), ("open", None)].map(|(kind, keystore)| {
        let names = [format!("{kind}1"), format!("{kind}2")];
        names
            .each_ref()
            .map(|name| Peer::start(&domain, name, keystore))
    });
    let [[stranger1, stranger2], [open1, open2]] = &strangers;
    let expected = [
        (&friend, "ours"),
        (stranger1, "stranger2"),
        (stranger2, "stranger1"),
        (open1, "open2"),
        (open2, "open1"),
    ];
    let mut words = BTreeSet::new();
    until(&heard, "all talk", |word| {
        words.insert(word.to_owned());
        expected.iter().all(|(peer, word)| peer.count(word) > 0)
    });
    println!("all talk after {:?}", start.elapsed());
    let before = expected.map(|(peer, word)| peer.count(word));
    let kept_out = || {
        let log = lock(&friend.log);
        let lines = log.iter().filter(|line| line.contains("is kept out"));
        lines.cloned().collect::<Vec<_>>()
    };
    let mut more = 0;
    until(
        &heard,
        "they go on, and the strangers are noticed",
        |word| {
            words.insert(word.to_owned());
            more += usize::from(word == "friend");
            let after = expected.map(|(peer, word)| peer.count(word));
            let all_go_on = after
                .iter()
                .zip(before)
                .all(|(now, then)| *now >= then + WORDS);
            more >= WORDS && all_go_on && kept_out().len() >= 4
        },
    );
    words.remove("");
    assert_eq!(words, BTreeSet::from(["friend".to_owned()]));
    for (peer, word) in expected {
        assert_eq!(peer.all(), BTreeSet::from([word.to_owned()]));
    }
    assert_eq!(kept_out().len(), 4, "one line for each: {:#?}", kept_out());
}

#[test]
fn what_cannot_be_secured_is_refused_with_its_reason() {
    if !can_run() {
        return;
    }
    let (ours, others) = (Keystore::make(), Keystore::make());
    for name in ["good", "unsigned", "alien", "locked"] {
        ours.add(name, &OF_A_NODE, NOW);
    }
    ours.add("expired", &OF_A_NODE, PAST);
    ours.certify("alien", &others);
    let unsigned = ours.path("enclaves/unsigned/permissions.p7s");
    fs::write(
        &unsigned,
        fs::read_to_string(&unsigned)
            .unwrap()
            .replace("DENY", "ALLOW"),
    )
    .unwrap();
    fs::remove_file(ours.path("enclaves/locked/key.pem")).unwrap();
    let domain = TestDomain::take();
    assert!(runtime(&domain, "talk", "/good", Some(ours.enforced())).is_ok());
    for (enclave, reason) in [
        ("/alien", "certificate signature failure"),
        ("/expired", "expired"),
        ("/unsigned", "PKCS7"),
        (
            "/locked",
            "locked/key.pem, which security needs, cannot be read",
        ),
        ("/missing", "missing/identity_ca.cert.pem"),
    ] {
        let error = runtime(&domain, "talk", enclave, Some(ours.enforced()))
            .err()
            .unwrap()
            .to_string();
        println!("{error}");
        assert!(error.contains(reason), "{enclave}: {error}");
    }
    // What is not enforced goes on without security, but not with a part of it.
    let permissive = || {
        Some(Security {
            enforced: false,
            ..ours.enforced()
        })
    };
    assert!(runtime(&domain, "talk", "/missing", permissive()).is_ok());
    assert!(runtime(&domain, "talk", "/expired", permissive()).is_err());
}

#[test]
fn the_nodes_run_with_the_permissions_of_the_manual_and_with_no_others() {
    if !can_run() {
        return;
    }
    let keystore = Keystore::make();
    let domain = TestDomain::take();
    for (name, start) in executables::NODES
        .iter()
        .filter(|(name, _)| *name != "bag_player")
    {
        keystore.add_with(
            name,
            include_str!("../../../../docs/security/permissions.xml"),
        );
        let runtime = runtime(
            &domain,
            name,
            &format!("/{name}"),
            Some(keystore.enforced()),
        );
        let runtime = runtime.unwrap();
        let finish = start(&runtime, name).unwrap();
        let node = runtime.node(name).unwrap();
        let other = node
            .publisher::<RosString>("/cmd_vel", QOS)
            .err()
            .unwrap()
            .to_string();
        println!("{other}");
        assert!(other.contains("Not Allowed By Security"), "{other}");
        let handler = |_: Arc<RosString>| {};
        assert!(
            node.subscribe("/camera", QOS, Load::Small, handler)
                .is_err()
        );
        drop(node);
        finish();
    }
}

#[test]
fn what_is_said_cannot_be_read_on_the_wire() {
    let (true, Some(python)) = (can_run(), python()) else {
        return;
    };
    let keystore = Keystore::make();
    let topics = [&OF_A_NODE[..], &["rt/domain*/talk"]].concat();
    keystore.add("ours", &topics, NOW);
    keystore.add("friend", &topics, NOW);
    let domain = TestDomain::take();
    // A text of each talk, and the name of its topic.
    let topic = format!("rt{}", topic(domain.id()));
    let secrets = ["marker-in-the-open", "marker-in-secret", &*topic];
    let mut capture = Command::new(python)
        .arg(script("capture.py"))
        .args(secrets)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut found = BufReader::new(capture.stdout.take().unwrap()).lines();
    if found.next().unwrap().unwrap() != "ready" {
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: this user may not capture datagrams"
        );
        return;
    }
    let talks = [(secrets[0], None), (secrets[1], Some(&keystore))];
    for (marker, keystore) in talks {
        let security = keystore.map(Keystore::enforced);
        let talker = runtime(&domain, "talk", "/ours", security).unwrap();
        let (sender, heard) = channel();
        let _talk = talk(&talker, ("talk", domain.id()), marker, sender);
        let friend = Peer::start(&domain, "friend", keystore);
        until(&heard, "a talk", |_| friend.count(marker) >= WORDS);
        // The next line is of what was sent until now.
        capture.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
        let counts: Vec<u32> = serde_json::from_str(&found.next().unwrap().unwrap()).unwrap();
        println!("{marker}: {counts:?} of {secrets:?}");
        match keystore {
            None => assert!(counts[0] >= WORDS as u32 && counts[2] > 0),
            Some(_) => assert_eq!(counts, [0, 0, 0]),
        }
    }
    drop(capture.stdin.take());
    assert!(capture.wait().unwrap().success());
}
