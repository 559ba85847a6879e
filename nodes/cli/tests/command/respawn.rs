//! Nodes that are killed while a log plays, and started again with the same arguments, as `respawn` of a
//! launch file does.

use std::collections::BTreeSet;
use std::fs;
use std::io::BufReader;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::file::MapContents;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Empty;
use lattice_nodes::map_follower::{Followed, MapFollower};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Publisher, Runtime, Subscription, SubscriptionExecutor};

use crate::PATIENCE;
use crate::nodes::simulated;
use crate::record::{PARAMS, expect, play, signal, start};

const NODES: [&str; 3] = [
    "enu_transformer",
    "lattice_mapper",
    "voxel_marker_publisher",
];

/// A node in a process of its own, and what starts it again.
struct Supervised {
    arguments: Vec<String>,
    process: Child,
}

impl Supervised {
    fn start(domain: &LoopbackDomain, node: &str, folder: &Path) -> Self {
        let mut arguments: Vec<String> = ["node", node, "--ros-args", "--params-file", PARAMS]
            .map(str::to_owned)
            .into();
        let folder = folder.display();
        let mut params = vec![format!("report_file:={folder}/{node}.json")];
        if node == "lattice_mapper" {
            params.extend([
                format!("map_dir:={folder}"),
                "autosave_period_s:=0.2".to_owned(),
                "resume:=true".to_owned(),
            ]);
        }
        arguments.extend(
            params
                .into_iter()
                .flat_map(|param| ["-p".to_owned(), param]),
        );
        let process = spawn(domain, &arguments);
        Self { arguments, process }
    }

    /// Kills the process; the next one has the same arguments.
    fn kill_and_respawn(&mut self, domain: &LoopbackDomain, text: &str) {
        signal(&self.process, "-KILL");
        self.process.wait().unwrap();
        self.process = spawn(domain, &self.arguments);
        expect(&mut self.process, &[text]);
    }

    fn end(&mut self) {
        signal(&self.process, "-TERM");
        assert!(self.process.wait().unwrap().success());
    }
}

fn spawn(domain: &LoopbackDomain, arguments: &[String]) -> Child {
    start(
        domain,
        &arguments.iter().map(String::as_str).collect::<Vec<_>>(),
    )
}

enum MapEvent {
    Map(std::sync::Arc<LatticeMap>),
    Update(std::sync::Arc<LatticeMapUpdate>),
}

/// A follower of the map in the test's own process.
struct Viewer {
    follower: MapFollower,
    heard: Receiver<MapEvent>,
    request: Publisher<Empty>,
    _subscriptions: [Subscription; 2],
    _runtime: Runtime,
}

impl Viewer {
    fn start(domain: &LoopbackDomain) -> Self {
        let network = Network {
            domain_id: domain.id(),
            localhost_only: true,
            ..Network::from_env().unwrap()
        };
        let args = RosArgs::parse([]).unwrap();
        let runtime = Runtime::with_transport("viewer", args, &network).unwrap();
        let node = runtime.node("viewer").unwrap();
        let (sender, heard) = channel();
        let maps = sender.clone();
        let subscriptions = [
            node.subscribe(
                "voxel_map",
                Qos::MAP,
                SubscriptionExecutor::Shared,
                move |m| drop(maps.send(MapEvent::Map(m))),
            ),
            node.subscribe(
                "voxel_map_updates",
                Qos::DELTAS,
                SubscriptionExecutor::Shared,
                move |m| {
                    drop(sender.send(MapEvent::Update(m)));
                },
            ),
        ];
        Self {
            follower: MapFollower::new(usize::MAX),
            heard,
            request: node
                .publisher("lattice_mapper/request_keyframe", Qos::DEFAULT)
                .unwrap(),
            _subscriptions: subscriptions.map(Result::unwrap),
            _runtime: runtime,
        }
    }

    fn keys(&self) -> BTreeSet<MortonKey> {
        let map = self.follower.map().into_iter();
        map.flat_map(|map| map.voxels().keys().copied()).collect()
    }

    /// Follows until the cells of the map are as wanted; a change of files counts as one of the map.
    fn until(&mut self, what: &str, reached: impl Fn(&BTreeSet<MortonKey>) -> bool) {
        let begin = Instant::now();
        while !reached(&self.keys()) {
            assert!(
                begin.elapsed() < PATIENCE,
                "{what}: {} voxels",
                self.keys().len()
            );
            let followed = match self
                .heard
                .recv_timeout(std::time::Duration::from_millis(100))
            {
                Ok(MapEvent::Map(message)) => self.follower.on_map(&message),
                Ok(MapEvent::Update(message)) => self.follower.on_update(&message),
                Err(_) => Ok(Followed::Old),
            };
            if followed.unwrap() == Followed::NeedKeyframe {
                self.request.publish(Empty::default()).unwrap();
            }
        }
    }
}

/// Cells of a map file.
fn saved(path: &Path) -> BTreeSet<MortonKey> {
    let map = MapContents::read(BufReader::new(fs::File::open(path).unwrap()), usize::MAX);
    map.unwrap().keys().iter().copied().collect()
}

#[test]
fn nodes_that_are_killed_come_back_and_followers_agree_with_the_mapper() {
    let folder = tempfile::tempdir().unwrap();
    let log = simulated(folder.path(), "mcap", "12");
    let map: PathBuf = folder.path().join("autosave.lattice");
    let domain = LoopbackDomain::take().unwrap();
    let mut viewer = Viewer::start(&domain);
    let mut nodes = NODES.map(|node| Supervised::start(&domain, node, folder.path()));
    let topics = "wait_for_subscribers:=['/left/points', '/novatel/oem7/inspvax']";
    let mut player = play(&domain, &log, &[topics, "settle_s:=2.0"]);
    drop(player.stderr.take());

    viewer.until("the log begins", |keys| keys.len() > 100);
    // What is on the disk once two more saves are done was all there when the first of them began.
    let known = viewer.keys();
    let file = || fs::metadata(&map).map(|file| file.ino()).unwrap_or(0);
    for _ in 0..2 {
        let before = file();
        viewer.until("a save", |_| file() != before);
    }
    nodes[1].kill_and_respawn(&domain, "resumed with ");
    let back = saved(&map);
    assert!(
        known.is_subset(&back),
        "{} of {} cells",
        back.len(),
        known.len()
    );
    viewer.until("the mapper is back", |keys| keys.len() > back.len());
    assert!(known.is_subset(&viewer.keys()));
    for node in [0, 2] {
        nodes[node].kill_and_respawn(&domain, "publisher matched");
        let before = viewer.keys().len();
        viewer.until("the map grows on", |keys| keys.len() > before);
    }

    assert!(player.wait().unwrap().success());
    nodes[0].end();
    nodes[1].end();
    let map = saved(&map);
    viewer.until("the whole map", |keys| *keys == map);
    nodes[2].end();
    let report = fs::read(folder.path().join("voxel_marker_publisher.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["voxels"], map.len(), "{report}");
}
