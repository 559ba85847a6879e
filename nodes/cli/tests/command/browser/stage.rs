//! A server of the page with what a test puts on it: few cells that are known, and results of calibrations.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::codec;
use lattice_msgs::cdr;
use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue};
use lattice_msgs::geometry_msgs::{
    Point, Pose, PoseStamped, Quaternion, TransformStamped, Vector3,
};
use lattice_msgs::lattice::{CalibrationResult, LatticeInfo, LatticeMap};
use lattice_msgs::nav_msgs::Path;
use lattice_msgs::std_msgs::Header;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use lattice_nodes::convert::geometry;
use lattice_nodes::viewer_server::{Broadcaster, Class, Entry, RequestAuth, Server};
use lattice_runtime::Activity;
use nalgebra::Isometry3;
use serde::Serialize;
use serde_bytes::ByteBuf;

/// Side of the cubic cells, m.
const SIDE_M: f64 = 0.5;

/// A cell of the map.
#[derive(Clone, Debug, Serialize)]
pub struct Known {
    /// Index on the cubic lattice.
    pub index: [i32; 3],
    /// Key, as the page writes it.
    pub key: String,
    /// Points in it.
    pub count: u32,
    /// Label; 65535: none.
    pub label: u16,
}

impl Known {
    /// A cell.
    pub fn new(index: [i32; 3], count: u32, label: u16) -> Self {
        let key = MortonKey::pack(index).unwrap().raw().to_string();
        Self {
            index,
            key,
            count,
            label,
        }
    }
}

/// The server and its channels.
pub struct Stage {
    broadcaster: Arc<Broadcaster>,
    calibration: u32,
    free: u32,
    label_info: u32,
    transforms: u32,
    drive: u32,
    loops: u32,
    diagnostics: Option<u32>,
    /// Address of the page.
    pub url: String,
    _server: Server,
}

impl Stage {
    /// Shows these cells.
    pub fn show(cells: &[Known]) -> Self {
        Self::with(cells, false)
    }

    /// The same with `/diagnostics`, without which the page takes silence for rest.
    pub fn live(cells: &[Known]) -> Self {
        Self::with(cells, true)
    }

    fn with(cells: &[Known], live: bool) -> Self {
        let broadcaster = Arc::new(Broadcaster::new(4, Activity::default()));
        broadcaster.channel::<LatticeMap>("/voxel_map", Class::Map, false);
        let one = Class::Newest { depth: 1 };
        let calibration = broadcaster.channel::<CalibrationResult>("/calibration", one, true);
        let free = broadcaster.channel::<LatticeMap>("/free", one, true);
        let label_info = broadcaster.channel::<LabelInfo>("/label_info", one, true);
        let transforms = broadcaster.channel::<TFMessage>("/tf", one, true);
        let drive = broadcaster.channel::<Path>("/path", one, true);
        let loops = broadcaster.channel::<MarkerArray>("/loop_closures", one, true);
        let states = || {
            broadcaster.channel::<DiagnosticArray>(
                "/diagnostics",
                Class::Newest { depth: 20 },
                false,
            )
        };
        let diagnostics = live.then(states);
        let chunk = chunk(&map(cells));
        broadcaster.change_map(|stream| stream.set_keyframe(vec![chunk]));
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let server = Server::start(
            address,
            RequestAuth::default(),
            None,
            Arc::clone(&broadcaster),
        )
        .unwrap();
        Self {
            broadcaster,
            calibration,
            free,
            label_info,
            transforms,
            drive,
            loops,
            diagnostics,
            url: format!("http://{}", server.address()),
            _server: server,
        }
    }

    /// Shows another map.
    pub fn replace(&self, cells: &[Known]) {
        let mut map = map(cells);
        map.info.epoch += 1;
        self.broadcaster.change_map(|stream| {
            stream.reset();
            stream.set_keyframe(vec![chunk(&map)]);
        });
    }

    /// Publishes the position of the robot.
    pub fn robot_at(&self, [x, y, z]: [f64; 3]) {
        let mut transform = TransformStamped {
            child_frame_id: "base_link".to_owned(),
            ..TransformStamped::default()
        };
        transform.header.frame_id = "map".to_owned();
        transform.transform.translation = Vector3 { x, y, z };
        transform.transform.rotation.w = 1.0;
        let message = TFMessage {
            transforms: vec![transform],
        };
        self.broadcaster
            .offer(self.transforms, cdr::to_vec(&message).unwrap());
    }

