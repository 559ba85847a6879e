//! Files and messages of earlier versions, which this version reads.
//!
//! `test/compatibility/README.md` says how a release adds its own.

#[path = "../../../msgs/tests/messages/shape.rs"]
mod shape;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use lattice_bag::{BagReader, BagWriter, ReadOptions, Storage, TopicSpec, WriterOptions};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::file::{MapContents, WriteOptions, read_map, read_occupancy};
use lattice_core::voxels::{Payload, VoxelList, VoxelStore};
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::{MessageVisitor, RosMessage, cdr, hash_of, visit_messages};
use lattice_nodes::bag_player;
use lattice_nodes::executables::PARAMETERS;
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde_json::{Map, Value, json};

const MAX_VOXELS: usize = 1_000_000;
const START_NS: i64 = 1_700_000_000_000_000_000;

fn compatibility() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("compatibility")
}

/// Folders of all versions.
fn versions() -> Vec<PathBuf> {
    let all = fs::read_dir(compatibility()).unwrap();
    let all = all.map(|entry| entry.unwrap().path());
    let mut folders: Vec<PathBuf> = all.filter(|path| path.is_dir()).collect();
    folders.sort();
    assert!(!folders.is_empty());
    folders
}

fn contents(version: &Path) -> Value {
    serde_json::from_slice(&fs::read(version.join("contents.json")).unwrap()).unwrap()
}

/// FNV-1a of 64 bits, hexadecimal.
fn digest(bytes: &[u8]) -> String {
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
    format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, step))
}

/// Files below a folder by relative path.
fn files(folder: &Path) -> BTreeMap<String, PathBuf> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            let below = files(&path).into_iter();
            found.extend(below.map(|(file, path)| (format!("{name}/{file}"), path)));
        } else {
            found.insert(name, path);
        }
    }
    found
}

/// Points of a sphere and a floor: the same on every machine.
fn cloud(stamp_ns: i64) -> Cloud {
    let mut offsets_m = Vec::new();
    for i in 0..12_i16 {
        for j in 0..12_i16 {
            let (x, y) = (f32::from(i) * 0.25 - 1.5, f32::from(j) * 0.25 - 1.5);
            offsets_m.push([x, y, 0.125]);
            offsets_m.push([x, y, 0.125 * x * y + 1.0]);
        }
    }
    Cloud {
        stamp_ns,
        datum_m: Vector3::new(100.0, -200.0, 5.0),
        offsets_m,
    }
}

/// Lattices with the names of their map files.
fn lattices() -> Vec<(String, Lattice)> {
    let named = LatticeKind::ALL.iter().map(|kind| {
        let lattice = Lattice::new(*kind, 0.125).unwrap();
        (kind.to_string(), lattice)
    });
    let basis = Matrix3::new(0.5, 0.1, 0.0, 0.0, 0.5, 0.1, 0.0, 0.0, 0.5);
    let custom = Lattice::from_basis(basis).unwrap();
    let turned = custom.oriented(UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3));
    named.chain([("custom".to_owned(), turned)]).collect()
}

fn map(lattice: Lattice) -> VoxelList {
    let first = cloud(START_NS);
    let list = VoxelList::new(lattice, first.datum_m, MAX_VOXELS).unwrap();
    let (stamps, labels) = (true, true);
    let mut list = list.with_payload(Payload {
        stamps,
        labels,
        ..Payload::default()
    });
    let labels: Vec<u16> = (0..first.offsets_m.len())
        .map(|i| (i % 3) as u16 * 7)
        .collect();
    list.insert_labelled(&first, &labels);
    let mut second = cloud(START_NS + 1_000_000_000);
    second.offsets_m.truncate(50);
    list.insert(&second);
    list
}

/// Contents of a map file; rows are `w0 w1 w2 count sum0 sum1 sum2 first_ns last_ns label:count...`.
fn map_contents(bytes: &[u8]) -> Value {
    let list = read_map(bytes, MAX_VOXELS).unwrap();
    let mut rows = String::new();
    for (key, voxel) in list.sorted() {
        let index = key.unpack();
        let stamps = list.stamps(key).unwrap();
        rows += &format!(
            "{} {} {} {} {} {} {} {} {}",
            index[0],
            index[1],
            index[2],
            voxel.count,
            voxel.sum[0],
            voxel.sum[1],
            voxel.sum[2],
            stamps.first_ns,
            stamps.last_ns
        );
        for of in list.labels(key) {
            rows += &format!(" {}:{}", of.label, of.count);
        }
        rows += "\n";
    }
    let occupied = read_occupancy(bytes, 1 << 24).unwrap();
    assert_eq!(occupied.len(), list.len());
    let datum = list.datum_index();
    json!({
        "voxels": list.len(),
        "points": list.distortion().points,
        "cell_volume_m3": list.lattice().cell_volume_m3(),
        "datum_index": [datum[0], datum[1], datum[2]],
        "rows": digest(rows.as_bytes()),
    })
}

