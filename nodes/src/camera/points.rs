//! Labelled points in the layout of clouds.

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::std_msgs::Header;

use super::labels::Classes;
use super::pixels::Pixel;
use super::point_layout::PointLayout;
use crate::convert::cloud::{dense_cloud, field, xyz_fields};
use crate::convert::viewpoint::VIEWPOINT_FIELDS;

/// Records of points, little endian.
#[derive(Debug, Default)]
pub struct LabelledPoints {
    layout: PointLayout,
    data: Vec<u8>,
    points: usize,
    unlabelled: u64,
}

impl LabelledPoints {
    /// Empty records with capacity.
    pub fn new(layout: PointLayout, points: usize) -> Self {
        Self {
            layout,
            data: Vec::with_capacity(points.saturating_mul(layout.step())),
            points: 0,
            unlabelled: 0,
        }
    }

    /// Adds the point of a pixel; without a class its confidence and probabilities are 0.
    pub fn push(&mut self, point_m: [f32; 3], pixel: &Pixel, classes: &Classes) {
        let class = classes.known(pixel.number, pixel.confidence);
        self.points += 1;
        self.unlabelled += u64::from(class.is_none());
        let label = class.unwrap_or(UNLABELED).to_le_bytes();
        let confidence = class.map_or(0.0, |_| pixel.confidence).to_le_bytes();
        let [x, y, z] = point_m.map(f32::to_le_bytes);
        // As in PCL: the bytes of an integer in a float field.
        let [r, g, b] = pixel.color;
        let record: &[&[u8]] = match self.layout.has_color {
            true => &[&x, &y, &z, &[b, g, r, 0], &label, &confidence],
            false => &[&x, &y, &z, &label, &confidence],
        };
        for part in record {
            self.data.extend_from_slice(part);
        }
        for v in self.layout.viewpoint_m.iter().flatten() {
            self.data.extend_from_slice(&v.to_le_bytes());
        }
        if self.has_probabilities() {
            self.push_probabilities(pixel, classes, class.is_some());
        }
    }

    fn push_probabilities(&mut self, pixel: &Pixel, classes: &Classes, is_known: bool) {
        let begin = self.data.len();
        self.data.resize(begin + 4 * self.layout.classes, 0);
        let (elements, _) = self.data[begin..].as_chunks_mut::<4>();
        for share in pixel.shares.iter().filter(|_| is_known) {
            let class = classes.known(share.class, 1.0);
            let element = class.and_then(|class| elements.get_mut(usize::from(class)));
            if let Some(element) = element {
                let sum = f32::from_le_bytes(*element) + share.probability();
                *element = sum.to_le_bytes();
            }
        }
    }

    /// Points.
    pub fn len(&self) -> usize {
        self.points
    }

    /// Number of points without a class.
    pub fn unlabelled(&self) -> u64 {
        self.unlabelled
    }

    /// True with the field `label_probs`.
    pub fn has_probabilities(&self) -> bool {
        self.layout.classes > 0
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.points == 0
    }

    /// The cloud with the fields x, y, z, optional rgb, label, confidence, optional vp_x, vp_y, vp_z, and
    /// optional label_probs.
    pub fn cloud(self, header: Header) -> PointCloud2 {
        let mut fields = xyz_fields(PointField::FLOAT32, 4);
        let mut at = 12;
        if self.layout.has_color {
            fields.push(field("rgb", at, PointField::FLOAT32));
            at += 4;
        }
        fields.push(field("label", at, PointField::UINT16));
        fields.push(field("confidence", at + 2, PointField::FLOAT32));
        at += 6;
        if self.layout.viewpoint_m.is_some() {
            for name in VIEWPOINT_FIELDS {
                fields.push(field(name, at, PointField::FLOAT32));
                at += 4;
            }
        }
        if let Some(count) = u32::try_from(self.layout.classes).ok().filter(|n| *n > 0) {
            fields.push(PointField {
                count,
                ..field("label_probs", at, PointField::FLOAT32)
            });
        }
        let step = self.layout.step() as u32;
        dense_cloud(header, fields, step, self.points, self.data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::soft::Share;
    use crate::camera::{ClassRules, SoftLabels};
    use crate::convert::semantic::{SemanticOptions, semantic_from_message};
    use crate::convert::viewpoint::viewpoints_from_message;
    use lattice_core::cloud::CloudLimits;
    use lattice_core::registration::LabelDistribution;
    use nalgebra::Vector3;

    fn pixel(number: u16, shares: &[(u16, f32)]) -> Pixel {
        let mut pixel = Pixel {
            number,
            confidence: 0.5,
            color: [1, 2, 3],
            ..Pixel::NONE
        };
        for (share, (class, probability)) in pixel.shares.iter_mut().zip(shares) {
            *share = Share::new(*class, *probability);
        }
        pixel
    }

    #[test]
    fn what_a_pixel_knows_is_read_from_the_cloud() {
        let rules = ClassRules {
            ignored: [4].into(),
            groups: [(3, 1)].into(),
            ..ClassRules::default()
        };
        let classes = Classes::new(&rules);
        let soft = SoftLabels::none(5);
        let layout = PointLayout {
            has_color: true,
            viewpoint_m: Some([7.0, 8.0, 9.0]),
            classes: soft.elements(&classes),
        };
        assert_eq!(layout.classes, 3, "4 is ignored and 3 counts as 1");
        let mut points = LabelledPoints::new(layout, 2);
        let shares = [(0, 0.5), (1, 0.125), (3, 0.25), (4, 0.0625)];
        points.push([1.0, 2.0, 3.0], &pixel(0, &shares), &classes);
        points.push([4.0, 5.0, 6.0], &pixel(4, &shares), &classes);
        assert_eq!((points.len(), points.unlabelled()), (2, 1));
        let cloud = points.cloud(Header::default());
        assert_eq!(cloud.point_step, 46);
        let viewpoints = viewpoints_from_message(&cloud, &CloudLimits::default());
        assert_eq!(
            viewpoints.unwrap(),
            Some(vec![Vector3::new(7.0, 8.0, 9.0); 2])
        );
        assert_eq!(cloud.data[12..16], [3, 2, 1, 0]);
        let (read, _) = semantic_from_message(&cloud, &SemanticOptions::default()).unwrap();
        let found: Vec<_> = read.label(0).iter().collect();
        for ((class, found), expected) in found.iter().zip([(0, 0.5), (1, 0.375)]) {
            assert_eq!(*class, expected.0);
            assert!((found - expected.1).abs() < 1e-4, "{found}");
        }
        assert_eq!(found.len(), 2);
        assert_eq!(read.label(1), LabelDistribution::UNKNOWN);
    }

    #[test]
    fn clouds_that_would_be_too_large_have_no_probabilities() {
        let layout = PointLayout {
            classes: 150,
            ..PointLayout::default()
        };
        assert_eq!(layout.bounded(50_000), layout);
        assert_eq!(layout.bounded(60_000).classes, 0);
        assert_eq!(layout.bounded(usize::MAX).classes, 0);
    }
}
