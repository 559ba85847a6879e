//! Surfaces replaced, removed, of another session; poses; classes of triangles; markers and files.

use std::sync::Arc;

use lattice_core::pose::Axes;
use lattice_lab::mesh::{read_mesh, read_mesh_in};
use lattice_lab::simulate::house::HouseScan;
use lattice_msgs::geometry_msgs::{Point, Vector3};
use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::visualization_msgs::Marker;
use lattice_nodes::convert::geometry::header;
use lattice_nodes::headset_cloud::{HeadsetCloud, HeadsetOutput, HeadsetStream};
use nalgebra::{Isometry3, Vector3 as Vector};

use super::scene::{
    FRAME, camera_info, image, look, machine, options, points, pose, pose_in, square,
};

const AT_NS: i64 = 1_000_000_000;

fn shifted(by_m: f32, stamp_ns: i64) -> HeadsetMesh {
    let mut mesh = square();
    mesh.header = header(FRAME, stamp_ns);
    mesh.vertices.iter_mut().step_by(3).for_each(|x| *x += by_m);
    mesh
}

/// Distance at which the machine sees the square, none if it sees nothing.
fn seen_m(machine: &mut HeadsetCloud, stamp_ns: i64) -> Option<f64> {
    let points = look(machine, stamp_ns);
    assert!(points.iter().all(|(_, label)| *label == 7));
    let first = points.first()?.0.x;
    assert!(points.iter().all(|(p, _)| (p.x - first).abs() < 1e-5));
    Some((first * 1e4).round() / 1e4)
}

#[test]
fn surfaces_are_replaced_and_removed() {
    let mut machine = machine(&[]);
    machine.on_mesh(&Arc::new(square()));
    assert_eq!(seen_m(&mut machine, AT_NS), Some(3.0));
    machine.on_mesh(&Arc::new(shifted(-1.0, 7)));
    assert_eq!(seen_m(&mut machine, AT_NS + 1), Some(2.0));
    // Older than what is there.
    machine.on_mesh(&Arc::new(shifted(-2.0, 6)));
    assert_eq!(machine.counts().dropped["mesh_stale"], 1);
    assert_eq!(seen_m(&mut machine, AT_NS + 2), Some(2.0));
    let behind = HeadsetMesh {
        surface: "behind".to_owned(),
        ..shifted(1.0, 8)
    };
    machine.on_mesh(&Arc::new(behind));
    assert_eq!(machine.mesh_size(), [2, 4]);
    let removed = HeadsetMesh {
        removed: true,
        vertices: Vec::new(),
        triangles: Vec::new(),
        ..shifted(0.0, 9)
    };
    machine.on_mesh(&Arc::new(removed));
    assert_eq!(seen_m(&mut machine, AT_NS + 3), Some(4.0));
    let counts = machine.counts();
    assert_eq!((counts.surfaces_replaced, counts.surfaces_removed), (3, 1));
    assert_eq!((counts.meshes_in, counts.labels_in), (5, 4));
    // Every pixel is a point, or is left out for a reason.
    let [width, height] = HouseScan::PIXELS;
    let pixels = &counts.look;
    assert_eq!(pixels.pixels, 4 * (width * height) as u64);
    let left_out = pixels.pixels_no_ray + pixels.pixels_no_mesh;
    assert_eq!(pixels.points + left_out, pixels.pixels);
    assert!(pixels.pixels_no_mesh > 0 && pixels.points > 0);
}

#[test]
fn a_stamp_of_the_future_holds_up_no_later_state() {
    let mut machine = machine(&[]);
    machine.on_mesh(&Arc::new(shifted(0.0, 2_000_000_000_000_000_000)));
    let first_half = HeadsetMesh {
        chunks: 2,
        ..shifted(-2.0, 2_000_000_000_000_000_000)
    };
    machine.on_mesh(&Arc::new(first_half));
    machine.on_mesh(&Arc::new(shifted(-1.0, 7)));
    assert_eq!(seen_m(&mut machine, AT_NS), Some(2.0));
    assert_eq!(machine.waiting(), [0, 0]);
    assert!(machine.counts().dropped.is_empty());
}

