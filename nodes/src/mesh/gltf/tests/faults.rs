//! Faults of a document: where, the value there, and the problem reported.

use serde_json::{Value, json};

/// A pointer into the document, the value put there, and a part of the refusal.
pub(super) fn faults() -> Vec<(&'static str, Value, &'static str)> {
    vec![
        (
            "/asset/version",
            json!("1.0"),
            "version '1.0' of the format",
        ),
        (
            "/extensionsRequired",
            json!(["KHR_draco_mesh_compression"]),
            "KHR_draco_mesh_compression",
        ),
        ("/scene", json!(4), "no scene 4"),
        ("/scenes/0/nodes", json!([0, 0]), "node 0 has two parents"),
        ("/scenes/0/nodes", json!([9]), "no node 9"),
        ("/scenes/0/nodes", json!([]), "no triangles"),
        ("/nodes/0/children", json!([0]), "below itself"),
        ("/nodes/0/mesh", json!(3), "mesh 3: there is no such mesh"),
        ("/nodes/0/skin", json!(0), "skinned"),
        (
            "/nodes/0/rotation",
            json!([0, 0, 0, 0]),
            "vertex 0 is at NaN",
        ),
        ("/nodes/0/scale", json!([1e9, 1, 1]), "not within 10000"),
        (
            "/nodes/0/extras",
            json!({"label": 65536}),
            "label 65536 is not an integer",
        ),
        (
            "/nodes/0/extras",
            json!({"instance": 0.5}),
            "instance 0.5 is not an integer",
        ),
        (
            "/accessors/0/count",
            json!(0),
            "accessor 0: it has no records",
        ),
        (
            "/accessors/1/count",
            json!(0),
            "accessor 1: it has no records",
        ),
        ("/meshes/0/primitives/0/mode", json!(1), "mode 1 (LINES)"),
        ("/meshes/0/primitives/0/mode", json!(5), "TRIANGLE_STRIP"),
        ("/meshes/0/primitives/0/mode", json!(77), "unknown"),
        (
            "/meshes/0/primitives/0/attributes",
            json!({}),
            "no POSITION",
        ),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(1),
            "type SCALAR, not VEC3",
        ),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(5),
            "no accessor 5",
        ),
        (
            "/meshes/0/primitives/0/indices",
            json!(0),
            "4 indices are not a multiple of 3",
        ),
        (
            "/accessors/0/componentType",
            json!(5123),
            "component type 5123",
        ),
        (
            "/accessors/1/componentType",
            json!(5126),
            "component type 5126",
        ),
        ("/accessors/0/count", json!(5), "buffer view 0 has 48 bytes"),
        ("/accessors/0/count", json!(u64::MAX), "more than 12"),
        (
            "/accessors/0/count",
            json!(2),
            "a triangle refers to vertex 2, outside 0..2",
        ),
        (
            "/accessors/1/count",
            json!(9_000_000_000_000_000_000_u64),
            "more than 4",
        ),
        ("/accessors/1/count", json!(9), "buffer view 1 has 12 bytes"),
        (
            "/accessors/1/byteOffset",
            json!(u64::MAX),
            "buffer view 1 has 12",
        ),
        ("/accessors/0/sparse", json!({"count": 1}), "sparse"),
        ("/accessors/0/bufferView", json!(null), "no buffer view"),
        ("/accessors/0/bufferView", json!(8), "no buffer view 8"),
        ("/bufferViews/0/byteStride", json!(0), "byteStride 0"),
        (
            "/bufferViews/0/byteStride",
            json!(1_u64 << 40),
            "byteStride",
        ),
        ("/bufferViews/0/byteLength", json!(61), "buffer 0 has 60"),
        (
            "/bufferViews/0/byteOffset",
            json!(u64::MAX),
            "buffer 0 has 60",
        ),
        ("/bufferViews/0/buffer", json!(1), "no buffer 1"),
        (
            "/buffers/0/byteLength",
            json!(61),
            "`byteLength` is 61, but only 60",
        ),
        (
            "/buffers/0/byteLength",
            json!(u64::MAX),
            "all buffers together exceed",
        ),
        ("/buffers/0/uri", json!(null), "no `uri`"),
        (
            "/buffers/0/uri",
            json!("data:;base64,####"),
            "is not base64",
        ),
        ("/buffers/0/uri", json!("data:,abc"), "is not base64"),
        ("/buffers/0/uri", json!("data:x"), "no comma"),
        ("/buffers/0/byteLength", json!(-1), "JSON cannot be read"),
    ]
}
