use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use faults::faults;

mod faults;

/// Bytes of a square of four vertices in the plane of x and y, then of its corners (u16), seen from z.
fn square() -> Vec<u8> {
    let vertices: [f32; 12] = [0., 0., 0., 2., 0., 0., 2., 1., 0., 0., 1., 0.];
    let corners: [u16; 6] = [0, 1, 2, 0, 2, 3];
    let vertices = vertices.iter().flat_map(|c| c.to_le_bytes());
    let corners = corners.iter().flat_map(|c| c.to_le_bytes());
    vertices.chain(corners).collect()
}

/// A document of that square, with its bytes in itself.
fn document() -> Value {
    let data = STANDARD.encode(square());
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 60, "uri": format!("data:application/gltf-buffer;base64,{data}")}],
    })
}

/// The document in the binary form.
fn binary(mut document: Value) -> Vec<u8> {
    document["buffers"][0] = json!({"byteLength": 60});
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8], bytes: &[u8]| {
        let length = (bytes.len() as u32).to_le_bytes();
        [&length[..], kind, bytes].concat()
    };
    let chunks = [chunk(b"JSON", &text), chunk(b"BIN\0", &square())].concat();
    let length = 12 + chunks.len() as u32;
    let head = [&b"glTF"[..], &2_u32.to_le_bytes(), &length.to_le_bytes()].concat();
    [head, chunks].concat()
}

fn read_in(document: &Value, axes: Axes) -> Result<LabelledMesh, String> {
    let read = from_bytes(document.to_string().as_bytes(), None, axes, 4);
    read.map_err(|error| error.to_string())
}

fn mesh(document: &Value) -> LabelledMesh {
    read_in(document, Axes::WinrtRub).unwrap()
}

/// Sum of the normals, each as long as twice the area.
fn normal(mesh: &LabelledMesh) -> [f32; 3] {
    let corners = mesh.corners_m();
    let normals = corners.map(|corners| {
        let [a, b, c] = corners.map(Vector3::from);
        (b - a).cross(&(c - a))
    });
    normals.sum::<Vector3<f32>>().into()
}

#[test]
fn text_binary_and_a_file_beside_give_one_mesh() {
    let expected = mesh(&document());
    assert_eq!(expected.vertices_m()[2], [2.0, 1.0, 0.0]);
    assert_eq!(expected.triangles(), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(expected.labels(), [UNLABELED; 2]);
    assert_eq!(normal(&expected), [0.0, 0.0, 4.0]);
    let read = |bytes: &[u8]| from_bytes(bytes, None, Axes::WinrtRub, 4);
    assert_eq!(read(&binary(document())).unwrap(), expected);
    let folder = tempfile::tempdir().unwrap();
    let mut beside = document();
    beside["buffers"][0]["uri"] = json!("a%20room.bin");
    let path = folder.path().join("room.gltf");
    std::fs::write(folder.path().join("a room.bin"), square()).unwrap();
    for (name, bytes) in [
        ("room.gltf", beside.to_string().into_bytes()),
        ("ROOM.GLB", binary(document())),
    ] {
        let path = path.with_file_name(name);
        std::fs::write(&path, bytes).unwrap();
        let read = crate::mesh::read_mesh_in(&path, Axes::WinrtRub, 4).unwrap();
        assert_eq!(read, expected, "{name}");
        assert!(crate::mesh::read_mesh(&path, 1).is_err());
    }
    // Another folder's file does not come in by a link.
    let other = tempfile::tempdir().unwrap();
    let secret = other.path().join("secret.bin");
    std::fs::write(&secret, square()).unwrap();
    std::os::unix::fs::symlink(&secret, folder.path().join("link.bin")).unwrap();
    for (uri, problem) in [
        ("link.bin", "leads out of the folder"),
        ("../secret.bin", "leads out of the folder"),
        ("missing.bin", "No such file"),
        (".", "not a file"),
        ("sub", "not a file"),
    ] {
        let _ = std::fs::create_dir(folder.path().join("sub"));
        beside["buffers"][0]["uri"] = json!(uri);
        std::fs::write(&path, beside.to_string()).unwrap();
        let error = crate::mesh::read_mesh(&path, 4).unwrap_err().to_string();
        assert!(error.contains(problem), "{uri}: {error}");
    }
    let error = read(beside.to_string().as_bytes()).unwrap_err().to_string();
    assert!(
        error.contains("separate buffer files are not supported"),
        "{error}"
    );
}

/// The way of a vertex of the file in each of the axes, and back from those of the headset to one place.
#[test]
fn axes_are_those_that_are_asked_for_and_triangles_keep_their_front() {
    let mut document = document();
    document["nodes"][0]["translation"] = json!([10, 20, 30]);
    for (axes, first) in [
        (Axes::RosFlu, [10.0, -30.0, 20.0]),
        (Axes::UnityRuf, [-10.0, 20.0, 30.0]),
        (Axes::WinrtRub, [10.0, 20.0, 30.0]),
        (Axes::Optical, [10.0, -20.0, -30.0]),
    ] {
        let mesh = read_in(&document, axes).unwrap();
        assert_eq!(mesh.vertices_m()[0], first, "{axes}");
        // In left-handed axes fronts go round clockwise, as the cross product there says.
        let front = match axes {
            Axes::RosFlu => [0.0, -4.0, 0.0],
            Axes::UnityRuf | Axes::WinrtRub => [0.0, 0.0, 4.0],
            Axes::Optical => [0.0, 0.0, -4.0],
        };
        assert_eq!(normal(&mesh), front, "{axes}");
    }
}

#[test]
fn nodes_place_what_is_below_them() {
    let mut document = document();
    document["nodes"] = json!([
        {"children": [1, 2], "translation": [1, 0, 0], "rotation": [0, 0, 0.5_f64.sqrt(), 0.5_f64.sqrt()]},
        {"mesh": 0, "scale": [2, 2, 2], "extras": {"label": 7, "name": ["any", {"thing": 1}]}},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1], "extras": "text"},
    ]);
    document["meshes"][0]["primitives"][0]["extras"] = json!({"instance": 300});
    let mesh = mesh(&document);
    let near = |found: [f32; 3], expected: [f32; 3]| {
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-6, "{found:?} {expected:?}");
    };
    // A quarter turn about z takes (4, 2, 0) to (-2, 4, 0).
    near(mesh.vertices_m()[2], [-1.0, 4.0, 0.0]);
    // Mirrored, (-2, 1, 5) goes to (-1, -2, 5); its front stays in front.
    near(mesh.vertices_m()[6], [0.0, -2.0, 5.0]);
    let normal = normal(&mesh);
    near(normal, [0.0, 0.0, 16.0 + 4.0]);
    assert_eq!(mesh.triangles()[2], [4, 6, 5]);
    assert_eq!(mesh.labels(), [7, 7, UNLABELED, UNLABELED]);
    assert_eq!(mesh.instances(), [300; 4]);
    // Without scenes all nodes are shown that are below none.
    document.as_object_mut().unwrap().remove("scenes");
    document.as_object_mut().unwrap().remove("scene");
    assert_eq!(super::tests::mesh(&document), mesh);
}

