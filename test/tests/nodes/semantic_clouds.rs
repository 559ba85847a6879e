//! Labelled clouds from anyone: read without trust.

use std::collections::BTreeMap;

use lattice_core::pose::Axes;
use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_nodes::convert::semantic::{
    LabelOptions, SemanticOptions, labels_from_message, message_from_semantic,
    semantic_from_message,
};
use lattice_nodes::semantic_icp_server::{SemanticIcpServer, ServerOptions};
use lattice_test::clouds::{field, header};
use proptest::prelude::*;
use serde_bytes::ByteBuf;

/// Names of fields, not all of which mean something.
const NAMES: &str = "label confidence label_probs p_0 p_1 rgb semantic_color semantic_color1 \
                     confidence1 semantic_color2 time";

fn fields() -> impl Strategy<Value = Vec<PointField>> {
    let count = prop_oneof![8 => Just(1_u32), 2 => 0..6_u32, 1 => any::<u32>()];
    let offset = prop_oneof![9 => 0..24_u32, 1 => any::<u32>()];
    let datatype = prop_oneof![12 => 1..9_u8, 1 => any::<u8>()];
    let names: Vec<&str> = NAMES.split(' ').collect();
    let further = (prop::sample::select(names), offset, datatype, count);
    let further = further.prop_map(|(name, offset, datatype, count)| PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count,
    });
    let place = (0..10_u8).prop_map(|n| if n == 0 { 8 } else { 7 });
    (prop::collection::vec(further, 0..5), place).prop_map(|(fields, datatype)| {
        let places = ["x", "y", "z"].into_iter().zip([0, 4, 8]);
        let places = places.map(|(name, offset)| field(name, offset, datatype));
        places.chain(fields).collect()
    })
}

fn clouds() -> impl Strategy<Value = PointCloud2> {
    let bytes = prop::collection::vec(any::<u8>(), 0..600);
    let size = prop_oneof![8 => 0..12_u32, 1 => any::<u32>()];
    let step = prop_oneof![8 => 32..48_u32, 1 => any::<u32>()];
    let parts = (fields(), bytes, size, step, any::<bool>());
    parts.prop_map(
        |(fields, bytes, width, point_step, is_bigendian)| PointCloud2 {
            header: header("headset_origin", 7),
            height: 1,
            width,
            fields,
            is_bigendian,
            point_step,
            row_step: point_step.saturating_mul(width),
            data: ByteBuf::from(bytes),
            is_dense: false,
        },
    )
}

fn options(axes: Axes, require_labels: bool) -> SemanticOptions {
    // Any byte is a colour of some class.
    let palette = (0..=255).map(|b| ([b, b, b], u16::from(b)));
    SemanticOptions {
        max_points: 1000,
        axes,
        require_labels,
        labels: LabelOptions {
            palette: BTreeMap::from_iter(palette),
            ..LabelOptions::default()
        },
        ..SemanticOptions::default()
    }
}

proptest! {
    #[test]
    fn what_is_read_can_be_used(
        message in clouds(),
        axes in prop::sample::select(&Axes::ALL[..]),
        require_labels in any::<bool>(),
    ) {
        let options = options(axes, require_labels);
        let labels = labels_from_message(&message, options.max_points, &options.labels);
        let Ok((cloud, report)) = semantic_from_message(&message, &options) else {
            return Ok(());
        };
        prop_assert!(!cloud.is_empty());
        prop_assert_eq!(report.points, message.width as usize);
        prop_assert_eq!(cloud.len() + report.not_finite + report.too_far, report.points);
        prop_assert!(cloud.labels.is_empty() || cloud.labels.len() == cloud.len());
        prop_assert!(!(require_labels && cloud.labels.is_empty()));
        for p in &cloud.points_m {
            prop_assert!(p.coords.norm() <= options.max_range_m);
        }
        let mut unlabelled = 0;
        for i in 0..cloud.len() {
            let sum: f32 = cloud.label(i).iter().map(|(_, weight)| weight).sum();
            prop_assert!((0.0..1.001).contains(&sum));
            prop_assert!(cloud.label(i).iter().all(|(class, w)| class != UNLABELED && w > 0.0));
            unlabelled += usize::from(cloud.label(i).top().is_none());
        }
        prop_assert_eq!(unlabelled, report.unlabelled);
        let of_all = labels.unwrap().map(|labels| labels.len());
        prop_assert!(of_all.is_none_or(|n| n == report.points));

        // What the nodes write of it, they read.
        let written = message_from_semantic(header("map", 7), &cloud);
        let (back, _) = semantic_from_message(&written, &SemanticOptions::default()).unwrap();
        prop_assert_eq!(back.len(), cloud.len());
        for i in 0..back.len() {
            prop_assert_eq!(back.label(i).top(), cloud.label(i).top());
        }
    }

    #[test]
    fn the_server_answers_every_cloud(messages in prop::collection::vec(clouds(), 1..4)) {
        let mut server = SemanticIcpServer::new(ServerOptions::default());
        for (message, n) in messages.iter().zip(1..) {
            let outputs = server.on_headset_cloud(message, n);
            // Without a map: refused for one reason or the other.
            prop_assert_eq!(outputs.len(), 1);
            let counts = server.counts();
            prop_assert_eq!(counts.clouds_in, n as u64);
            prop_assert_eq!(counts.clouds_refused() + counts.clouds_no_map, n as u64);
        }
    }
}
