//! `lattice doctor` beside broken set-ups.

use std::fs;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::Bool;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};
use serde_json::Value;

use crate::PATIENCE;
use crate::record::start;

fn doctor(domain: &LoopbackDomain, range: &str, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lattice"))
        .arg("doctor")
        .args(arguments)
        .env("ROS_DOMAIN_ID", domain.id().to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", range)
        .output()
        .unwrap()
}

/// The page once it has all these words; discovery takes longer on a loaded machine.
#[track_caller]
fn page(ask: impl Fn() -> Output, words: &[&str]) -> String {
    let begin = Instant::now();
    loop {
        let output = ask();
        let page = String::from_utf8(output.stdout).unwrap();
        let missing = words.iter().find(|words| !page.contains(*words));
        let Some(missing) = missing else {
            assert_eq!(output.status.code(), Some(1), "{page}");
            return page;
        };
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(begin.elapsed() < PATIENCE, "{missing}: {page}{errors}");
    }
}

fn network(domain: &LoopbackDomain) -> Network {
    Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    }
}

fn runtime(name: &str, network: &Network) -> Runtime {
    Runtime::with_transport(name, RosArgs::default(), network).unwrap()
}

/// Time of this machine and an offset.
fn stamp(offset_s: i32) -> Time {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    Time {
        sec: i32::try_from(now.unwrap().as_secs()).unwrap() + offset_s,
        nanosec: 0,
    }
}

fn transform(parent: &str, offset_s: i32) -> TransformStamped {
    let mut transform = TransformStamped::default();
    transform.header.frame_id = parent.to_owned();
    transform.header.stamp = stamp(offset_s);
    transform.child_frame_id = "base_link".to_owned();
    transform
}

#[test]
fn the_domain_of_others_is_the_first_line() {
    let [domain, other] = [(); 2].map(|()| LoopbackDomain::take().unwrap());
    let _lidar = runtime("lidar", &network(&other));
    let lines = [
        format!(
            "ERROR domain: no node of another process in domain {}",
            domain.id()
        ),
        format!(" {}: ", other.id()),
        "remedy: export ROS_DOMAIN_ID=".to_owned(),
    ];
    let ask = || doctor(&domain, "LOCALHOST", &[]);
    let page = page(ask, &lines.each_ref().map(String::as_str));
    assert!(page.starts_with(&lines[0]), "{page}");
}

#[test]
fn discovery_ranges_of_two_processes_differ() {
    let domain = LoopbackDomain::take().unwrap();
    let mut mapper = start(&domain, &["node", "lattice_mapper"]);
    let words = "ROS_AUTOMATIC_DISCOVERY_RANGE is SUBNET here and LOCALHOST in lattice (process ";
    let found = page(|| doctor(&domain, "SUBNET", &[]), &[words]);
    assert!(found.contains(&mapper.id().to_string()), "{found}");
    mapper.kill().unwrap();
    mapper.wait().unwrap();
}