#[test]
fn strides_integers_and_missing_indices_are_read() {
    let mut document = document();
    document["bufferViews"][0]["byteStride"] = json!(16);
    document["accessors"][0]["count"] = json!(3);
    document["accessors"][1]["count"] = json!(3);
    let strided = mesh(&document);
    // The second vertex begins at byte 16: 0, 0, 2.
    assert_eq!(strided.vertices_m()[1], [0.0, 0.0, 2.0]);
    let mut plain = super::tests::document();
    plain["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}});
    plain["accessors"][0]["count"] = json!(3);
    assert_eq!(mesh(&plain).triangles(), [[0, 1, 2]]);
    let mut quantized = plain;
    quantized["accessors"][0] = json!(
        {"bufferView": 1, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC3"});
    let error = read_in(&quantized, Axes::WinrtRub).unwrap_err();
    assert!(error.contains("component type 5121"), "{error}");
    quantized["extensionsRequired"] = json!(["KHR_mesh_quantization", "KHR_materials_unlit"]);
    // Corners 0, 1, 2 as bytes: 0 0, 1 0, 2 0, and so on.
    let vertices = mesh(&quantized);
    assert_eq!(vertices.vertices_m()[0], [0.0, 0.0, 1.0 / 255.0]);
}

/// Puts a value where a pointer leads, making its last step.
fn put(document: &mut Value, pointer: &str, value: Value) {
    let (parent, last) = pointer.rsplit_once('/').unwrap();
    match document.pointer_mut(parent).unwrap() {
        Value::Array(list) => list[last.parse::<usize>().unwrap()] = value,
        parent => parent[last] = value,
    }
}

#[test]
fn faults_are_refused_by_name() {
    for (pointer, value, problem) in faults() {
        let mut document = document();
        put(&mut document, pointer, value.clone());
        let error = read_in(&document, Axes::RosFlu).unwrap_err();
        assert!(error.contains(problem), "{pointer} {value}: {error}");
    }
    let primitive = json!({"attributes": {"POSITION": 0}});
    for (pointer, one) in [
        ("/nodes", json!({})),
        ("/nodes/0/children", json!(0)),
        ("/scenes/0/nodes", json!(0)),
        ("/meshes/0/primitives", primitive),
    ] {
        let mut document = document();
        put(&mut document, pointer, json!(vec![one; 100_001]));
        let error = read_in(&document, Axes::RosFlu).unwrap_err();
        assert!(
            error.contains("a list of at most 100000"),
            "{pointer}: {error}"
        );
    }
}

#[test]
fn many_nodes_of_one_mesh_are_bounded_by_the_triangles() {
    let mut document = document();
    document["nodes"] = json!(vec![json!({"mesh": 0}); 1000]);
    document["scenes"][0]["nodes"] = json!((0..1000).collect::<Vec<_>>());
    let error = read_in(&document, Axes::RosFlu).unwrap_err();
    assert!(
        error.contains("6 triangles or more, more than 4"),
        "{error}"
    );
}

#[test]
fn cut_binary_files_are_refused() {
    let whole = binary(document());
    for length in 0..whole.len() {
        let cut = from_bytes(&whole[..length], None, Axes::RosFlu, 4);
        assert!(cut.is_err(), "{length}");
    }
    for (at, problem) in [
        (4, "of the container"),
        (16, "no chunk of JSON"),
        (12, "cut short"),
    ] {
        let mut other = whole.clone();
        other[at..at + 4].fill(250);
        let error = from_bytes(&other, None, Axes::RosFlu, 4).unwrap_err();
        assert!(error.to_string().contains(problem), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]
    #[test]
    fn damaged_files_do_not_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        is_binary: bool,
    ) {
        let document = document();
        let mut bytes = match is_binary {
            true => binary(document),
            false => document.to_string().into_bytes(),
        };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok(mesh) = from_bytes(&bytes, None, Axes::UnityRuf, 4) {
            prop_assert!(mesh.len() <= 4 && mesh.vertices_m().len() <= 12);
        }
    }
}