/// Messages of a bag: topic, type, log time, ns, and digest of the CDR.
fn bag_contents(bag: &Path) -> Value {
    let bag = BagReader::open(bag).unwrap();
    let topics: BTreeMap<String, String> = bag
        .topics()
        .iter()
        .map(|of| (of.name.clone(), of.type_name.clone()))
        .collect();
    let messages = bag.messages(&ReadOptions::default()).unwrap();
    let mut found = Vec::new();
    for message in messages {
        let message = message.unwrap();
        let topic = &bag.topics()[message.topic].name;
        found.push(json!([
            topic,
            topics[topic],
            message.log_time_ns,
            digest(&message.data)
        ]));
    }
    Value::Array(found)
}

/// Messages of Lattice as type hash, CDR in hexadecimal, and value.
struct Messages(Map<String, Value>);

impl MessageVisitor for Messages {
    fn visit<M: RosMessage>(&mut self) {
        if M::TYPE.starts_with("lattice_msgs/") {
            let (message, ..): (M, _, _) = shape::filled(2);
            let bytes = cdr::to_vec(&message).unwrap();
            let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            let value = serde_json::to_value(&message).unwrap();
            let of = json!({ "hash": hash_of(M::TYPE), "cdr": hex, "value": value });
            self.0.insert(M::TYPE.to_owned(), of);
        }
    }
}

/// Reads the messages of a version.
struct Read {
    messages: Map<String, Value>,
    names: Vec<&'static str>,
}

impl MessageVisitor for Read {
    fn visit<M: RosMessage>(&mut self) {
        let Some(of) = self.messages.get(M::TYPE) else {
            return;
        };
        self.names.push(M::TYPE);
        let hex = of["cdr"].as_str().unwrap();
        let byte = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
        let bytes: Vec<u8> = (0..hex.len()).step_by(2).map(byte).collect();
        let is_same = hash_of(M::TYPE) == of["hash"].as_str();
        // A message with another definition has another hash, and is a finding of the release.
        assert!(is_same, "{}: the definition has changed", M::TYPE);
        let message: M = cdr::from_slice(&bytes).unwrap();
        assert_eq!(
            serde_json::to_value(&message).unwrap(),
            of["value"],
            "{}",
            M::TYPE
        );
        assert_eq!(cdr::to_vec(&message).unwrap(), bytes, "{}", M::TYPE);
    }
}

#[test]
fn files_are_as_they_were_written() {
    for version in versions() {
        let digests = &contents(&version)["digests"];
        let mut bytes = 0;
        for (name, path) in files(&version) {
            let content = fs::read(path).unwrap();
            bytes += content.len();
            if name != "contents.json" {
                assert_eq!(digests[&name], digest(&content), "{version:?}: {name}");
            }
        }
        assert!(bytes < 300_000, "{version:?} has {bytes} bytes");
    }
}

#[test]
fn maps_of_earlier_versions_are_read() {
    for version in versions() {
        let contents = contents(&version);
        let maps = contents["maps"].as_object().unwrap();
        assert!(maps.len() >= 7, "{version:?}");
        for (name, expected) in maps {
            let bytes = fs::read(version.join("maps").join(name)).unwrap();
            assert_eq!(map_contents(&bytes), *expected, "{version:?}: {name}");
        }
    }
}

#[test]
fn bags_of_earlier_versions_are_read() {
    for version in versions() {
        for (name, expected) in contents(&version)["bags"].as_object().unwrap() {
            let bag = version.join("bags").join(name);
            assert_eq!(bag_contents(&bag), *expected, "{version:?}: {name}");
        }
    }
}

