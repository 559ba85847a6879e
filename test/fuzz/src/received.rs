//! Bodies of the targets of what comes over the network: messages, clouds, maps.

use std::sync::Arc;

use lattice_core::cloud::{Cloud, CloudLimits};
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::{Changes, VoxelList};
use lattice_msgs::geometry_msgs::Point32;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};
use lattice_msgs::livox_ros_driver2::{CustomMsg, CustomPoint};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::{
    ChannelFloat32, LaserEcho, LaserScan, MultiEchoLaserScan, PointCloud, PointCloud2, PointField,
};
use lattice_msgs::std_msgs::Header;
use lattice_msgs::{MessageVisitor, RosMessage, cdr, visit_messages};
use lattice_nodes::cloud_input::{CloudType, SensorCloud};
use lattice_nodes::convert::cloud::{cloud_from_message, field};
use lattice_nodes::convert::map::{History, MapStamp, keyframe, sign, update};
use lattice_nodes::convert::semantic::{SemanticOptions, semantic_from_message};
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_nodes::hurry::Hurry;
use lattice_nodes::map_follower::MapFollower;
use nalgebra::Vector3;
use serde_bytes::ByteBuf;

/// Limit of points and voxels that a target processes.
const MOST: usize = 10_000;

/// Decodes the bytes as the message that the first of them names; what succeeds comes back from its own
/// bytes.
pub fn message(bytes: &[u8]) {
    struct Decode<'a>(usize, &'a [u8]);
    impl MessageVisitor for Decode<'_> {
        fn visit<M: RosMessage>(&mut self) {
            let is_this = self.0 == 0;
            self.0 = self.0.wrapping_sub(1);
            if let Some(message) = is_this.then(|| cdr::from_slice::<M>(self.1).ok()).flatten() {
                let again = cdr::to_vec(&message).unwrap();
                let back = cdr::from_slice::<M>(&again).unwrap();
                // By bytes: NaN is not equal to itself.
                assert_eq!(cdr::to_vec(&back).unwrap(), again, "{}", M::TYPE);
            }
        }
    }
    if let Some((number, body)) = bytes.split_first() {
        visit_messages(&mut Decode(usize::from(*number), body));
    }
}

/// Takes a cloud of each type through every reader that there is, and the transformer.
pub fn cloud(bytes: &[u8]) {
    for cloud_type in CloudType::ALL {
        let decoded = cloud_type.decode(bytes).ok();
        if let Some(Ok(message)) = decoded.map(SensorCloud::into_cloud) {
            read_cloud(message);
        }
    }
}

fn read_cloud(message: Arc<PointCloud2>) {
    let limits = CloudLimits { max_points: MOST };
    if let Ok(cloud) = cloud_from_message(&message, &limits, &Vector3::zeros()) {
        assert!(cloud.offsets_m.len() <= MOST);
    }
    let options = SemanticOptions {
        max_points: MOST,
        ..SemanticOptions::default()
    };
    if let Ok((cloud, report)) = semantic_from_message(&message, &options) {
        assert!(cloud.points_m.len() <= report.points);
    }
    let mut options = TransformerOptions::new(InsSource::Odometry);
    options.max_cloud_points = MOST;
    let mut transformer = EnuTransformer::new(options);
    let stamp_ns = message.header.stamp.to_ns();
    for i in -2..=2 {
        let at_ns = stamp_ns.saturating_add(100_000_000 * i);
        let mut pose = Odometry::default();
        pose.header.stamp = lattice_msgs::builtin_interfaces::Time::from_ns(at_ns);
        pose.header.frame_id = "map".into();
        pose.child_frame_id = "base_link".into();
        pose.pose.pose.orientation.w = 1.0;
        pose.pose.pose.position.x = i as f64;
        transformer.on_ins("ins", InsMessage::Odometry(&pose), at_ns);
    }
    for output in transformer.on_cloud("points", message, stamp_ns) {
        if let EnuOutput::Points(points) = output {
            cloud_from_message(&points, &limits, &Vector3::zeros()).unwrap();
        }
    }
}

/// Feeds a follower with messages of the two topics: kind, length (two bytes), CDR, and so on.
pub fn follower(bytes: &[u8]) {
    let mut follower = MapFollower::new(MOST);
    let mut rest = bytes;
    while let [kind, low, high, tail @ ..] = rest {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(tail.len());
        let (body, tail) = tail.split_at(length);
        rest = tail;
        match kind % 3 {
            0 => drop(cdr::from_slice::<LatticeMap>(body).map(|m| follower.on_map(&m).is_ok())),
            1 => {
                let update = cdr::from_slice::<LatticeMapUpdate>(body);
                drop(update.map(|m| follower.on_update(&m).is_ok()));
            }
            _ => drop(follower.check_keyframe_timeout()),
        }
        let voxels = follower.map().map_or(0, |map| map.voxels().len());
        assert!(voxels <= MOST, "{voxels} voxels");
    }
}

