//! The place of the frame of an odometry in the map, over time.

use nalgebra::Isometry3;

use super::middle_ns;
use crate::odometry::ScanResult;
use crate::pose::se3;

/// Correction of odometry poses at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Anchor {
    /// Time, ns.
    pub stamp_ns: i64,
    /// Number of the submap of the odometry. The relative pose of two submaps is unknown without a loop.
    pub submap: u32,
    /// Pose of the odometry frame in the map.
    pub map_from_odom: Isometry3<f64>,
}

/// Corrections of the poses of a drive. They are interpolated between two anchors of a submap; at other times, the
/// anchor before applies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Corrections {
    anchors: Vec<Anchor>,
}

impl Corrections {
    /// Creates corrections from anchors in any order.
    pub fn new(mut anchors: Vec<Anchor>) -> Corrections {
        anchors.sort_by_key(|anchor| anchor.stamp_ns);
        Corrections { anchors }
    }

    /// Anchors in order of time.
    pub fn anchors(&self) -> &[Anchor] {
        &self.anchors
    }

    /// Begins a submap halfway between the end of the last scan of the submap before (`end_ns`) and its first point
    /// (`begin_ns`); the first submap at `begin_ns`. Until a loop is known, it has the pose of the submap before.
    pub fn begin_submap(&mut self, submap: u32, end_ns: i64, begin_ns: i64) {
        let Some(last) = self.anchors.last().cloned() else {
            self.anchors.push(Anchor {
                stamp_ns: begin_ns,
                submap,
                map_from_odom: Isometry3::identity(),
            });
            return;
        };
        self.anchors.push(Anchor {
            stamp_ns: end_ns.max(last.stamp_ns),
            ..last
        });
        self.anchors.push(Anchor {
            stamp_ns: middle_ns(end_ns, begin_ns).max(last.stamp_ns),
            submap,
            ..last
        });
    }

    /// Correction at a time; `None` without anchors.
    pub fn at(&self, stamp_ns: i64) -> Option<Anchor> {
        let next = self
            .anchors
            .partition_point(|anchor| anchor.stamp_ns <= stamp_ns);
        let of = |number: usize| self.anchors.get(number);
        let (before, after) = (next.checked_sub(1).and_then(of), of(next));
        let Some(before) = before else {
            return after.cloned();
        };
        let Some(after) = after.filter(|after| after.submap == before.submap) else {
            return Some(before.clone());
        };
        // In floating point: hostile stamps lie any distance apart.
        let span_ns = (after.stamp_ns as f64 - before.stamp_ns as f64).max(1.0);
        let part = (stamp_ns as f64 - before.stamp_ns as f64) / span_ns;
        let twist = se3::log(&(before.map_from_odom.inverse() * after.map_from_odom));
        let moved = se3::exp(&(twist * part.clamp(0.0, 1.0)));
        Some(Anchor {
            stamp_ns,
            submap: before.submap,
            map_from_odom: before.map_from_odom * moved,
        })
    }

    /// Pose of a scan in the map; its odometry pose without anchors.
    pub fn map_from_base(&self, scan: &ScanResult) -> Isometry3<f64> {
        match self.at(scan.end_ns) {
            Some(anchor) => anchor.map_from_odom * scan.odom_from_base,
            None => scan.odom_from_base,
        }
    }
}
