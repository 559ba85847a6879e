//! DDS Security: messages arrive from peers with key and permission, from nobody else, and cannot be read.

mod foreign;
mod keystore;
mod peers;

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::channel;

use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::std_msgs::String as RosString;
use lattice_nodes::executables;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::security::{self, Security};
use lattice_runtime::{Node, Runtime, RuntimeError, Subscription, SubscriptionExecutor, lock};
use lattice_test::domain::TestDomain;
use lattice_test::python::{python, script};

use self::keystore::{Keystore, NOW, OF_A_NODE, PAST, openssl_is_there};
use self::peers::{Peer, QOS, talk, topic, until};

/// Words received from a permitted peer while none of others is: 5 s.
const WORDS: usize = 50;

/// The number of participants that a runtime keeps out, as its diagnostics state it.
fn kept_out_by(node: &Node) -> (Arc<AtomicU64>, Subscription) {
    let stated = Arc::<AtomicU64>::default();
    let newest = Arc::clone(&stated);
    let name = format!(
        "{}: transport",
        node.params().node().trim_start_matches('/')
    );
    let hear = move |message: Arc<DiagnosticArray>| {
        let tasks = message.status.iter().filter(|task| task.name == name);
        for value in tasks.flat_map(|task| &task.values) {
            if value.key == "participants_kept_out" {
                newest.store(value.value.parse().unwrap(), Relaxed);
            }
        }
    };
    let qos = Qos::DIAGNOSTICS;
    let heard = node.subscribe("/diagnostics", qos, SubscriptionExecutor::Shared, hear);
    (stated, heard.unwrap())
}

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
        security,
        ..domain.transport()
    };
    let args = ["--ros-args", "--enclave", enclave].map(str::to_owned);
    Runtime::with_transport(name, RosArgs::parse(args).unwrap(), &network)
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
    let talker = runtime(&domain, "talk", "/ours", Some(ours.enforced())).unwrap();
    let (sender, heard) = channel();
    let _talk = talk(&talker, ("talk", domain.id()), "ours", sender);
    let node = talker.node("talk").unwrap();
    let _tasks = node.diagnostics();
    let (counted, _diagnostics) = kept_out_by(&node);
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
    let before = expected.map(|(peer, word)| peer.count(word));
    let kept_out = || {
        let log = lock(&friend.log);
        let lines = log
            .iter()
            .filter(|line| line.contains("is not authenticated"));
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
            let counts = [kept_out().len() as u64, counted.load(Relaxed)];
            more >= WORDS && all_go_on && counts.iter().all(|count| *count >= 4)
        },
    );
    words.remove("");
    assert_eq!(words, BTreeSet::from(["friend".to_owned()]));
    for (peer, word) in expected {
        let heard: BTreeSet<_> = peer.heard().into_iter().collect();
        assert_eq!(heard, BTreeSet::from([word.to_owned()]));
    }
    assert_eq!(counted.load(Relaxed), 4);
    let lines = kept_out();
    let addresses: BTreeSet<_> = lines.iter().map(|line| line.split("]: ").last()).collect();
    assert_eq!(
        lines.len(),
        addresses.len(),
        "one line for each: {lines:#?}"
    );
}

#[test]
fn what_cannot_be_secured_is_refused_with_its_reason() {
    if !can_run() {
        return;
    }
    let (ours, others) = (Keystore::make(), Keystore::make());
    for name in ["good", "unsigned", "alien", "locked", "revoked"] {
        ours.add(name, &OF_A_NODE, NOW);
    }
    ours.add("expired", &OF_A_NODE, PAST);
    ours.certify("alien", &others);
    ours.revoke("revoked");
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
        ("/revoked", "certificate revoked"),
        ("/locked", "locked/key.pem cannot be read"),
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
    // These do not start without a log or a model.
    let nodes = executables::NODES.iter();
    for (name, start) in nodes.filter(|(name, _)| !["bag_player", "segmenter"].contains(name)) {
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
            node.subscribe("/camera", QOS, SubscriptionExecutor::Shared, handler)
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
        let _ = capture.wait();
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
        let subscription = talk(&talker, ("talk", domain.id()), marker, sender);
        let friend = Peer::start(&domain, "friend", keystore);
        until(&heard, "a talk", |_| friend.count(marker) >= WORDS);
        drop((friend, subscription, talker));
        // The next line is of what was sent until now, so nothing of this talk is in the one after it.
        capture.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
        let counts: Vec<u32> = serde_json::from_str(&found.next().unwrap().unwrap()).unwrap();
        println!("{marker}: {counts:?} of {secrets:?}");
        match keystore {
            None => assert!(counts[0] > 0 && counts[2] > 0),
            Some(_) => assert_eq!(counts, [0, 0, 0]),
        }
    }
    drop(capture.stdin.take());
    assert!(capture.wait().unwrap().success());
}