#[test]
fn messages_of_earlier_versions_are_read() {
    for version in versions() {
        let messages = fs::read(version.join("messages.json")).unwrap();
        let messages: Map<String, Value> = serde_json::from_slice(&messages).unwrap();
        let mut read = Read {
            messages,
            names: Vec::new(),
        };
        visit_messages(&mut read);
        let gone: Vec<_> = read
            .messages
            .keys()
            .filter(|name| !read.names.contains(&&***name))
            .collect();
        assert!(gone.is_empty(), "{version:?}: {gone:?}");
    }
}

#[test]
fn parameters_of_earlier_versions_are_taken() {
    let player = (bag_player::NAME, bag_player::declare as _);
    let nodes: Vec<_> = PARAMETERS.iter().copied().chain([player]).collect();
    for version in versions() {
        for (name, path) in files(&version.join("params")) {
            let text = fs::read_to_string(&path).unwrap();
            let sections = nodes
                .iter()
                .filter(|(node, _)| text.contains(&format!("/**/{node}:\n")));
            let mut count = 0;
            for (node, declare) in sections {
                let file = path.to_str().unwrap();
                let arguments = ["--ros-args", "--params-file", file].map(str::to_owned);
                let args = RosArgs::parse(arguments).unwrap();
                let params = Params::load(&args, &format!("/robot/{node}")).unwrap();
                declare(&params).unwrap();
                assert_eq!(params.unused(), [""; 0], "{version:?}: {name}: {node}");
                count += 1;
            }
            assert!(count > 0, "{version:?}: {name}");
        }
    }
}

#[test]
#[ignore = "writes the files of this version, for a release"]
fn write() {
    let version = env!("CARGO_PKG_VERSION");
    let (minor, _) = version.rsplit_once('.').unwrap();
    let folder = compatibility().join(minor);
    fs::create_dir(&folder).expect("a version writes its files once");
    for name in ["maps", "bags", "params"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    let mut maps = Map::new();
    for (i, (name, lattice)) in (0..).zip(lattices()) {
        let options = WriteOptions {
            // Both codecs.
            zstd_level: (i % 2 == 0).then_some(3),
            occupancy_only: false,
        };
        let mut bytes = Vec::new();
        let contents = MapContents::from_list(&map(lattice));
        contents.write(&mut bytes, &options).unwrap();
        let name = format!("{name}.lattice");
        fs::write(folder.join("maps").join(&name), &bytes).unwrap();
        maps.insert(name, map_contents(&bytes));
    }
    let mut bags = Map::new();
    for (name, storage) in [("mcap", Storage::Mcap), ("sqlite3", Storage::Sqlite3)] {
        let bag = folder.join("bags").join(name);
        write_bag(&bag, storage);
        bags.insert(name.to_owned(), bag_contents(&bag));
    }
    let mut messages = Messages(Map::new());
    visit_messages(&mut messages);
    let messages = serde_json::to_string(&messages.0).unwrap() + "\n";
    fs::write(folder.join("messages.json"), messages).unwrap();
    let params = compatibility().join("../../params");
    for (name, path) in files(&params) {
        fs::copy(path, folder.join("params").join(name)).unwrap();
    }
    let digests: Map<String, Value> = files(&folder)
        .into_iter()
        .map(|(name, path)| (name, digest(&fs::read(path).unwrap()).into()))
        .collect();
    let contents = json!({ "version": version, "maps": maps, "bags": bags, "digests": digests });
    let contents = serde_json::to_string_pretty(&contents).unwrap() + "\n";
    fs::write(folder.join("contents.json"), contents).unwrap();
}

/// Writes a keyframe, an update and a cloud.
fn write_bag(path: &Path, storage: Storage) {
    fn write<M: RosMessage>(writer: &mut BagWriter, name: &str, time_ns: i64) {
        let topic = TopicSpec {
            name: name.to_owned(),
            type_name: M::TYPE.to_owned(),
            definition: Some(M::definition()),
            ..TopicSpec::default()
        };
        let topic = writer.add_topic(topic).unwrap();
        let (message, ..): (M, _, _) = shape::filled(3);
        let bytes = cdr::to_vec(&message).unwrap();
        writer.write(topic, time_ns, &bytes).unwrap();
    }
    let mut writer = BagWriter::create(path, storage, WriterOptions::default()).unwrap();
    write::<LatticeMap>(&mut writer, "/voxel_map", START_NS);
    write::<LatticeMapUpdate>(&mut writer, "/voxel_map_updates", START_NS + 1);
    write::<PointCloud2>(&mut writer, "/points", START_NS + 2);
    writer.finish().unwrap();
}
