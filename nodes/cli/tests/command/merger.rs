//! Two robots, each with its mapper in a process and a namespace of its own, and their maps as one; one of
//! them is killed and begins anew.

use std::collections::BTreeMap;
use std::process::Child;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use lattice_core::lattice::MortonKey;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::vision_msgs::LabelInfo;
use lattice_nodes::convert::{cloud, geometry};
use lattice_nodes::map_follower::{Followed, MapFollower};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{
    LoopbackDomain, Node, Publisher, Runtime, Subscription, SubscriptionExecutor,
};

use crate::PATIENCE;
use crate::record::{signal, start};

enum MapEvent {
    Map(Arc<LatticeMap>),
    Update(Arc<LatticeMapUpdate>),
}

/// A map of one namespace.
struct Listener {
    follower: MapFollower,
    heard: Receiver<MapEvent>,
    request: Publisher<lattice_msgs::std_msgs::Empty>,
    _subscriptions: [Subscription; 2],
}

impl Listener {
    fn start(node: &Node, namespace: &str, mapper: &str) -> Self {
        let (sender, heard) = channel();
        let maps = sender.clone();
        let (map, updates) = (
            format!("{namespace}/voxel_map"),
            format!("{namespace}/voxel_map_updates"),
        );
        let subscriptions = [
            node.subscribe(&map, Qos::MAP, SubscriptionExecutor::Shared, move |m| {
                drop(maps.send(MapEvent::Map(m)))
            }),
            node.subscribe(
                &updates,
                Qos::DELTAS,
                SubscriptionExecutor::Shared,
                move |m| {
                    drop(sender.send(MapEvent::Update(m)));
                },
            ),
        ];
        let asked = format!("{namespace}/{mapper}/request_keyframe");
        Self {
            follower: MapFollower::new(usize::MAX),
            heard,
            request: node.publisher(&asked, Qos::DEFAULT).unwrap(),
            _subscriptions: subscriptions.map(Result::unwrap),
        }
    }

    /// Takes what has come, and waits a little if that is nothing.
    fn listen(&mut self) {
        let mut wait = Duration::from_millis(20);
        loop {
            let followed = match self.heard.recv_timeout(wait) {
                Ok(MapEvent::Map(message)) => self.follower.on_map(&message),
                Ok(MapEvent::Update(message)) => self.follower.on_update(&message),
                Err(RecvTimeoutError::Timeout) => return,
                Err(RecvTimeoutError::Disconnected) => panic!("the subscription has ended"),
            };
            if followed.unwrap() == Followed::NeedKeyframe {
                self.request
                    .publish(lattice_msgs::std_msgs::Empty::default())
                    .unwrap();
            }
            wait = Duration::ZERO;
        }
    }

    fn counts(&self) -> BTreeMap<MortonKey, u32> {
        let map = self.follower.map().into_iter();
        let voxels = map.flat_map(|map| map.voxels().iter());
        voxels.map(|(key, state)| (*key, state.count)).collect()
    }

    fn epoch(&self) -> Option<u64> {
        self.follower.sequence()?;
        self.follower.map().map(|map| map.info.epoch)
    }
}

/// A cloud about a place, others for other seeds.
fn points(seed: u32, x: f32) -> PointCloud2 {
    let mut data = Vec::new();
    for i in 0..800_u32 {
        let spread = |k: u32| ((i * k + seed * 31) % 97) as f32 / 9.7;
        for v in [x + spread(7), spread(13), spread(29) / 4.0] {
            data.extend_from_slice(&v.to_le_bytes());
        }
    }
    let fields = cloud::xyz_fields(PointField::FLOAT32, 4);
    cloud::dense_cloud(geometry::header("map", 1), fields, 12, 800, data)
}

fn mapper(domain: &LoopbackDomain, robot: &str) -> Child {
    let namespace = format!("__ns:=/{robot}");
    start(
        domain,
        &["node", "lattice_mapper", "--ros-args", "-r", &namespace],
    )
}

#[test]
fn the_map_of_two_robots_stays_exact_when_one_begins_anew() {
    let domain = LoopbackDomain::take().unwrap();
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let args = RosArgs::parse([]).unwrap();
    let runtime = Runtime::with_transport("world", args, &network).unwrap();
    let node = runtime.node("world").unwrap();
    let names = ["robot1", "robot2"];
    let mut robots = names.map(|name| mapper(&domain, name));
    let arguments = [
        "node",
        "map_merger",
        "--ros-args",
        "-p",
        "update_period_s:=0.2",
        "-p",
        "labels:=robots",
    ];
    let mut merger = start(&domain, &arguments);
    let clouds = names.map(|name| {
        let topic = format!("/{name}/points_enu");
        node.publisher::<PointCloud2>(&topic, Qos::SCANS).unwrap()
    });
    let mut maps = names.map(|name| Listener::start(&node, &format!("/{name}"), "lattice_mapper"));
    let mut merged = Listener::start(&node, "", "map_merger");

    // Clouds come on best effort: again until the robots' maps have them, then the merged map is to be
    // the sum of what the robots have.
    let mut seed = 0;
    let mut until = |maps: &mut [Listener; 2],
                     merged: &mut Listener,
                     publishes: bool,
                     what: &str,
                     reached: &dyn Fn(&[Listener; 2]) -> bool| {
        let begin = Instant::now();
        loop {
            maps.iter_mut().for_each(Listener::listen);
            merged.listen();
            let mut sum = maps[0].counts();
            for (key, count) in maps[1].counts() {
                *sum.entry(key).or_default() += count;
            }
            if reached(maps) && !publishes && sum == merged.counts() {
                return;
            }
            if reached(maps) && publishes {
                return;
            }
            assert!(
                begin.elapsed() < PATIENCE,
                "{what}: {} of {} voxels",
                merged.counts().len(),
                sum.len()
            );
            if publishes {
                seed += 1;
                for (cloud, x) in clouds.iter().zip([0.0, 4.0]) {
                    cloud.publish(points(seed, x)).unwrap();
                }
            }
        }
    };
    let both = |maps: &[Listener; 2]| maps.iter().all(|map| map.counts().len() > 300);
    until(&mut maps, &mut merged, true, "both robots map", &both);
    until(&mut maps, &mut merged, false, "the sum", &both);
    let old = maps[1].epoch();
    signal(&robots[1], "-KILL");
    robots[1].wait().unwrap();
    // Its share stays while it is away.
    let all = merged.counts();
    robots[1] = mapper(&domain, names[1]);
    let new = |maps: &[Listener; 2]| maps[1].epoch() != old && both(maps);
    until(&mut maps, &mut merged, true, "the robot is back", &new);
    until(&mut maps, &mut merged, false, "the new sum", &new);
    assert_ne!(all, merged.counts());
    // A late listener is told the names of the labels, which are those of the robots.
    let (told, names_told) = channel();
    let told = move |info: Arc<LabelInfo>| drop(told.send(info));
    let _info = node
        .subscribe(
            "/label_info",
            Qos::LATCHED,
            SubscriptionExecutor::Shared,
            told,
        )
        .unwrap();
    let info = names_told.recv_timeout(PATIENCE).unwrap();
    let info = info.class_map.iter();
    let info: Vec<_> = info
        .map(|class| (class.class_id, class.class_name.as_str()))
        .collect();
    assert_eq!(info, [(0, names[0]), (1, names[1])]);
    for process in robots.iter_mut().chain([&mut merger]) {
        signal(process, "-TERM");
        assert!(process.wait().unwrap().success());
    }
}