#[test]
fn half_a_surface_changes_nothing_and_a_newer_state_takes_its_place() {
    let mut machine = machine(&[]);
    machine.on_mesh(&Arc::new(square()));
    let half = |chunk, stamp_ns, by_m| {
        let whole = shifted(by_m, stamp_ns);
        let split = |len: usize| if chunk == 0 { 0..len / 2 } else { len / 2..len };
        HeadsetMesh {
            chunk,
            chunks: 2,
            vertices: whole.vertices[split(12)].to_vec(),
            triangles: whole.triangles[split(6)].to_vec(),
            ..whole
        }
    };
    machine.on_mesh(&Arc::new(half(1, 7, -1.0)));
    assert_eq!(seen_m(&mut machine, AT_NS), Some(3.0));
    machine.on_mesh(&Arc::new(half(1, 8, -2.0)));
    machine.on_mesh(&Arc::new(half(0, 7, -1.0)));
    machine.on_mesh(&Arc::new(half(1, 8, -2.0)));
    assert_eq!(machine.waiting(), [0, 1]);
    machine.on_mesh(&Arc::new(half(0, 8, -2.0)));
    assert_eq!(machine.waiting(), [0, 0]);
    assert_eq!(seen_m(&mut machine, AT_NS + 1), Some(1.0));
    let dropped = &machine.counts().dropped;
    assert_eq!((dropped["mesh_stale"], dropped["mesh_repeated"]), (1, 1));
}

#[test]
fn another_session_ends_all_that_was_known() {
    let of = |session: &str, stamp_ns| HeadsetMesh {
        session: session.to_owned(),
        ..shifted(0.0, stamp_ns)
    };
    let mut machine = machine(&[]);
    let told = machine.on_mesh(&Arc::new(of("first", 5)));
    assert_eq!(told, [HeadsetOutput::Session("first".to_owned())]);
    assert!(machine.on_mesh(&Arc::new(of("first", 6))).is_empty());
    // What was left does not come back, whatever its stamp.
    let told = machine.on_mesh(&Arc::new(of("second", 7)));
    assert_eq!(told, [HeadsetOutput::Session("second".to_owned())]);
    assert_eq!(machine.mesh_size(), [1, 2]);
    assert!(machine.on_mesh(&Arc::new(of("first", 8))).is_empty());
    assert_eq!(machine.counts().dropped["mesh_other_session"], 1);
    assert_eq!(machine.counts().sessions, 1);
    // Its poses are gone: images wait.
    assert!(look(&mut machine, AT_NS).is_empty());
    assert_eq!(machine.waiting(), [1, 0]);
    for known in ["second", "first"] {
        machine.on_session(known);
        assert_eq!(machine.mesh_size(), [1, 2], "{known} is heard late");
    }
    machine.on_session("third");
    assert_eq!((machine.mesh_size(), machine.waiting()), ([0, 0], [0, 0]));
    assert_eq!(machine.counts().dropped["labels_other_session"], 1);
    machine.on_mesh(&Arc::new(of("second", 9)));
    assert_eq!(machine.mesh_size(), [0, 0]);
    machine.on_mesh(&Arc::new(of("third", 1)));
    assert_eq!(machine.mesh_size(), [1, 2]);
}

#[test]
fn a_session_begins_whatever_its_clock_says() {
    const SECOND_NS: i64 = 1_000_000_000;
    let of = |session: &str, stamp_ns| HeadsetMesh {
        session: session.to_owned(),
        ..shifted(0.0, stamp_ns)
    };
    let mut machine = machine(&[]);
    // A clock in 2038, set right with the next start; then one of 1970; then the right one again.
    let year_2038_ns = 2_147_483_647 * SECOND_NS;
    let year_2026_ns = 1_795_000_000 * SECOND_NS;
    for (number, (session, stamp_ns)) in [
        ("of 2038", year_2038_ns),
        ("of 2026", year_2026_ns),
        ("of 1970", 5),
        ("of 2026 again", year_2026_ns + SECOND_NS),
    ]
    .into_iter()
    .enumerate()
    {
        machine.at(number as i64 * SECOND_NS);
        let told = machine.on_mesh(&Arc::new(of(session, stamp_ns)));
        assert_eq!(told, [HeadsetOutput::Session(session.to_owned())]);
        assert_eq!(machine.mesh_size(), [1, 2], "{session}");
    }
    // What arrives late of any of them is refused, also with the newest stamp.
    for session in ["of 2038", "of 2026", "of 1970"] {
        assert!(
            machine
                .on_mesh(&Arc::new(of(session, year_2038_ns + 1)))
                .is_empty()
        );
    }
    assert_eq!(machine.counts().dropped["mesh_other_session"], 3);
    // Within the session the clock may be set too.
    machine.on_mesh(&Arc::new(of("of 2026 again", 7)));
    assert_eq!(machine.counts().dropped.len(), 1, "{:?}", machine.counts());
    // An application that was in the background goes on when the other is silent.
    machine.at(12 * SECOND_NS);
    assert!(machine.on_mesh(&Arc::new(of("of 1970", 6))).is_empty());
    machine.at(14 * SECOND_NS);
    let told = machine.on_mesh(&Arc::new(of("of 1970", 6)));
    assert_eq!(told, [HeadsetOutput::Session("of 1970".to_owned())]);
}

