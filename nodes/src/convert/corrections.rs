//! Corrections of an odometry as transforms over time.
//!
//! A `tf2_msgs/TFMessage` has the pose of the frame of the odometry in the map at each anchor, in order of time. Between two
//! transforms of one parent they are interpolated. A submap whose place in the map is unknown has a parent of its own.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::loop_closure::{Anchor, Corrections};
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::Isometry3;
use thiserror::Error;

use super::geometry;

/// Limit of transforms: a segment is some metres of path.
const MAX_ANCHORS: usize = 100_000;

/// Corrections, and the submaps whose place in the map is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlacedCorrections {
    /// Corrections of all submaps.
    pub corrections: Corrections,
    /// Numbers of the submaps whose place is known.
    pub placed: BTreeSet<u32>,
}

/// Reason why a message has no corrections.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum CorrectionsError {
    /// No transform, or too many.
    #[error("{0} transforms, expected 1 to {MAX_ANCHORS}")]
    Number(usize),
    /// Transforms of two frames.
    #[error("transforms of '{first}' and '{other}', expected one frame of an odometry")]
    Frames {
        /// The first child frame.
        first: String,
        /// Another one.
        other: String,
    },
    /// Numbers that are no rotation or not finite.
    #[error("transform {0} is no pose: a number is not finite, or the quaternion has no length")]
    Pose(usize),
    /// Stamps that go back.
    #[error("transform {0} is older than the one before")]
    Order(usize),
}

impl PlacedCorrections {
    /// Pose of the frame of the odometry in the map at a time; `None` where it is unknown.
    pub fn map_from_odom(&self, stamp_ns: i64) -> Option<Isometry3<f64>> {
        let anchor = self.corrections.at(stamp_ns)?;
        (self.placed.contains(&anchor.submap)).then_some(anchor.map_from_odom)
    }

    /// The corrections as a message.
    pub fn message(&self, map_frame: &str, odom_frame: &str) -> TFMessage {
        let transform = |anchor: &Anchor| {
            let parent = match self.placed.contains(&anchor.submap) {
                true => map_frame.to_owned(),
                false => format!("{map_frame}_submap_{}", anchor.submap),
            };
            let (stamp_ns, pose) = (anchor.stamp_ns, &anchor.map_from_odom);
            geometry::transform_stamped(&parent, odom_frame, stamp_ns, pose)
        };
        let anchors = self.corrections.anchors();
        TFMessage {
            transforms: anchors.iter().map(transform).collect(),
        }
    }

    /// Corrections and the frame of the odometry of a message. Submaps in the map have the number 0 in it.
    pub fn read(message: &TFMessage, map_frame: &str) -> Result<(Self, String), CorrectionsError> {
        let transforms = &message.transforms;
        let first = transforms
            .first()
            .filter(|_| transforms.len() <= MAX_ANCHORS);
        let first = first.ok_or(CorrectionsError::Number(transforms.len()))?;
        let name = |frame: &str| -> String {
            let frame = frame.trim_start_matches('/');
            frame.chars().take(256).collect()
        };
        let odom_frame = name(&first.child_frame_id);
        let mut submaps = BTreeMap::from([(map_frame.to_owned(), 0)]);
        let mut anchors: Vec<Anchor> = Vec::with_capacity(transforms.len());
        for (number, transform) in transforms.iter().enumerate() {
            let other = name(&transform.child_frame_id);
            if other != odom_frame {
                let first = odom_frame;
                return Err(CorrectionsError::Frames { first, other });
            }
            let map_from_odom = geometry::isometry_from_transform(&transform.transform);
            let map_from_odom = map_from_odom.ok_or(CorrectionsError::Pose(number))?;
            let stamp_ns = transform.header.stamp.to_ns();
            if anchors.last().is_some_and(|last| last.stamp_ns > stamp_ns) {
                return Err(CorrectionsError::Order(number));
            }
            let next = submaps.len() as u32;
            let submap = *(submaps.entry(name(&transform.header.frame_id))).or_insert(next);
            anchors.push(Anchor {
                stamp_ns,
                submap,
                map_from_odom,
            });
        }
        let read = Self {
            corrections: Corrections::new(anchors),
            placed: BTreeSet::from([0]),
        };
        Ok((read, odom_frame))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn placed() -> PlacedCorrections {
        let anchor = |stamp_ns: i64, submap: u32, x: f64| Anchor {
            stamp_ns,
            submap,
            map_from_odom: Isometry3::new(Vector3::new(x, 0.0, 1.0), Vector3::z() * x),
        };
        let anchors = vec![
            anchor(100, 0, 0.0),
            anchor(200, 0, 0.1),
            anchor(250, 0, 0.1),
            anchor(300, 1, 0.2),
            anchor(390, 1, 0.2),
            anchor(400, 2, 0.3),
        ];
        PlacedCorrections {
            corrections: Corrections::new(anchors),
            placed: BTreeSet::from([0, 2]),
        }
    }

    #[test]
    fn a_message_has_the_same_corrections_where_the_place_is_known() {
        let sent = placed();
        let (read, odom) = PlacedCorrections::read(&sent.message("map", "odom"), "map").unwrap();
        assert_eq!(odom, "odom");
        for stamp_ns in (0..600).step_by(10) {
            match (sent.map_from_odom(stamp_ns), read.map_from_odom(stamp_ns)) {
                (Some(a), Some(b)) => {
                    let apart = (a.inverse() * b).translation.vector.norm();
                    assert!(apart < 1e-12, "{stamp_ns}: {apart}");
                }
                (a, b) => assert_eq!((a, b), (None, None), "{stamp_ns}"),
            }
        }
        assert_eq!(sent.map_from_odom(310), None);
        assert!(sent.map_from_odom(i64::MAX).is_some());
    }

    #[test]
    fn hostile_corrections_are_refused() {
        let good = placed().message("map", "odom");
        let read = |change: &dyn Fn(&mut TFMessage)| {
            let mut message = good.clone();
            change(&mut message);
            PlacedCorrections::read(&message, "map").map(drop)
        };
        assert_eq!(read(&|_| {}), Ok(()));
        assert_eq!(
            read(&|m| m.transforms.clear()),
            Err(CorrectionsError::Number(0))
        );
        let many = &|m: &mut TFMessage| {
            let one = m.transforms[0].clone();
            m.transforms = vec![one; MAX_ANCHORS + 1];
        };
        assert_eq!(read(many), Err(CorrectionsError::Number(MAX_ANCHORS + 1)));
        let other = &|m: &mut TFMessage| m.transforms[2].child_frame_id = "wheels".into();
        assert!(matches!(read(other), Err(CorrectionsError::Frames { .. })));
        for value in [f64::NAN, f64::INFINITY] {
            let moved = &|m: &mut TFMessage| m.transforms[3].transform.translation.x = value;
            assert_eq!(read(moved), Err(CorrectionsError::Pose(3)));
        }
        let back = &|m: &mut TFMessage| m.transforms.swap(1, 4);
        assert_eq!(read(back), Err(CorrectionsError::Order(2)));
    }
}
