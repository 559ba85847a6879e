//! A keyframe of somebody else in the mapper's name, over DDS: whoever follows the map notices it with the mapper's next
//! update, and has the mapper's map again.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use lattice_core::lattice::LatticeKind;
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::cdr;
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::std_msgs::Empty;
use lattice_nodes::lattice_mapper::LatticeMapper;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Publisher, Runtime, SubscriptionExecutor};
use lattice_test::domain::TestDomain;
use lattice_test::maps::{self, insert};
use lattice_test::peer::{Nodes, params};

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

/// Values of `/diagnostics` by task and key, as they come.
type Stated = Receiver<BTreeMap<(String, String), String>>;

fn process(domain: &TestDomain, name: &str) -> (Runtime, Node) {
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport(name, args, &domain.transport()).unwrap();
    let node = runtime.node(name).unwrap();
    (runtime, node)
}

/// Waits until a task has these values, and meanwhile does this with each statement.
#[track_caller]
fn until(stated: &Stated, task: &str, expected: &[(&str, u64)], mut meanwhile: impl FnMut()) {
    let late = Instant::now() + PATIENCE;
    loop {
        assert!(Instant::now() < late, "{task}: no {expected:?}");
        meanwhile();
        let Ok(values) = stated.recv_timeout(PATIENCE) else {
            panic!("{task}: no {expected:?}");
        };
        let is = |(key, value): &(&str, u64)| {
            values.get(&(task.to_owned(), (*key).to_owned())) == Some(&value.to_string())
        };
        if expected.iter().all(is) {
            return;
        }
    }
}

/// A line of points, so many cells long, at a height.
fn line(cells: usize, z: f32) -> Vec<[f32; 3]> {
    (0..cells).map(|i| [0.5 * i as f32, 0.0, z]).collect()
}

struct Mapper {
    machine: LatticeMapper,
    maps: Publisher<LatticeMap>,
    updates: Publisher<LatticeMapUpdate>,
}

impl Mapper {
    fn keyframe(&mut self) {
        for chunk in self.machine.keyframe() {
            self.maps.publish(chunk).unwrap();
        }
    }

    fn update(&mut self, points: &[[f32; 3]]) {
        insert(&mut self.machine, points);
        for chunk in self.machine.take_update() {
            self.updates.publish(chunk).unwrap();
        }
    }

    fn voxels(&self) -> u64 {
        self.machine.list().len() as u64
    }
}

#[test]
fn a_forged_keyframe_lasts_until_the_next_update() {
    let domain = TestDomain::take();
    // The task of each follower, and where it states its map.
    let followers = [
        ("semantic_icp_server", "calibration", "map_voxels"),
        ("voxel_marker_publisher", "markers", "voxels"),
    ];
    let nodes = followers.map(|(node, ..)| (node, params("")));
    let nodes = Nodes::start(&domain, &nodes);
    let (_runtime, node) = process(&domain, "lattice_mapper");
    let (_forging, forger) = process(&domain, "forger");
    let (state, stated) = channel();
    let hear = move |all: Arc<DiagnosticArray>| {
        let values = all.status.iter().flat_map(|status| {
            let value = |value: &lattice_msgs::diagnostic_msgs::KeyValue| {
                (
                    (status.name.clone(), value.key.clone()),
                    value.value.clone(),
                )
            };
            status.values.iter().map(value)
        });
        let _ = state.send(values.collect());
    };
    let diagnostics = node.subscribe(
        "/diagnostics",
        Qos::DIAGNOSTICS,
        SubscriptionExecutor::Shared,
        hear,
    );
    let _diagnostics = diagnostics.unwrap();
    let (ask, asked) = channel();
    let request = move |_: Arc<Empty>| _ = ask.send(());
    let requests = node.subscribe(
        "~/request_keyframe",
        Qos::DEFAULT,
        SubscriptionExecutor::Shared,
        request,
    );
    let _requests = requests.unwrap();
    let mut mapper = Mapper {
        machine: maps::mapper(maps::options(LatticeKind::Fcc, 0.125)),
        maps: node.publisher("voxel_map", Qos::MAP).unwrap(),
        updates: node.publisher("voxel_map_updates", Qos::DELTAS).unwrap(),
    };
    let forgery: Publisher<LatticeMap> = forger.publisher("voxel_map", Qos::MAP).unwrap();
    while mapper.maps.subscriber_count() < followers.len()
        || mapper.updates.subscriber_count() < followers.len()
        || forgery.subscriber_count() < followers.len()
    {
        std::thread::sleep(Duration::from_millis(1));
    }
    let each_has = |expected: u64, differences: u64, meanwhile: &mut dyn FnMut()| {
        for (node, task, key) in followers {
            let expected = [(key, expected), ("map_differences", differences)];
            until(
                &stated,
                &format!("{node}: {task}"),
                &expected,
                &mut *meanwhile,
            );
        }
    };
    insert(&mut mapper.machine, &line(300, 0.0));
    mapper.machine.take_update();
    mapper.keyframe();
    each_has(mapper.voxels(), 0, &mut || {});
    // As of the mapper's points, and of a time to come.
    let future = Time {
        sec: i32::MAX,
        nanosec: 0,
    };
    for (number, stamp) in (1..).zip([Time::default(), future]) {
        // 4 MB.
        let mut other = maps::mapper(maps::options(LatticeKind::Fcc, 0.125));
        let size = 600_u64;
        for y in 0..size {
            let row = line(size as usize, 50.0);
            let row: Vec<_> = row
                .iter()
                .map(|[x, _, z]| [1.6 * x, 0.8 * y as f32, *z])
                .collect();
            insert(&mut other, &row);
        }
        let mut forged = other.keyframe();
        for chunk in &mut forged {
            chunk.sequence = 1000 * number;
            chunk.header.stamp = stamp;
        }
        let bytes = |chunk: &LatticeMap| cdr::to_vec(chunk).unwrap().len();
        assert!(forged.iter().map(bytes).sum::<usize>() > 3 << 20);
        let forge = || {
            for chunk in &forged {
                forgery.publish(chunk.clone()).unwrap();
                assert!(forgery.flush(PATIENCE));
            }
        };
        forge();
        each_has(other.list().len() as u64, number - 1, &mut || {
            // Where a part of it was lost.
            if asked.try_recv().is_ok() {
                forge();
            }
        });
        while asked.try_recv().is_ok() {}
        // The mapper maps the same again, once a second. Its next update is enough, but where the stamp is of a time to
        // come: there it takes until no update of before can be on its way.
        let more = line(10, -10.0 * number as f32);
        mapper.update(&more);
        let (voxels, mut last) = (mapper.voxels(), Instant::now());
        each_has(voxels, number, &mut || {
            if asked.try_recv().is_ok() {
                mapper.keyframe();
            } else if stamp == future && last.elapsed() > Duration::from_secs(1) {
                last = Instant::now();
                mapper.update(&more);
            }
        });
    }
    nodes.finish();
}
