//! Meshes, images and poses that cannot be used: refused by name, and what comes next is used.

use std::sync::Arc;

use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::CameraInfo;
use proptest::prelude::*;

use super::scene::{FRAME, camera_info, look, machine, options, pose, square};
use lattice_nodes::headset_cloud::{HeadsetCloud, HeadsetStream};

type Spoil = fn(&mut HeadsetMesh);

const SPOILT: [(&str, &str, Spoil); 15] = [
    ("mesh_frame", "expected 'headset_origin'", |m| {
        m.header.frame_id = "map".into()
    }),
    ("mesh_indices", "triangle 1 refers to vertex 4", |m| {
        m.triangles[5] = 4
    }),
    ("mesh_indices", "vertex 4294967295", |m| {
        m.triangles[0] = u32::MAX
    }),
    ("mesh_not_finite", "vertex 0 is at NaN", |m| {
        m.vertices[1] = f32::NAN
    }),
    ("mesh_not_finite", "vertex 3 is at NaN", |m| {
        m.vertices[9] = f32::INFINITY
    }),
    ("mesh_too_far", "vertex 1", |m| m.vertices[4] = 1e9),
    (
        "mesh_malformed",
        "the number of coordinates is not a multiple of 3",
        |m| m.vertices.truncate(11),
    ),
    (
        "mesh_malformed",
        "the number of indices is not a multiple of 3",
        |m| m.triangles.truncate(4),
    ),
    ("mesh_malformed", "1 labels for 2 triangles", |m| {
        m.classes = vec![1]
    }),
    (
        "mesh_malformed",
        "its pose is not finite or its rotation is zero",
        |m| m.pose.orientation.w = f64::NAN,
    ),
    ("mesh_malformed", "is outside 1..=65536", |m| {
        m.chunks = u32::MAX
    }),
    ("mesh_malformed", "is outside 1..=65536", |m| m.chunks = 0),
    ("mesh_malformed", "not below", |m| m.chunk = 1),
    ("mesh_malformed", "name is too long", |m| {
        m.surface = "x".repeat(1000)
    }),
    (
        "mesh_too_many_triangles",
        "more than `max_triangles` 4",
        |m| {
            m.surface = "other".into();
            m.triangles = [0, 1, 2].repeat(3);
        },
    ),
];

#[test]
fn bad_meshes_are_refused_by_name_and_the_next_are_used() {
    for (count, problem, spoil) in SPOILT {
        let mut machine = machine(&[("max_triangles", "4")]);
        machine.on_mesh(&Arc::new(square()));
        let mut bad = square();
        spoil(&mut bad);
        machine.on_mesh(&Arc::new(bad));
        assert_eq!(machine.counts().dropped[count], 1, "{problem}");
        let said = machine.problem().unwrap();
        assert!(said.contains(problem), "{said}");
        assert_eq!(machine.mesh_size(), [1, 2], "{problem}");
        machine.on_mesh(&Arc::new(square()));
        assert!(look(&mut machine, 1_000_000_000).len() > 1000);
    }
}

#[test]
fn triangles_without_area_are_left_out_and_counted() {
    let mut machine = machine(&[]);
    let mut mesh = square();
    mesh.triangles.extend([0, 0, 1, 2, 2, 2]);
    mesh.vertices.extend([3.0, 1.0, 0.0]);
    mesh.triangles.extend([0, 4, 1]);
    mesh.classes = vec![1, 2, 3, 4, 5];
    machine.on_mesh(&Arc::new(mesh));
    assert_eq!(machine.counts().triangles_degenerate, 3);
    assert_eq!(machine.mesh_size(), [1, 2]);
}

#[test]
fn surfaces_and_chunks_are_bounded() {
    let mut machine = machine(&[("max_surfaces", "3"), ("max_triangles", "100")]);
    for i in 0..10 {
        let surface = format!("{i}");
        machine.on_mesh(&Arc::new(HeadsetMesh {
            surface,
            ..square()
        }));
    }
    assert_eq!(machine.mesh_size(), [3, 6]);
    assert_eq!(machine.counts().dropped["mesh_too_many_surfaces"], 7);
    for i in 0..100 {
        machine.on_mesh(&Arc::new(HeadsetMesh {
            surface: format!("{}", i % 10),
            chunk: i / 10,
            chunks: 1000,
            ..square()
        }));
        assert!(machine.waiting()[1] <= 3);
    }
    assert!(machine.counts().dropped["mesh_incomplete"] > 10);
}

