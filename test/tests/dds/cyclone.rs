//! The nodes against CycloneDDS: a peer in Python that knows of them only the ROS messages.
//!
//! Loopback only, no multicast. The peer is `python/dds_peer.py`.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_msgs::hash_of;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_nodes::enu_transformer::TransformerReport;
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_nodes::lattice_mapper::MapperReport;
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::report;
use lattice_nodes::voxel_marker_publisher::MarkerReport;
use lattice_runtime::Runtime;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::clouds::{field, header, odometry};
use lattice_test::data::shared;
use lattice_test::domain::TestDomain;
use lattice_test::my_msgs;
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::python;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use serde::Deserialize;
use serde_bytes::ByteBuf;
use serde_json::{Value, json};

const CELL_VOLUME_M3: f64 = 0.125;
/// 100 Hz.
const POSE_PERIOD_NS: i64 = 10_000_000;
const START_NS: i64 = 1_700_000_000_000_000_000;
/// Poses at whose stamps there is a cloud.
const CLOUDS: [usize; 3] = [50, 100, 150];
/// Points of a cloud; 16 bytes each.
const POINTS: usize = 130_000;

fn stamp_ns(pose: usize) -> i64 {
    START_NS + POSE_PERIOD_NS * pose as i64
}

/// A machine that drives, turns and nods.
fn map_from_base(pose: usize) -> Isometry3<f64> {
    let t = pose as f64 * 0.01;
    Isometry3::from_parts(
        Translation3::new(3.0 * t, -1.5 * t, 0.25 * t),
        UnitQuaternion::from_euler_angles(0.02 * t, -0.03 * t, 0.4 * t),
    )
}

/// A rough slope; every 997th point is not finite.
fn cloud(pose: usize) -> PointCloud2 {
    let mut state = pose as u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    };
    let mut data = Vec::with_capacity(16 * POINTS);
    for i in 0..POINTS {
        let (x, y) = (15.0 * random(), 15.0 * random());
        let z = 0.01 * (x * x - y * y) + 0.2 * random();
        let x = match i % 997 {
            0 => f32::NAN,
            500 => f32::INFINITY,
            _ => x,
        };
        data.extend([x, y, z, 1.0].into_iter().flat_map(f32::to_le_bytes));
    }
    PointCloud2 {
        header: header("base_link", stamp_ns(pose)),
        height: 1,
        width: POINTS as u32,
        fields: ["x", "y", "z", "intensity"]
            .into_iter()
            .zip(0..)
            .map(|(name, i)| field(name, 4 * i, PointField::FLOAT32))
            .collect(),
        is_bigendian: false,
        point_step: 16,
        row_step: 16 * POINTS as u32,
        data: ByteBuf::from(data),
        is_dense: false,
    }
}

/// Rows of stamp, position and quaternion (x, y, z, w).
fn pose_rows(poses: usize) -> Vec<Value> {
    let row = |i| {
        let pose = map_from_base(i);
        let (t, q) = (pose.translation.vector, pose.rotation);
        json!([stamp_ns(i), t.x, t.y, t.z, q.i, q.j, q.k, q.w])
    };
    (0..poses).map(row).collect()
}

/// The three nodes, which write reports.
fn start(domain: &TestDomain, reports: &Path) -> Nodes {
    let transformer = "ins.source:=odometry ins.topic:=/ins/odometry points_topics:=['/points'] \
                       qos./ins/odometry.reliability:=reliable qos./points.reliability:=reliable \
                       qos.points_enu.reliability:=reliable";
    let mapper = "lattice:=fcc cell_volume_m3:=0.125 qos.points_enu.reliability:=reliable";
    let nodes = [
        ("enu_transformer", transformer),
        ("lattice_mapper", mapper),
        ("voxel_marker_publisher", "color_by:=flat"),
    ];
    let nodes = nodes.map(|(name, line)| {
        let mut params = params(line);
        params.push(format!("report_file:={}", reports.join(name).display()));
        (name, params)
    });
    Nodes::start(domain, &nodes)
}

/// Voxels of a map, in the order of their keys.
#[derive(Debug, Default, PartialEq, Deserialize)]
struct Voxels {
    keys: Vec<u64>,
    counts: Vec<u32>,
    mean_offsets: Vec<i16>,
}

