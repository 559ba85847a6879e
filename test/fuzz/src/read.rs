//! Bodies of the targets of what is read from disks and command lines: parameters, bags, point files.

use std::fs;
use std::io::Write;
use std::path::Path;

use lattice_bag::{BagReader, BagWriter, ReadOptions, Storage, TopicSpec, WriterOptions};
use lattice_nodes::files::points::{PointFileOptions, read_points};
use lattice_nodes::mesh::read_mesh;
use lattice_runtime::params::Params;
use lattice_runtime::params_file;
use lattice_runtime::ros_args::RosArgs;

/// Limit of messages and points that a target takes.
const MOST: usize = 10_000;

/// Frames of zstd are left to it: one of a few bytes may become gigabytes of a file.
const ZSTD_MAGIC: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// Gives a function a file of these bytes.
fn in_file(ending: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    let mut file = tempfile::Builder::new().suffix(ending).tempfile().unwrap();
    file.write_all(bytes).unwrap();
    read(file.path());
}

/// Reads a parameter file, and loads it as a node does.
pub fn params(bytes: &[u8]) {
    in_file(".yaml", bytes, |path| {
        let read = params_file::read(path).is_ok();
        let args = ["--ros-args", "--params-file", path.to_str().unwrap()];
        let args = RosArgs::parse(args.map(str::to_owned)).unwrap();
        let loaded = Params::load(&args, "/robot/node");
        assert!(read || loaded.is_err());
    });
}

/// Parses arguments, one a line.
pub fn ros_args(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    if let Ok(args) = RosArgs::parse(text.lines().map(str::to_owned)) {
        args.node_name("node");
        args.namespace("node");
    }
}

/// Reads a storage file of a bag, past its damages.
pub fn bag(bytes: &[u8]) {
    if bytes.starts_with(ZSTD_MAGIC) {
        return;
    }
    in_file(".mcap", bytes, |path| {
        let Ok(reader) = BagReader::open(path) else {
            return;
        };
        let options = ReadOptions {
            past_damage: true,
            ..ReadOptions::default()
        };
        let topics = reader.topics().len();
        for message in reader.messages(&options).unwrap().take(MOST).flatten() {
            assert!(message.topic < topics);
        }
    });
}

/// Reads a point file; the first byte says by which name.
pub fn points(bytes: &[u8]) {
    let Some((name, content)) = bytes.split_first() else {
        return;
    };
    let ending = [".ply", ".pcd", ".xyz", ".bin"][usize::from(name % 4)];
    in_file(ending, content, |path| {
        let limits = PointFileOptions {
            max_points: MOST,
            ..PointFileOptions::default()
        };
        if let Ok(file) = read_points(path, &limits) {
            assert!(file.points_m.len() + file.skipped_not_finite <= MOST);
            assert!(file.labels.is_empty() || file.labels.len() == file.points_m.len());
            assert!(file.points_m.iter().flatten().all(|x| x.is_finite()));
        }
    });
}

/// Reads a mesh file; the first byte says by which name.
pub fn mesh(bytes: &[u8]) {
    let Some((name, content)) = bytes.split_first() else {
        return;
    };
    let ending = [".ply", ".obj", ".gltf", ".glb"][usize::from(name % 4)];
    in_file(ending, content, |path| {
        if let Ok(mesh) = read_mesh(path, MOST) {
            let vertices = mesh.vertices_m().len();
            assert!(mesh.len() <= MOST && vertices <= 3 * MOST);
            assert!(mesh.vertices_m().iter().flatten().all(|x| x.is_finite()));
            let mut corners = mesh.triangles().iter().flatten();
            assert!(corners.all(|v| (*v as usize) < vertices));
            assert_eq!(mesh.labels().len(), mesh.len());
        }
    });
}

/// Seeds of [`params`].
pub fn params_seeds() -> Vec<Vec<u8>> {
    let texts = [
        "/**/node:\n  ros__parameters:\n    a: 1\n    b: {c: [1.5, -2.0], d: \"x\"}\n",
        "/**:\n  ros__parameters:\n    qos./map.depth: 7\n    on: true\n    none: []\n",
        "robot:\n  node:\n    ros__parameters: {a.b: 0x10, t: ['u', \"v\"], big: 9223372036854775807}\n",
    ];
    texts.map(|text| text.as_bytes().to_vec()).to_vec()
}

/// Seeds of [`ros_args`].
pub fn ros_args_seeds() -> Vec<Vec<u8>> {
    let lines = [
        "--ros-args\n-r\n__ns:=/robot\n-r\nmapper:__node:=m\n-p\na.b:=[1, 2]\n--\nx",
        "--ros-args\n--params-file\nf.yaml\n--log-level\nmapper:=debug\n--enclave\n/robot",
        "--ros-args\n-r\n~/a:=/b\n--remap\nrostopic://x:=y\n-e\n/\n--disable-rosout-logs",
    ];
    lines.map(|text| text.as_bytes().to_vec()).to_vec()
}