#[test]
fn bad_cameras_poses_and_images_are_refused_and_the_next_are_used() {
    let mut machine = machine(&[]);
    machine.on_mesh(&Arc::new(square()));
    let spoil = |change: fn(&mut CameraInfo)| {
        let mut info = camera_info();
        change(&mut info);
        info
    };
    let spoilt = [
        (
            "camera_info_not_calibrated",
            spoil(|info| info.k = [0.0; 9]),
        ),
        (
            "camera_info_size",
            spoil(|info| (info.width, info.height) = (1 << 31, 1 << 31)),
        ),
        ("camera_info_size", spoil(|info| info.width = 0)),
    ];
    for (count, info) in spoilt {
        let before = machine.counts().dropped.get(count).copied().unwrap_or(0);
        machine.on_camera_info(Arc::new(info));
        assert!(!machine.has_camera());
        assert_eq!(machine.counts().dropped[count], before + 1);
    }
    machine.on_camera_info(Arc::new(camera_info()));
    let mut there = pose(4_000_000_000, square().pose);
    there.pose.position.x = f64::INFINITY;
    machine.on_pose(&there);
    there = pose(4_000_000_000, square().pose);
    there.header.frame_id = "map".to_owned();
    machine.on_pose(&there);
    let mut cut = (*super::scene::image(1_000_000_000, 10, &[1; 100])).clone();
    cut.data.truncate(100);
    machine.on_image(HeadsetStream::Labels, Arc::new(cut));
    for count in ["pose_malformed", "pose_frame", "labels_malformed"] {
        assert_eq!(machine.counts().dropped[count], 1);
    }
    assert!(look(&mut machine, 1_000_000_000).len() > 1000);
    let mut away = square().pose;
    away.position.x = 100.0;
    machine.on_pose(&pose(4_000_000_000, away));
    assert!(look(&mut machine, 4_000_000_000).is_empty());
    assert_eq!(machine.counts().dropped["labels_sees_no_mesh"], 1);
}

#[test]
fn axes_of_the_camera_that_are_mirrored_are_refused() {
    use lattice_nodes::headset_cloud::HeadsetOptions;
    use lattice_runtime::params::{ParamValue, Params};
    let word = |text: &str| ParamValue::from_yaml_text(text).unwrap();
    let given = [
        ("headset_axes", word("unity_ruf")),
        ("camera_axes", word("optical")),
    ];
    let error = HeadsetOptions::from_params(&Params::from_values("/node", given)).unwrap_err();
    assert!(error.to_string().contains("are mirrored"), "{error}");
}

proptest! {
    #[test]
    fn any_mesh_is_a_surface_or_a_count(
        sizes in [0..40_usize, 0..40_usize, 0..14_usize],
        index in prop_oneof![Just(9_u32), any::<u32>()],
        numbers in prop::collection::vec(prop_oneof![-4.0_f32..4.0, any::<f32>()], 40),
        chunk in [0..4_u32, 0..4_u32],
        session in prop::sample::select(vec!["", "a", "b"]),
        stamps in [any::<i32>(), any::<i32>()],
    ) {
        let mut machine = HeadsetCloud::new(options(&[("stride", "8")]));
        machine.on_camera_info(Arc::new(camera_info()));
        machine.on_pose(&pose(7, square().pose));
        for stamp_s in stamps {
            let mut mesh = HeadsetMesh {
                session: session.to_owned(),
                chunk: chunk[0],
                chunks: chunk[1],
                vertices: numbers[..sizes[0]].to_vec(),
                triangles: (0..sizes[1] as u32).map(|i| i * 7 % index.max(1)).collect(),
                classes: vec![3; sizes[2]],
                ..square()
            };
            mesh.header.stamp.sec = stamp_s;
            mesh.header.frame_id = FRAME.to_owned();
            machine.on_mesh(&Arc::new(mesh));
        }
        look(&mut machine, 7);
        let counts = machine.counts();
        let refused: u64 = counts.dropped.values().sum();
        let kept = machine.waiting()[0] as u64 + machine.waiting()[1] as u64;
        prop_assert!(counts.surfaces_replaced + refused + kept > 0);
    }
}