/// The same poses and clouds through the state machines, without DDS.
fn mapped_directly(clouds: &[PointCloud2]) -> Voxels {
    let mut transformer = EnuTransformer::new(TransformerOptions::new(InsSource::Odometry));
    let lattice = Lattice::new(LatticeKind::Fcc, CELL_VOLUME_M3).unwrap();
    let mut mapper = LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap();
    for i in 0..=CLOUDS[2] {
        let pose = odometry(stamp_ns(i), &map_from_base(i));
        transformer.on_ins("ins", InsMessage::Odometry(&pose), stamp_ns(i));
        let Some(cloud) = CLOUDS.iter().position(|&at| at == i) else {
            continue;
        };
        for output in transformer.on_cloud("points", Arc::new(clouds[cloud].clone()), stamp_ns(i)) {
            if let EnuOutput::Points(points) = output {
                mapper.on_cloud(&points).unwrap();
            }
        }
    }
    let sorted = mapper.list().sorted();
    Voxels {
        keys: sorted.iter().map(|(key, _)| key.raw()).collect(),
        counts: sorted.iter().map(|(_, voxel)| voxel.count).collect(),
        mean_offsets: mapper
            .keyframe()
            .into_iter()
            .flat_map(|chunk| chunk.mean_offsets)
            .collect(),
    }
}

#[test]
fn a_cyclone_peer_feeds_the_nodes_and_rebuilds_the_map() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let clouds = CLOUDS.map(cloud);
    let mut files = Vec::new();
    for (pose, cloud) in CLOUDS.iter().zip(&clouds) {
        let name = format!("{pose}.bin");
        fs::write(path.join(&name), &cloud.data).unwrap();
        files.push(json!([pose, name]));
    }
    let domain = TestDomain::take();
    let scenario = json!({
        "domain": domain.id(),
        "cell_volume_m3": CELL_VOLUME_M3,
        "odometry": pose_rows(200),
        "clouds": files,
    });
    fs::write(path.join("scenario.json"), scenario.to_string()).unwrap();
    let nodes = start(&domain, path);
    let found = peer::run(&python, "dds_peer.py", &[Path::new("map"), path]);
    nodes.finish();

    let direct = mapped_directly(&clouds);
    let rebuilt = fs::read(path.join("rebuilt.json")).unwrap();
    let rebuilt: Voxels = serde_json::from_slice(&rebuilt).unwrap();
    assert!(direct.keys.len() > 3000, "{} voxels", direct.keys.len());
    // Not assert_eq: it would print all voxels.
    assert!(rebuilt == direct, "over DDS, and directly: other voxels");

    let empty = json!([]);
    assert_eq!(found["cloud_bytes"], 2_080_000);
    assert_eq!(found["map_differences"], empty);
    assert_eq!(found["centers_differences"], empty);
    assert_eq!(found["centers_equal_map"], true);
    assert_eq!(found["centers_frame"], "map");
    assert_eq!(found["frame"], "map");
    assert_eq!(found["lattice"], "fcc");
    assert_eq!(found["cell_volume_m3"], 0.125);
    assert_eq!(found["datum_m"], json!([0.0, 0.0, 0.0]));
    assert_eq!(found["marker_kinds"], json!([["map", 11]]));
    assert_eq!(found["wrong_triangles"], 0);
    assert!(found["map_chunks"].as_u64() > Some(1), "{found}");
    assert!(found["triangles"].as_u64() > Some(10_000), "{found}");
    assert!(
        found["generator_error_m"]
            .as_f64()
            .is_some_and(|m| m < 1e-12),
        "{found}"
    );
    // Single precision, up to 32 m from the datum.
    let off_m = found["centers_off_lattice_m"].as_f64();
    assert!(off_m.is_some_and(|m| m < 2e-6), "{off_m:?}");
    // A border takes a point in ten thousand: the comparison leaves out next to nothing.
    assert!(
        found["on_borders"].as_u64().is_some_and(|n| n < 200),
        "{found}"
    );

    let transformer: TransformerReport = report::read(&path.join("enu_transformer")).unwrap();
    let (counts, dropped) = (&transformer.counts, transformer.dropped());
    assert_eq!((counts.clouds_in, counts.clouds_out), (3, 3));
    assert!(dropped.is_empty(), "{dropped:?}");
    let mapper: MapperReport = report::read(&path.join("lattice_mapper")).unwrap();
    assert_eq!(mapper.counts.clouds_in, 3);
    assert_eq!(mapper.voxels, direct.keys.len());
    let markers: MarkerReport = report::read(&path.join("voxel_marker_publisher")).unwrap();
    assert_eq!(markers.arrays_not_published, 0);
    assert!(
        markers.published_bytes as usize >= markers.marker_bytes / 2,
        "{markers:?}"
    );
    assert_eq!(markers.voxels, direct.keys.len());
}