#[test]
fn faults_of_a_graph_are_named() {
    let domain = LoopbackDomain::take().unwrap();
    let network = network(&domain);
    let [first, second] = ["driver", "mapper"].map(|name| runtime(name, &network));
    let third = runtime("mapper", &network);
    let [driver, mapper, twin] = [(&first, "driver"), (&second, "mapper"), (&third, "mapper")]
        .map(|(runtime, name)| runtime.node(name).unwrap());
    let points = driver
        .publisher::<PointCloud2>("points", Qos::SENSOR)
        .unwrap();
    let shared = SubscriptionExecutor::Shared;
    let _clouds = mapper.subscribe(
        "points",
        Qos::DEFAULT,
        shared,
        |_: std::sync::Arc<PointCloud2>| {},
    );
    let _switches = twin.subscribe("on", Qos::DEFAULT, shared, |_: std::sync::Arc<Bool>| {});
    let _on = driver
        .publisher::<Bool>("switched_on", Qos::DEFAULT)
        .unwrap();
    let hash = format!("RIHS01_{}", "a".repeat(64));
    let map = "lattice_msgs/msg/LatticeMap";
    let _map = driver
        .raw_publisher("/voxel_map", map, Some(&hash), Qos::MAP)
        .unwrap();
    let poses = driver.publisher("odom", Qos::INS).unwrap();
    let tf = driver.publisher("/tf", Qos::TF).unwrap();
    let _timer = first.timer(Duration::from_millis(100), move || {
        let mut pose = Odometry::default();
        pose.header.stamp = stamp(3600);
        let _ = poses.publish(pose);
        let _ = points.publish(PointCloud2::default());
        let transforms = vec![transform("odom", -30), transform("map", -30)];
        let _ = tf.publish(TFMessage { transforms });
    });
    let lines = [
        "ERROR QoS: /points: /mapper requests reliable, /driver offers best_effort (RELIABILITY)",
        "ERROR names: 2 nodes have the name /mapper",
        "ERROR version: lattice_msgs/msg/LatticeMap of /driver has another type hash",
        "ERROR clock: stamps on /odom (of /driver) are 60 min ahead of the clock of this machine",
        "ERROR tf: stale transforms on /tf (of /driver)",
        "ERROR tf: the frame base_link has 2 parents: map, odom",
        "WARN topics: /on of /mapper has no publisher; /switched_on of the same type",
    ];
    let page = page(|| doctor(&domain, "LOCALHOST", &[]), &lines);
    let (findings, facts) = page.split_once("\n\n").unwrap();
    assert!(lines.iter().all(|line| findings.contains(line)), "{page}");
    for row in [
        "transport        rmw_cyclonedds_cpp",
        "node             /driver (Cyclone DDS)",
    ] {
        assert!(facts.contains(row), "{facts}");
    }
    let output = doctor(&domain, "LOCALHOST", &["--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["facts"]["network"]["domain"], domain.id());
    assert_eq!(json["findings"][0]["severity"], "ERROR");
}

/// Runs a script of `sh` in namespaces of its own; `None`, with a line, where that is not permitted.
fn unshared(domain: &LoopbackDomain, flags: &str, range: &str, script: &str) -> Option<Output> {
    let is_permitted = Command::new("unshare")
        .args([flags, "true"])
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    if !is_permitted {
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), "SKIPPED: no namespaces of its own");
        return None;
    }
    let mut command = Command::new("unshare");
    command
        .args([flags, "sh", "-c", script])
        .env("LATTICE", env!("CARGO_BIN_EXE_lattice"))
        .env("ROS_DOMAIN_ID", domain.id().to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", range);
    Some(command.output().unwrap())
}

#[test]
fn a_machine_without_network_is_named() {
    let domain = LoopbackDomain::take().unwrap();
    let Some(output) = unshared(&domain, "-n", "SUBNET", "exec \"$LATTICE\" doctor") else {
        return;
    };
    let page = String::from_utf8_lossy(&output.stdout);
    let line = "ERROR multicast: no network interface that is up has multicast";
    assert!(page.contains(line), "{page}{output:?}");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_full_disk_of_maps_is_named() {
    let domain = LoopbackDomain::take().unwrap();
    let folder = std::env::temp_dir().join(format!("lattice_doctor_{}", std::process::id()));
    fs::create_dir(&folder).unwrap();
    let folder_name = folder.to_str().unwrap();
    let script = format!(
        "mount -t tmpfs -o size=1m none {folder_name} || exit 7
         \"$LATTICE\" node lattice_mapper --ros-args -p map_dir:={folder_name} >/dev/null 2>&1 &
         for i in 1 2 3 4 5 6 7 8 9 10; do
             \"$LATTICE\" doctor > {folder_name}/page 2>/dev/null
             grep -q 'ERROR disk' {folder_name}/page && break
         done
         kill $!; cat {folder_name}/page"
    );
    let output = unshared(&domain, "-m", "LOCALHOST", &script);
    fs::remove_dir(&folder).unwrap();
    let Some(output) = output.filter(|output| output.status.code() != Some(7)) else {
        return;
    };
    let page = String::from_utf8_lossy(&output.stdout);
    let line = format!("ERROR disk: the disk of map_dir {folder_name} (/lattice_mapper) has ");
    assert!(page.contains(&line), "{page}{output:?}");
}
