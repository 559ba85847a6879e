//! Positions of a receiver paired with the attitudes of an Imu.

use std::collections::VecDeque;

use lattice_core::geodesy::{EnuFrame, Geodetic};
use lattice_core::pose::{PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::ins::{Body, BodyPose};

/// Most fixes that wait for the attitude at their stamp.
const MAX_WAITING_FIXES: usize = 64;
/// Most attitudes kept.
const MAX_ATTITUDES: usize = 4096;
/// Time for which attitudes are kept beyond the longest gap between fixes, s.
const MARGIN_S: f64 = 2.0;

/// A position of the antenna.
pub(super) struct Fix {
    pub stamp_ns: i64,
    pub place: Geodetic,
    pub antenna: Body,
}

/// An attitude against the local level (east, north, up).
pub(super) struct Attitude {
    pub stamp_ns: i64,
    pub level_from_imu: UnitQuaternion<f64>,
    pub imu: Body,
}

/// Pairs fixes with the attitudes at their stamps, and gives each attitude between two fixes the
/// position on the straight line between them.
pub(super) struct FixPairing {
    attitudes: PoseBuffer,
    imu: Body,
    fixes: VecDeque<Fix>,
    /// Stamp and position in the map of the last fix that was paired.
    last: Option<(i64, Vector3<f64>)>,
    max_fix_gap_ns: i64,
}

impl FixPairing {
    pub fn new(max_imu_gap_s: f64, max_fix_gap_s: f64) -> Self {
        Self {
            attitudes: PoseBuffer::new(PoseBufferOptions {
                span_s: max_fix_gap_s + MARGIN_S,
                max_gap_s: max_imu_gap_s,
                max_poses: MAX_ATTITUDES,
                jump_back_s: 1.0,
            }),
            imu: Body::ins(""),
            fixes: VecDeque::new(),
            last: None,
            max_fix_gap_ns: (max_fix_gap_s * 1e9) as i64,
        }
    }

    pub fn push_fix(&mut self, fix: Fix) {
        if self.fixes.len() >= MAX_WAITING_FIXES {
            self.fixes.pop_front();
        }
        self.fixes.push_back(fix);
    }

    pub fn push_attitude(&mut self, attitude: Attitude) {
        let stamp_ns = attitude.stamp_ns;
        self.imu = attitude.imu;
        let outcome = self.attitudes.push(StampedPose {
            stamp_ns,
            map_from_base: Isometry3::from_parts(Translation3::identity(), attitude.level_from_imu),
        });
        if outcome == PushOutcome::JumpedBack {
            self.fixes.retain(|fix| fix.stamp_ns <= stamp_ns);
            self.last = None;
        }
    }

    /// Poses of the fixes whose attitude is known by now, and of the attitudes before them, in order.
    ///
    /// The first fix makes the map frame where there is none.
    pub fn poses(&mut self, frame: &mut Option<EnuFrame>) -> Vec<BodyPose> {
        let mut poses = Vec::new();
        while let Some(fix) = self.fixes.front() {
            match self.attitudes.at(fix.stamp_ns) {
                Ok(attitude) => {
                    let frame = frame.get_or_insert_with(|| EnuFrame::new(fix.place));
                    let enu_from_level = frame.enu_from_local_level(&fix.place);
                    let position_m = frame.enu_from_geodetic(&fix.place);
                    let pose = |stamp_ns, position_m: Vector3<f64>, rotation| BodyPose {
                        stamp_ns,
                        reference: None,
                        pose: Isometry3::from_parts(position_m.into(), enu_from_level * rotation),
                        position_of: fix.antenna.clone(),
                        attitude_of: self.imu.clone(),
                    };
                    let near = self.last.filter(|(last_ns, _)| {
                        let gap_ns = fix.stamp_ns.saturating_sub(*last_ns);
                        (1..=self.max_fix_gap_ns).contains(&gap_ns)
                    });
                    if let Some((last_ns, last_m)) = near {
                        let gap_ns = (fix.stamp_ns - last_ns) as f64;
                        let between = self.attitudes.between(last_ns, fix.stamp_ns);
                        poses.extend(between.map(|attitude| {
                            let part = (attitude.stamp_ns - last_ns) as f64 / gap_ns;
                            let position_m = last_m.lerp(&position_m, part);
                            let rotation = attitude.map_from_base.rotation;
                            pose(attitude.stamp_ns, position_m, rotation)
                        }));
                    }
                    poses.push(pose(fix.stamp_ns, position_m, attitude.rotation));
                    self.last = Some((fix.stamp_ns, position_m));
                }
                Err(PoseMiss::Empty | PoseMiss::AfterEnd { .. }) => break,
                Err(PoseMiss::BeforeStart { .. } | PoseMiss::Gap { .. }) => {}
            }
            self.fixes.pop_front();
        }
        poses
    }
}