#[test]
fn a_cyclone_peer_hears_transforms_and_diagnostics_and_calls_a_service() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let domain = TestDomain::take();
    let scenario = json!({"domain": domain.id(), "odometry": pose_rows(20)});
    fs::write(path.join("scenario.json"), scenario.to_string()).unwrap();
    let nodes = start(&domain, path);
    let found = peer::run(&python, "dds_peer.py", &[Path::new("graph"), path]);
    nodes.finish();

    assert_eq!(found["replies"], json!([[true, true, true]]), "{found}");
    assert_eq!(found["reply"], "keyframe follows");
    assert!(
        found["tf_error"].as_f64().is_some_and(|e| e < 1e-12),
        "{found}"
    );
    let tasks = found["tasks"].as_array().unwrap();
    for task in ["enu_transformer: clouds", "lattice_mapper: map"] {
        assert!(tasks.contains(&json!(task)), "{tasks:?}");
    }
}

#[test]
fn a_cyclone_peer_sees_the_type_hash_of_every_endpoint() {
    let Some(python) = python() else { return };
    let domain = TestDomain::take();
    let directory = tempfile::tempdir().unwrap();
    let nodes = Nodes::start(&domain, &[("lattice_mapper", vec![])]);
    let args = RosArgs::parse([]).unwrap();
    let runtime = Runtime::with_transport("player", args, &domain.transport()).unwrap();
    let node = runtime.node("player").unwrap();
    let noted = format!("RIHS01_{}", "5".repeat(64));
    let raw = |topic, hash| node.raw_publisher(topic, "odd/msg/Odd", Some(hash), Qos::DEFAULT);
    let raw = [raw("/noted", &noted), raw("/wrong", "RIHS01_;enclave=/")];
    assert!(raw.iter().all(Result::is_ok));
    let own = node.publisher::<my_msgs::Battery>("/battery", Qos::DEFAULT);
    let recharge = node.service::<my_msgs::Recharge>("/recharge", |_| Default::default());
    assert!(own.is_ok() && recharge.is_ok());
    let topics = [
        "ros_discovery_info",
        "rt/voxel_map",
        "rt/points_enu",
        "rt/wrong",
        "rt/battery",
        "rq/rechargeRequest",
        "rq/lattice_mapper/queryRequest",
        "rr/lattice_mapper/queryReply",
        "rq/lattice_mapper/set_parametersRequest",
    ];
    let scenario = json!({"domain": domain.id(), "topics": topics});
    fs::write(directory.path().join("scenario.json"), scenario.to_string()).unwrap();
    let arguments = [Path::new("endpoints"), directory.path()];
    let found = peer::run(&python, "dds_peer.py", &arguments);
    nodes.finish();

    let jazzy = shared("ros2/type_hashes_jazzy.json").map(|path| fs::read(path).unwrap());
    let jazzy = jazzy.unwrap_or_else(|| br#"{"hashes": {}}"#.to_vec());
    let jazzy: Value = serde_json::from_slice(&jazzy).unwrap();
    let jazzy = jazzy["hashes"].as_object().unwrap();
    let found: Vec<[String; 3]> = serde_json::from_value(found).unwrap();
    for [topic, dds_type, user_data] in &found {
        let ros_type = dds_type.replace("dds_::", "").replace("::", "/");
        let ros_type = ros_type.strip_suffix('_').unwrap();
        let hash = match topic.as_str() {
            "rt/noted" => Some(&*noted),
            _ => hash_of(ros_type),
        };
        let expected = hash.map_or(String::new(), |hash| format!("typehash={hash};"));
        assert_eq!(*user_data, expected, "{topic}");
        assert_eq!(hash.is_none(), topic == "rt/wrong", "{topic}");
        // These have got fields since the list was made.
        let is_newer = ros_type.starts_with("lattice_msgs/msg/LatticeMap");
        if let Some(theirs) = jazzy.get(ros_type).filter(|_| !is_newer) {
            assert_eq!(theirs.as_str(), hash, "{ros_type}");
        }
    }
}