    /// Publishes the path of a drive in a frame, and the lines of its loops in the map.
    pub fn drive(&self, frame: &str, path: &[[f64; 3]], loops: &[[f64; 3]]) {
        let pose = |&[x, y, z]: &[f64; 3]| PoseStamped {
            pose: geometry::pose_from(&Isometry3::translation(x, y, z)),
            ..PoseStamped::default()
        };
        let path = Path {
            header: geometry::header(frame, 1),
            poses: path.iter().map(pose).collect(),
        };
        let lines = Marker {
            header: geometry::header("map", 1),
            ns: "loop_closures".to_owned(),
            type_: Marker::LINE_LIST,
            points: loops.iter().map(|&[x, y, z]| Point { x, y, z }).collect(),
            ..Marker::default()
        };
        let lines = MarkerArray {
            markers: vec![lines],
        };
        self.broadcaster
            .offer(self.drive, cdr::to_vec(&path).unwrap());
        self.broadcaster
            .offer(self.loops, cdr::to_vec(&lines).unwrap());
    }

    /// States a task of a node, with its values.
    pub fn state(&self, name: &str, level: u8, message: &str, values: &[(&str, &str)]) {
        let values = values.iter().map(|(key, value)| KeyValue {
            key: (*key).to_owned(),
            value: (*value).to_owned(),
        });
        let status = DiagnosticStatus {
            level,
            name: name.to_owned(),
            message: message.to_owned(),
            values: values.collect(),
            ..DiagnosticStatus::default()
        };
        let states = DiagnosticArray {
            status: vec![status],
            ..DiagnosticArray::default()
        };
        let channel = self.diagnostics.unwrap();
        self.broadcaster
            .offer(channel, cdr::to_vec(&states).unwrap());
    }

    /// Publishes free cells.
    pub fn frees(&self, cells: &[Known]) {
        self.broadcaster
            .offer(self.free, cdr::to_vec(&map(cells)).unwrap());
    }

    /// Publishes the names of labels.
    pub fn names(&self, classes: &[(u16, &str)]) {
        let class = |&(class_id, name): &(u16, &str)| VisionClass {
            class_id,
            class_name: name.to_owned(),
        };
        let info = LabelInfo {
            class_map: classes.iter().map(class).collect(),
            ..LabelInfo::default()
        };
        self.broadcaster
            .offer(self.label_info, cdr::to_vec(&info).unwrap());
    }

    /// Publishes a calibration.
    pub fn calibrated(&self, result: &CalibrationResult) {
        self.broadcaster
            .offer(self.calibration, cdr::to_vec(result).unwrap());
    }
}

fn chunk(map: &LatticeMap) -> Entry {
    Entry {
        stamp_ns: 1,
        cdr: cdr::to_vec(map).unwrap().into(),
        thin: None,
    }
}

/// A map of these cells, as one message.
pub fn map(cells: &[Known]) -> LatticeMap {
    let mut sorted = cells.to_vec();
    sorted.sort_by_key(|cell| cell.key.parse::<u64>().unwrap());
    let key = |cell: &Known| MortonKey::pack(cell.index).unwrap();
    let keys: Vec<MortonKey> = sorted.iter().map(key).collect();
    LatticeMap {
        header: Header {
            frame_id: "map".to_owned(),
            ..Header::default()
        },
        info: LatticeInfo {
            lattice: "cubic".to_owned(),
            cell_volume_m3: SIDE_M.powi(3),
            generator: [SIDE_M, 0.0, 0.0, 0.0, SIDE_M, 0.0, 0.0, 0.0, SIDE_M],
            map_from_lattice: Pose {
                orientation: Quaternion {
                    w: 1.0,
                    ..Quaternion::default()
                },
                ..Pose::default()
            },
            epoch: 1,
            ..LatticeInfo::default()
        },
        sequence: 1,
        chunks: 1,
        voxels_total: keys.len() as u64,
        key_encoding: LatticeMap::KEY_ENCODING_MORTON21.to_owned(),
        voxels: keys.len() as u32,
        keys: ByteBuf::from(codec::encode_keys(&keys)),
        counts: sorted.iter().map(|cell| cell.count).collect(),
        labels: sorted.iter().map(|cell| cell.label).collect(),
        label_counts: sorted.iter().map(|cell| cell.count).collect(),
        ..LatticeMap::default()
    }
}
