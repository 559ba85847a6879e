//! Surveys: the loader's scans as one cloud in the map frame, as a mapper receives them.
//!
//! The points carry range noise and the pose errors of the INS; the pose between two epochs of the INS has
//! their interpolated errors. Each scan says where its scanner was, for free space.

use super::bobcat::{Bobcat, Laser, MAX_DURATION_S, SimulationError};
use super::ins_error::InsErrors;
use super::lms200::{SCAN_RATE_HZ, SCAN_SPAN_NS};
use super::random::{Purpose, Stream};
use super::spin64::{self, COLUMNS, TURN_NS};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use rayon::prelude::*;
use std::collections::VecDeque;

/// The 64-beam scanner stands on the roof, level, m.
const BASE_FROM_SPIN64_M: [f64; 3] = [-0.20, 0.0, 2.45];
/// The first turn: the loader leaves the pit for its round of the site, ns.
const SPIN64_START_NS: i64 = 150_000_000_000;
/// Scans computed at a time.
const LMS200_BATCH: u64 = 3 * 1024;
const SPIN64_BATCH: u64 = 16;

/// Scanners that measure the site.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurveyPattern {
    /// Two SICK LMS200 at the sides and one on a turntable: 75 scans of 181 beams a second each.
    Lms200,
    /// A spinning scanner of 64 beams and 1024 columns, ten turns a second.
    Os64,
}

impl SurveyPattern {
    /// Scans of all scanners in a second.
    pub fn scans_per_s(self) -> f64 {
        match self {
            Self::Lms200 => (3 * SCAN_RATE_HZ) as f64,
            Self::Os64 => 1e9 / TURN_NS as f64,
        }
    }
}

/// One scan of a survey.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveyScan {
    /// Measured position of the scanner in the middle of the scan, map frame, m.
    pub origin_m: Vector3<f64>,
    /// East, north, up (m, map frame) and intensity (0..255) of each return.
    pub points: Vec<[f32; 4]>,
}

/// A survey of the earth-moving site; the seed sets all noise.
#[derive(Clone, Debug)]
pub struct Survey {
    bobcat: Bobcat,
    pattern: SurveyPattern,
}

impl Survey {
    /// A survey with the longest duration; take as many scans as needed.
    pub fn new(seed: u64, pattern: SurveyPattern) -> Result<Self, SimulationError> {
        let bobcat = Bobcat::new(seed, MAX_DURATION_S)?;
        Ok(Self { bobcat, pattern })
    }

    /// All scans in the order of their starts, computed ahead in parallel on the current rayon pool.
    /// The scans do not depend on the number of threads.
    pub fn scans(&self) -> SurveyScans<'_> {
        SurveyScans {
            survey: self,
            errors: InsErrors::new(&self.bobcat),
            directions: spin64::directions(),
            next: 0,
            ready: VecDeque::new(),
        }
    }

    /// Number of scans before the end.
    fn count(&self) -> u64 {
        match self.pattern {
            SurveyPattern::Lms200 => {
                let counts = Laser::ALL.map(|laser| self.bobcat.scan_count(laser));
                3 * counts.into_iter().min().unwrap_or(0)
            }
            SurveyPattern::Os64 => {
                u64::try_from((self.bobcat.end_ns() - SPIN64_START_NS) / TURN_NS)
                    .map_or(0, |turns| turns.saturating_sub(1))
            }
        }
    }

    /// Start of scan `index`, ns.
    fn start_ns(&self, index: u64) -> i64 {
        match self.pattern {
            SurveyPattern::Lms200 => {
                let (laser, turn) = laser_of(index);
                self.bobcat.scan_start_ns(laser, turn)
            }
            SurveyPattern::Os64 => {
                let turns = i64::try_from(index).unwrap_or(i64::MAX);
                turns
                    .saturating_mul(TURN_NS)
                    .saturating_add(SPIN64_START_NS)
            }
        }
    }

    fn lms200(&self, index: u64, errors: &InsErrors) -> SurveyScan {
        let (laser, turn) = laser_of(index);
        let scan = self.bobcat.scan(laser, turn);
        let error = errors.at(scan.start_ns + SCAN_SPAN_NS / 2);
        // The machine hardly moves in 7 ms: half-way between two poses is exact to micrometres.
        let ends = [scan.start_ns, scan.start_ns + SCAN_SPAN_NS]
            .map(|time_ns| error.apply(&self.bobcat.map_from_base(time_ns)));
        let map_from_laser = |offset_ns: i64| {
            let share = offset_ns as f64 / SCAN_SPAN_NS as f64;
            let time_ns = scan.start_ns + offset_ns;
            between(&ends, share) * self.bobcat.base_from_laser(laser, time_ns)
        };
        let points = scan.returns.iter().map(|r| {
            let in_laser = Point3::from(r.point_m.map(f64::from));
            let p = map_from_laser(i64::from(r.offset_ns)) * in_laser;
            [p.x as f32, p.y as f32, p.z as f32, r.intensity]
        });
        SurveyScan {
            points: points.collect(),
            origin_m: map_from_laser(SCAN_SPAN_NS / 2).translation.vector,
        }
    }

    fn spin64(
        &self,
        index: u64,
        directions: &[[Vector3<f64>; 64]],
        errors: &InsErrors,
    ) -> SurveyScan {
        let mut noise = Stream::new(self.bobcat.seed(), Purpose::SpinRange, 0, index);
        let mount = Isometry3::from(Vector3::from(BASE_FROM_SPIN64_M));
        let start_ns = self.start_ns(index);
        let mut points = Vec::with_capacity(COLUMNS * 40);
        for (column, directions) in directions.iter().enumerate() {
            let time_ns = start_ns + spin64::column_offset_ns(column);
            let truth = self.bobcat.map_from_base(time_ns);
            let map_from_base = errors.at(time_ns).apply(&truth);
            let measured = map_from_base * mount;
            spin64::column(
                self.bobcat.site(),
                directions,
                &(truth * mount),
                &mut noise,
                |in_scanner| self.bobcat.own_body_m(&mount, in_scanner),
                |(in_scanner, intensity)| {
                    let p = measured * Point3::from(in_scanner);
                    points.push([p.x as f32, p.y as f32, p.z as f32, intensity as f32]);
                },
            );
        }
        let middle_ns = start_ns + TURN_NS / 2;
        let truth = self.bobcat.map_from_base(middle_ns);
        let middle = errors.at(middle_ns).apply(&truth) * mount;
        SurveyScan {
            origin_m: middle.translation.vector,
            points,
        }
    }
}