#[test]
fn a_clock_that_is_set_back_by_seconds_holds_up_no_state() {
    const SECOND_NS: i64 = 1_000_000_000;
    let mut machine = machine(&[]);
    let mut on_mesh = |arrival_s: i64, stamp_s: i64, by_m: f32| {
        machine.at(arrival_s * SECOND_NS);
        machine.on_mesh(&Arc::new(shifted(by_m, stamp_s * SECOND_NS)));
        let stale = machine.counts().dropped.get("mesh_stale");
        stale.copied().unwrap_or(0)
    };
    // Overtaken: sent 5 s before the one that is known, and 9 s on the way.
    assert_eq!(on_mesh(100, 100, 0.0), 0);
    assert_eq!(on_mesh(104, 95, -1.0), 1);
    // The clock is set back by 30 s: what is sent after that is no message of before.
    assert_eq!(on_mesh(106, 76, -2.0), 1);
    assert_eq!(seen_m(&mut machine, AT_NS), Some(1.0));
}

#[test]
fn images_of_a_clock_that_was_ahead_keep_no_place() {
    let mut machine = machine(&[("queue_size", "2"), ("max_pose_gap_s", "2.0")]);
    machine.on_mesh(&Arc::new(square()));
    // They wait for poses that never come.
    for late in 0..3 {
        assert!(look(&mut machine, i64::from(i32::MAX) * 1_000_000_000 + late).is_empty());
    }
    assert_eq!(machine.waiting(), [2, 0]);
    for image in 0..3 {
        assert_eq!(seen_m(&mut machine, AT_NS + image), Some(3.0), "{image}");
    }
    assert_eq!(machine.counts().dropped["labels_no_pose"], 2);
}

#[test]
fn images_wait_for_their_pose_and_are_counted_without() {
    let mut machine = machine(&[("max_pose_gap_s", "0.5"), ("queue_size", "2")]);
    machine.on_mesh(&Arc::new(square()));
    // Before all poses, and in a gap of them.
    for stamp_ns in [AT_NS - 1, AT_NS + 1] {
        assert!(look(&mut machine, stamp_ns).is_empty());
    }
    assert_eq!(machine.counts().dropped["labels_no_pose"], 2);
    assert!(look(&mut machine, 3 * AT_NS + 5).is_empty());
    assert_eq!(machine.waiting(), [1, 0]);
    let forward = Isometry3::translation(1.0, 0.0, 0.0);
    let at = pose_in(Axes::RosFlu, Axes::Optical, &forward);
    let later = points(&machine.on_pose(&pose(3 * AT_NS + 10, at)));
    // Half-way between 0 and 1 m.
    assert!(later.len() > 1000);
    for i in 0..3 {
        assert!(look(&mut machine, 4 * AT_NS + i).is_empty());
    }
    assert_eq!(machine.counts().dropped["labels_no_pose"], 3);
    machine.finish();
    assert_eq!(machine.counts().dropped["labels_no_pose"], 5);
    assert_eq!(machine.counts().clouds_out, 1);
}

#[test]
fn classes_of_triangles_make_a_cloud_without_images() {
    let mut machine = HeadsetCloud::new(options(&[
        ("labels_from", "mesh"),
        ("spacing_m", "0.1"),
        ("ignored_labels", "[9]"),
    ]));
    machine.on_mesh(&Arc::new(HeadsetMesh {
        classes: vec![4, 9],
        ..square()
    }));
    let found = points(&machine.tick());
    assert!((399..=400).contains(&found.len()), "{}", found.len());
    for (p, label) in &found {
        assert!((p.x - 3.0).abs() < 1e-6 && p.y.abs() <= 1.0 && p.z.abs() <= 1.0);
        // The first triangle has the corner at the left below.
        let expected = if p.y > p.z { 4 } else { u16::MAX };
        assert!(*label == expected || (p.y - p.z).abs() < 1e-5, "{p}");
    }
    assert!(machine.tick().is_empty(), "nothing has changed");
}