/// Seeds of [`message`]: each type with its defaults.
pub fn message_seeds() -> Vec<Vec<u8>> {
    struct Collect(Vec<Vec<u8>>);
    impl MessageVisitor for Collect {
        fn visit<M: RosMessage>(&mut self) {
            let number = u8::try_from(self.0.len()).unwrap();
            let body = cdr::to_vec(&M::default()).unwrap();
            self.0.push([&[number][..], &body].concat());
        }
    }
    let mut collect = Collect(Vec::new());
    visit_messages(&mut collect);
    collect.0
}

/// Seeds of [`cloud`].
pub fn cloud_seeds() -> Vec<Vec<u8>> {
    let forms: [&[(&str, u8)]; 4] = [
        &[("x", 7), ("y", 7), ("z", 7)],
        &[("x", 8), ("y", 8), ("z", 8), ("t", 6)],
        &[("x", 7), ("y", 7), ("z", 7), ("time", 7), ("label", 4)],
        &[
            ("x", 7),
            ("y", 7),
            ("z", 7),
            ("semantic_color", 6),
            ("confidence", 7),
        ],
    ];
    let seed = |form: &&[(&str, u8)]| {
        let width = |code: u8| [0, 1, 1, 2, 2, 4, 4, 4, 8][usize::from(code)];
        let mut message = PointCloud2 {
            header: Header {
                frame_id: "base_link".into(),
                ..Header::default()
            },
            height: 1,
            width: 5,
            ..PointCloud2::default()
        };
        message.header.stamp.sec = 1000;
        for (name, code) in *form {
            message.fields.push(field(name, message.point_step, *code));
            message.point_step += width(*code);
        }
        assert!(
            message
                .fields
                .iter()
                .all(|f| f.datatype <= PointField::FLOAT64)
        );
        message.row_step = 5 * message.point_step;
        message.data = ByteBuf::from(vec![65; message.row_step as usize]);
        cdr::to_vec(&message).unwrap()
    };
    forms.iter().map(seed).chain(scan_seeds()).collect()
}

/// A message of each other type of clouds.
fn scan_seeds() -> [Vec<u8>; 4] {
    let header = || Header {
        stamp: lattice_msgs::builtin_interfaces::Time::from_ns(1_000_000_000_000),
        frame_id: "base_link".into(),
    };
    let ranges = vec![1.0, f32::INFINITY, f32::NAN, 2.0];
    let echo = |echoes: &[f32]| LaserEcho {
        echoes: echoes.to_vec(),
    };
    let point = CustomPoint {
        x: 1.0,
        offset_time: 1_000_000,
        ..CustomPoint::default()
    };
    [
        cdr::to_vec(&LaserScan {
            header: header(),
            angle_increment: 0.1,
            time_increment: 1e-3,
            range_max: 10.0,
            intensities: vec![1.0; ranges.len()],
            ranges,
            ..LaserScan::default()
        }),
        cdr::to_vec(&MultiEchoLaserScan {
            header: header(),
            angle_increment: 0.1,
            time_increment: 1e-3,
            ranges: vec![echo(&[1.0, 2.0]), echo(&[])],
            ..MultiEchoLaserScan::default()
        }),
        cdr::to_vec(&CustomMsg {
            header: header(),
            points: vec![point; 3],
            ..CustomMsg::default()
        }),
        cdr::to_vec(&PointCloud {
            header: header(),
            points: vec![Point32::default(); 2],
            channels: vec![ChannelFloat32 {
                name: "time".into(),
                values: vec![0.0, 0.1],
            }],
        }),
    ]
    .map(Result::unwrap)
}

/// Seeds of [`follower`]: a keyframe, an update, a quiet second.
pub fn follower_seeds() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for kind in [LatticeKind::Fcc, LatticeKind::Cubic] {
        let lattice = Lattice::new(kind, 0.125).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), MOST).unwrap();
        let cloud = |x: f32| Cloud {
            stamp_ns: 0,
            datum_m: Vector3::zeros(),
            offsets_m: (0..8).map(|i| [x, 0.5 * i as f32, 0.0]).collect(),
        };
        let stamp = |sequence, history| MapStamp {
            hurry: Hurry::default(),
            header: Header::default(),
            epoch: 1,
            sequence,
            history,
            origin: None,
            chunk_bytes: 400,
        };
        list.insert(&cloud(0.0));
        let mut seed = Vec::new();
        let mut add = |kind: u8, body: Vec<u8>| {
            seed.push(kind);
            seed.extend(u16::try_from(body.len()).unwrap().to_le_bytes());
            seed.extend(body);
        };
        for chunk in keyframe(&list, &stamp(0, History::default())) {
            add(0, cdr::to_vec(&chunk).unwrap());
        }
        list.insert(&cloud(3.0));
        let changes = Changes {
            changed: list.sorted().iter().map(|(key, _)| *key).collect(),
            removed: Vec::new(),
        };
        let mut chunks = update(&list, &changes, 0, &stamp(1, History::default()));
        sign(&mut chunks, History::default(), 1, list.len());
        for chunk in chunks {
            add(1, cdr::to_vec(&chunk).unwrap());
        }
        add(2, Vec::new());
        seeds.push(seed);
    }
    seeds
}