/// Scans of the three scanners take turns.
fn laser_of(index: u64) -> (Laser, u64) {
    let laser = match index % 3 {
        0 => Laser::Left,
        1 => Laser::Right,
        _ => Laser::Top,
    };
    (laser, index / 3)
}

/// The scans of a [`Survey`].
#[derive(Debug)]
pub struct SurveyScans<'a> {
    survey: &'a Survey,
    errors: InsErrors<'a>,
    directions: Vec<[Vector3<f64>; 64]>,
    next: u64,
    ready: VecDeque<SurveyScan>,
}

impl SurveyScans<'_> {
    fn compute_more(&mut self) {
        let survey = self.survey;
        let batch = match survey.pattern {
            SurveyPattern::Lms200 => LMS200_BATCH,
            SurveyPattern::Os64 => SPIN64_BATCH,
        };
        let end = (self.next + batch).min(survey.count());
        if end <= self.next {
            return;
        }
        let longest_ns = SCAN_SPAN_NS.max(TURN_NS);
        self.errors.cover(
            survey.start_ns(self.next),
            survey.start_ns(end - 1) + longest_ns,
        );
        let errors = &self.errors;
        let scans = (self.next..end)
            .into_par_iter()
            .map(|i| match survey.pattern {
                SurveyPattern::Lms200 => survey.lms200(i, errors),
                SurveyPattern::Os64 => survey.spin64(i, &self.directions, errors),
            });
        self.ready = scans.collect::<Vec<_>>().into();
        self.next = end;
    }
}

impl Iterator for SurveyScans<'_> {
    type Item = SurveyScan;

    fn next(&mut self) -> Option<SurveyScan> {
        if self.ready.is_empty() {
            self.compute_more();
        }
        self.ready.pop_front()
    }
}

fn between([a, b]: &[Isometry3<f64>; 2], share: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(a.translation.vector.lerp(&b.translation.vector, share)),
        a.rotation.nlerp(&b.rotation, share),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Root mean square distance of the points of some scans from the true surfaces, and their mean range, m.
    fn distance_and_range_m(pattern: SurveyPattern, scans: usize) -> (f64, f64) {
        let survey = Survey::new(2, pattern).unwrap();
        let (mut squares_m2, mut ranges_m, mut n) = (0.0, 0.0, 0.0);
        for scan in survey.scans().take(scans).step_by(13) {
            for point in scan.points.iter().step_by(7) {
                let [x, y, z, intensity] = point.map(f64::from);
                assert!((0.0..=255.0).contains(&intensity));
                let p = Vector3::new(x, y, z);
                squares_m2 += survey.bobcat.site().surface_distance_m(&p).powi(2);
                ranges_m += (p - scan.origin_m).norm();
                n += 1.0;
            }
        }
        ((squares_m2 / n).sqrt(), ranges_m / n)
    }

    #[test]
    fn points_lie_about_the_surfaces_by_the_noise_of_range_and_pose() {
        for (pattern, scans, range_m) in [
            (SurveyPattern::Lms200, 6000, 3.5..6.5),
            (SurveyPattern::Os64, 27, 15.0..24.0),
        ] {
            let (distance_m, mean_m) = distance_and_range_m(pattern, scans);
            assert!((0.005..0.03).contains(&distance_m), "{distance_m}");
            assert!(range_m.contains(&mean_m), "{pattern:?}: {mean_m} m");
        }
    }

    #[test]
    fn scans_follow_each_other_without_gaps() {
        let survey = Survey::new(1, SurveyPattern::Lms200).unwrap();
        let starts: Vec<i64> = (0..300).map(|i| survey.start_ns(i)).collect();
        let mut steps = starts.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(steps.all(|step| (4_000_000..5_000_000).contains(&step)));
        // A batch and a bit: the order of the scans is that of their numbers.
        let ahead: Vec<SurveyScan> = survey.scans().take(LMS200_BATCH as usize + 2).collect();
        let mut errors = InsErrors::new(&survey.bobcat);
        let last = LMS200_BATCH + 1;
        errors.cover(0, survey.start_ns(last) + TURN_NS);
        assert_eq!(ahead.last(), Some(&survey.lms200(last, &errors)));
    }
}