/// Seeds of [`bag`]: both storages, whole and cut.
pub fn bag_seeds() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for storage in [Storage::Mcap, Storage::Sqlite3] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seed");
        let mut bag = BagWriter::create(&path, storage, WriterOptions::default()).unwrap();
        for name in ["/a", "/b"] {
            bag.add_topic(TopicSpec {
                name: name.into(),
                type_name: "std_msgs/msg/String".into(),
                definition: Some("string data\n".into()),
                ..TopicSpec::default()
            })
            .unwrap();
        }
        for i in 0..6 {
            let cdr = [0, 1, 0, 0, 2, 0, 0, 0, b'x', 0];
            bag.write(i % 2, 1_000_000 * i as i64, &cdr).unwrap();
        }
        bag.finish().unwrap();
        let file = path.join(format!("seed_0.{}", storage.extension()));
        let whole = fs::read(file).unwrap();
        seeds.push(whole[..whole.len() * 2 / 3].to_vec());
        seeds.push(whole);
    }
    seeds
}

/// Seeds of [`points`].
pub fn points_seeds() -> Vec<Vec<u8>> {
    let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty double y\n\
                  property int z\nproperty ushort label\nelement face 1\n\
                  property list uchar int vertex_indices\nend_header\n";
    let ascii = format!("\0{header}1 2 3 4\n5 nan 7 8\n3 0 1 0\n").into_bytes();
    let binary = header.replace("ascii", "binary_little_endian");
    let binary = [b"\0", binary.as_bytes(), &[7; 50]].concat();
    let pcd = |data: &str| {
        let head = "\x01VERSION .7\nFIELDS x y z label\nSIZE 4 4 4 2\nTYPE F F F U\nCOUNT 1 1 1 1\n\
                    WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n";
        format!("{head}DATA {data}\n").into_bytes()
    };
    let lzf = [8_u32.to_le_bytes(), 28_u32.to_le_bytes()].concat();
    vec![
        ascii,
        binary,
        [pcd("ascii"), b"1 2 3 4\n5 6 7 8\n".to_vec()].concat(),
        [pcd("binary"), vec![65; 28]].concat(),
        [
            pcd("binary_compressed"),
            lzf,
            vec![1, 65, 66, 0xe0, 5, 1, 0, 1],
        ]
        .concat(),
        b"\x021 2 3\n4,5,6 # x\n\nnan 0 1\n".to_vec(),
        [vec![3], vec![63; 64]].concat(),
    ]
}

/// Seeds of [`mesh`]: one square in each of the formats.
pub fn mesh_seeds() -> Vec<Vec<u8>> {
    let ply = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
        property uchar label\nend_header\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n4 0 1 2 3 7\n";
    let obj = b"v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nf 1/1/1 2 3 -1\n";
    let vertices = [0.0_f32, 0., 0., 2., 0., 0., 2., 1., 0., 0., 1., 0.];
    let corners = [0_u16, 1, 2, 0, 2, 3];
    let vertices = vertices.iter().flat_map(|c| c.to_le_bytes());
    let corners = corners.iter().flat_map(|c| c.to_le_bytes());
    let binary: Vec<u8> = vertices.chain(corners).collect();
    let text = |uri: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],
"nodes":[{{"children":[1],"rotation":[0,0,1,0]}},{{"mesh":0,"scale":[1,2,-3],"extras":{{"label":7}}}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":4}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
{{"bufferView":0,"byteOffset":48,"componentType":5123,"count":6,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":60,"byteOffset":0}}],"buffers":[{{"byteLength":60{uri}}}]}} "#
        )
    };
    let data = "AAAAAAAAAAAAAAAAAAAAQAAAAAAAAAAAAAAAQAAAgD8AAAAAAAAAAAAAgD8AAAAAAAABAAIAAAACAAMA";
    let gltf = text(&format!(r#","uri":"data:;base64,{data}""#));
    let mut json = text("").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let number = |length: usize| (length as u32).to_le_bytes();
    let whole = 12 + 8 + json.len() + 8 + binary.len();
    let glb = [
        b"glTF",
        &number(2)[..],
        &number(whole),
        &number(json.len()),
        b"JSON",
        &json,
        &number(binary.len()),
        b"BIN\0",
        &binary,
    ];
    let files = [ply.to_vec(), obj.to_vec(), gltf.into_bytes(), glb.concat()];
    let named = (0_u8..).zip(files);
    named
        .map(|(name, file)| [vec![name], file].concat())
        .collect()
}