#[test]
fn markers_and_files_are_meshes() {
    let mut machine = machine(&[]);
    let corners = [[6.0, 2.0, 2.0], [6.0, 2.0, -2.0], [6.0, -2.0, -2.0]];
    let point = |[x, y, z]: [f64; 3]| Point { x, y, z };
    let half = Vector3 {
        x: 0.5,
        y: 0.5,
        z: 0.5,
    };
    let marker = Marker {
        header: header(FRAME, 1),
        ns: "room".to_owned(),
        type_: Marker::TRIANGLE_LIST,
        pose: square().pose,
        scale: half,
        points: corners.map(point).to_vec(),
        ..Marker::default()
    };
    machine.on_marker(&marker);
    assert_eq!(machine.mesh_size(), [1, 1]);
    assert_eq!(seen_m(&mut machine, AT_NS), Some(3.0));
    for (action, type_, count) in [(0, Marker::CUBE, 1), (Marker::DELETEALL, 0, 0)] {
        machine.on_marker(&Marker {
            action,
            type_,
            ..marker.clone()
        });
        assert_eq!(machine.mesh_size()[0], count);
    }
    assert_eq!(machine.counts().dropped["marker_type"], 1);

    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("square.OBJ");
    let text = "v 3 1 1\nv 3 1 -1\nv 3 -1 -1\nv 3 -1 1\nf 1 2 3 4\n";
    std::fs::write(&path, text).unwrap();
    machine
        .on_mesh_file(&read_mesh(&path, 10).unwrap())
        .unwrap();
    assert_eq!(seen_m(&mut machine, AT_NS + 1), Some(3.0));
}

#[test]
fn a_mesh_inside_out_is_refused_unless_told_otherwise() {
    let mut turned = square();
    turned.triangles = vec![0, 2, 1, 0, 3, 2];
    let [width, height] = HouseScan::PIXELS;
    for (check, clouds) in [("true", 0), ("false", 1)] {
        let mut machine = machine(&[("check_winding", check)]);
        machine.on_mesh(&Arc::new(turned.clone()));
        let labels = image(AT_NS, width, &vec![1; width * height]);
        machine.on_image(HeadsetStream::Labels, labels);
        assert_eq!(machine.counts().clouds_out, clouds);
        let refused = machine.counts().dropped.get("labels_mesh_inside_out");
        assert_eq!(refused.is_some(), clouds == 0);
    }
}

/// The square as glTF: its numbers for a file that becomes the axes of a headset.
fn gltf_of_square(axes: Axes) -> (String, Vec<u8>) {
    let square = square();
    let in_file = |place: &[f32]| {
        let [x, y, z] = [0, 1, 2].map(|i| f64::from(place[i]));
        let [x, y, z] = axes.from_ros(Vector::new(x, y, z)).into();
        let file = match axes {
            Axes::RosFlu => [x, z, -y],
            Axes::UnityRuf => [-x, y, z],
            Axes::WinrtRub => [x, y, z],
            Axes::Optical => [x, -y, -z],
        };
        file.map(|c| c as f32)
    };
    let vertices = square.vertices.chunks(3).flat_map(in_file);
    let vertices = vertices.flat_map(f32::to_le_bytes);
    let corners = square.triangles.iter().flat_map(|v| v.to_le_bytes());
    let json = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "buffers": [{"byteLength": 72, "uri": "square.bin"}]}"#;
    (json.to_owned(), vertices.chain(corners).collect())
}

#[test]
fn gltf_files_come_in_the_axes_of_each_headset_with_their_fronts() {
    for axes in Axes::ALL {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("square.gltf");
        let (json, bytes) = gltf_of_square(axes);
        std::fs::write(&path, json).unwrap();
        std::fs::write(directory.path().join("square.bin"), bytes).unwrap();
        let given = [
            ("stride", "1"),
            ("max_pose_gap_s", "2.0"),
            ("headset_axes", axes.name()),
        ];
        let mut machine = HeadsetCloud::new(options(&given));
        machine.on_camera_info(Arc::new(camera_info()));
        let own = match axes {
            Axes::RosFlu => Axes::Optical,
            same => same,
        };
        let at = pose_in(axes, own, &Isometry3::identity());
        for stamp_ns in [AT_NS, 2 * AT_NS] {
            machine.on_pose(&pose(stamp_ns, at));
        }
        let mesh = read_mesh_in(&path, axes, 10).unwrap();
        machine.on_mesh_file(&mesh).unwrap();
        // One that is seen from behind would be refused.
        assert_eq!(seen_m(&mut machine, AT_NS), Some(3.0), "{axes}");
    }
}
