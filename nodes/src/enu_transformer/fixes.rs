//! Positions of a GNSS receiver paired with attitudes of an Imu.

use std::collections::VecDeque;

use lattice_core::geodesy::{EnuFrame, Geodetic, ecef_from_geodetic};
use lattice_core::pose::{PoseBuffer, PoseBufferOptions, PoseMiss, StampedPose};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::body_pose::{Body, BodyPose};
use super::ins_options::InsOptions;
use super::ins_refusal::InsRefusal;
use super::speed_gate::{Placed, SpeedGate, TooFast};
use super::stamp_order::{Refused, StampOrder};

/// Limit of fixes without attitude.
const MAX_WAITING_FIXES: usize = 64;
/// Limit of stored attitudes.
const MAX_ATTITUDES: usize = 4096;
/// Time for which attitudes are kept beyond the longest gap between fixes, s.
const MARGIN_S: f64 = 2.0;

/// Position of the antenna.
#[derive(Clone, Debug)]
pub(super) struct Fix {
    pub stamp_ns: i64,
    pub place: Geodetic,
    pub antenna: Body,
}

/// Attitude relative to the local level (east, north, up).
#[derive(Clone, Debug)]
pub(super) struct Attitude {
    pub stamp_ns: i64,
    pub level_from_imu: UnitQuaternion<f64>,
    pub imu: Body,
}

/// Pairs fixes with the attitudes at their stamps, and interpolates positions linearly at the stamps of
/// attitudes between two fixes.
pub(super) struct FixPairing {
    attitudes: PoseBuffer,
    attitude_order: StampOrder<Attitude>,
    fix_order: StampOrder<Fix>,
    speed: SpeedGate<Fix>,
    imu: Body,
    fixes: VecDeque<Fix>,
    /// Stamp and map position of the last paired fix.
    last: Option<(i64, Vector3<f64>)>,
    max_imu_gap_ns: i64,
    max_fix_gap_ns: i64,
    /// Rejected fixes and attitudes since the last query.
    refused: Vec<InsRefusal>,
}

impl FixPairing {
    pub fn new(options: &InsOptions) -> Self {
        let (max_imu_gap_s, max_fix_gap_s) = (options.max_imu_gap_s, options.max_fix_gap_s);
        let span_s = max_fix_gap_s + MARGIN_S;
        let ahead_ns = options.ahead_ns;
        Self {
            attitudes: PoseBuffer::new(PoseBufferOptions {
                span_s,
                max_gap_s: max_imu_gap_s,
                max_poses: MAX_ATTITUDES,
                ..PoseBufferOptions::default()
            }),
            attitude_order: StampOrder::new(ahead_ns),
            fix_order: StampOrder::new(ahead_ns),
            speed: SpeedGate::new(options.max_speed_m_per_s, options.settle_ns),
            imu: Body::ins(""),
            fixes: VecDeque::new(),
            last: None,
            max_imu_gap_ns: ns(max_imu_gap_s),
            max_fix_gap_ns: ns(max_fix_gap_s),
            refused: Vec::new(),
        }
    }

    pub fn push_fix(&mut self, fix: Fix) {
        let decision = self.fix_order.push(fix.stamp_ns, fix);
        self.refuse(&decision.refused);
        if decision.is_clock_set {
            self.fixes.clear();
            self.last = None;
            self.speed.clear();
        }
        for (stamp_ns, fix) in decision.taken {
            let passed = self.speed.push(Placed {
                stamp_ns,
                position_m: ecef_from_geodetic(&fix.place),
                item: fix,
            });
            let max_speed_m_per_s = self.speed.max_speed_m_per_s();
            let too_fast = |step: &TooFast| InsRefusal::too_fast(step, max_speed_m_per_s);
            self.refused.extend(passed.refused.iter().map(too_fast));
            if let Some(step) = passed.jump {
                self.last = None;
                self.refused.push(InsRefusal::jump(&step));
            }
            for placed in passed.taken {
                if self.fixes.len() >= MAX_WAITING_FIXES {
                    self.fixes.pop_front();
                }
                self.fixes.push_back(placed.item);
            }
        }
    }

    pub fn push_attitude(&mut self, attitude: Attitude) {
        let decision = self.attitude_order.push(attitude.stamp_ns, attitude);
        self.refuse(&decision.refused);
        if decision.is_clock_set {
            self.attitudes.clear();
            self.last = None;
            if let Some((newest_ns, _)) = decision.taken.last() {
                let latest_ns = newest_ns.saturating_add(self.max_imu_gap_ns);
                self.fixes.retain(|fix| fix.stamp_ns <= latest_ns);
            }
        }
        for (stamp_ns, attitude) in decision.taken {
            self.imu = attitude.imu;
            let rotation = attitude.level_from_imu;
            self.attitudes.insert(StampedPose {
                stamp_ns,
                map_from_base: Isometry3::from_parts(Translation3::identity(), rotation),
            });
        }
    }

    /// Rejected fixes and attitudes since the last call.
    pub fn take_refused(&mut self) -> Vec<InsRefusal> {
        std::mem::take(&mut self.refused)
    }

    fn refuse(&mut self, refused: &[Refused]) {
        self.refused
            .extend(refused.iter().map(|stamp| InsRefusal::Stamp(*stamp)));
    }

    /// Poses of paired fixes, and of the attitudes before them, in order.
    ///
    /// The first fix defines the map frame if there is none.
    pub fn poses(&mut self, frame: &mut Option<EnuFrame>) -> Vec<BodyPose> {
        let mut poses = Vec::new();
        // Fixes and attitudes of different clocks are not paired.
        if self.fix_order.is_open() || self.attitude_order.is_open() {
            return poses;
        }
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

fn ns(seconds: f64) -> i64 {
    (seconds * 1e9) as i64
}
