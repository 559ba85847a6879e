//! Bytes of `nodes/unity/HeadsetSender.cs`, as ROS-TCP-Endpoint reads them.
//!
//! `test/unity/frames.bin` is the output of `test/unity/Frames.cs`; where mono is installed it is written anew.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use lattice_core::pose::Axes;
use lattice_core::registration::UNLABELED;
use lattice_msgs::cdr;
use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::{CameraInfo, Image};
use lattice_nodes::convert::geometry::header;
use lattice_nodes::headset_cloud::{HeadsetCloud, HeadsetStream};
use nalgebra::{Isometry3, Translation3};
use serde::Serialize;
use serde_bytes::ByteBuf;

use super::scene::{FRAME, options, points, pose, pose_in};

const WALL: [f32; 12] = [-1., -1., 0., -1., 1., 0., 1., 1., 0., 1., -1., 0.];
const TRIANGLES: [u32; 6] = [0, 1, 2, 0, 2, 3];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

/// Topics and messages, one behind the other, each with its length before it.
fn frames(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut rest = bytes;
    let mut part = || {
        let (length, behind) = rest.split_first_chunk::<4>()?;
        let (part, behind) = behind.split_at(u32::from_le_bytes(*length) as usize);
        rest = behind;
        Some(part.to_vec())
    };
    let mut frames = Vec::new();
    while let Some(topic) = part() {
        frames.push((String::from_utf8(topic).unwrap(), part().unwrap()));
    }
    frames
}

fn in_unity(x: f64, z: f64) -> lattice_msgs::geometry_msgs::Pose {
    let place = Axes::UnityRuf.to_ros([x, 0.0, z].into());
    let place = Isometry3::from_parts(Translation3::from(place), Default::default());
    pose_in(Axes::UnityRuf, Axes::UnityRuf, &place)
}

fn surface(stamp_ns: i64, surface: &str) -> HeadsetMesh {
    HeadsetMesh {
        header: header(FRAME, stamp_ns),
        session: "first".to_owned(),
        surface: surface.to_owned(),
        chunks: 1,
        ..HeadsetMesh::default()
    }
}

/// Messages that `Frames.cs` means to send.
fn expected() -> (Vec<HeadsetMesh>, CameraInfo, Image) {
    let wall = HeadsetMesh {
        pose: in_unity(0.0, 3.0),
        vertices: WALL.to_vec(),
        triangles: TRIANGLES.to_vec(),
        classes: vec![7, 8],
        ..surface(10_250_000_000, "wall")
    };
    let curtain = HeadsetMesh {
        chunks: 2,
        pose: in_unity(-50.0, 0.0),
        ..surface(10_500_000_000, "curtain")
    };
    let first = HeadsetMesh {
        vertices: WALL[..8].to_vec(),
        triangles: TRIANGLES.to_vec(),
        ..curtain.clone()
    };
    let second = HeadsetMesh {
        chunk: 1,
        vertices: WALL[8..].to_vec(),
        ..curtain
    };
    let gone = HeadsetMesh {
        removed: true,
        pose: in_unity(0.0, 0.0),
        ..surface(10_750_000_000, "curtain")
    };
    let info = CameraInfo {
        header: header("headset_camera", 10_000_000_000),
        height: 2,
        width: 4,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [4., 0., 1.5, 0., 4., 0.5, 0., 0., 1.],
        r: [1., 0., 0., 0., 1., 0., 0., 0., 1.],
        p: [4., 0., 1.5, 0., 0., 4., 0.5, 0., 0., 0., 1., 0.],
        ..CameraInfo::default()
    };
    let labels = Image {
        header: header("headset_camera", 11_000_000_000),
        height: 2,
        width: 4,
        encoding: "mono8".to_owned(),
        is_bigendian: 0,
        step: 4,
        data: ByteBuf::from(vec![1, 2, 3, 4, 5, 6, 255, 8]),
    };
    (vec![wall, first, second, gone], info, labels)
}

#[test]
fn what_unity_sends_is_what_the_node_takes() {
    let bytes = fs::read(file("test/unity/frames.bin")).unwrap();
    let frames = frames(&bytes);
    for (topic, json) in &frames[..4] {
        assert_eq!((topic.as_str(), json.last()), ("__publish", Some(&0)));
        let json: serde_json::Value = serde_json::from_slice(&json[..json.len() - 1]).unwrap();
        assert!(json["message_name"].is_string(), "{json}");
    }
    let (meshes, info, labels) = expected();
    let poses = [10_875_000_000, 11_000_000_000].map(|at| pose(at, in_unity(0.0, 0.0)));
    let mut sent = Vec::new();
    let mut send = |topic: &str, bytes: Vec<u8>| sent.push((topic.to_owned(), bytes));
    fn bytes_of(message: &impl Serialize) -> Vec<u8> {
        cdr::to_vec(message).unwrap()
    }
    meshes
        .iter()
        .for_each(|mesh| send("headset/mesh", bytes_of(mesh)));
    send("headset/camera_info", bytes_of(&info));
    poses
        .iter()
        .for_each(|pose| send("headset/pose", bytes_of(pose)));
    send("headset/labels/image", bytes_of(&labels));
    assert_eq!(frames[4..], sent);

    let params = [("headset_axes", "unity_ruf"), ("stride", "1")];
    let mut machine = HeadsetCloud::new(options(&params));
    for mesh in meshes {
        machine.on_mesh(&Arc::new(mesh));
    }
    machine.on_camera_info(Arc::new(info));
    poses.iter().for_each(|pose| drop(machine.on_pose(pose)));
    let found = points(&machine.on_image(HeadsetStream::Labels, Arc::new(labels)));
    let found = found.iter().map(|(p, label)| (p.x, p.y, p.z, *label));
    let found: Vec<_> = found.collect();
    // The outer columns pass by the wall.
    let expected = [
        (3.0, 0.375, 0.375, 2),
        (3.0, -0.375, 0.375, 3),
        (3.0, 0.375, -0.375, 6),
        (3.0, -0.375, -0.375, UNLABELED),
    ];
    assert_eq!(found, expected);
    assert_eq!(machine.counts().surfaces_removed, 1);
}

#[test]
fn the_script_sends_these_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("frames.exe");
    let compiled = Command::new("mcs")
        .arg(format!("-out:{}", program.display()))
        .args(["nodes/unity/HeadsetSender.cs", "test/unity/Frames.cs"].map(file))
        .status();
    let Ok(status) = compiled else {
        eprintln!("skipped: mcs of mono is not installed");
        return;
    };
    assert!(status.success());
    let output = Command::new("mono").arg(program).output().unwrap();
    assert!(output.status.success());
    let expected = fs::read(file("test/unity/frames.bin")).unwrap();
    assert_eq!(frames(&output.stdout), frames(&expected));
}
