//! Check of stamps and mounts against the poses, on the first minute of a log and before it is mapped.

use lattice_bag::BagReader;
use lattice_core::registration::mounts::{
    MAX_DELAY_S, MountError, MountEstimate, MountNumber, MountOptions, check_mount,
};
use lattice_nodes::replay::{self, Slice, TopicPlan};

use super::Replay;
use crate::CliResult;
use crate::progress::Progress;

/// Part of a log that is read, s.
pub const CHECK_S: f64 = 60.0;
/// Most points that are used.
pub const CHECK_POINTS: usize = 80_000;
/// Most sensors that are checked one by one.
const MAX_SENSORS: usize = 8;
/// Least time offset that is called wrong, seconds.
pub const WRONG_S: f64 = 0.005;
/// Least corrections that are called wrong: degrees, metres and seconds.
const WRONG: [f64; 3] = [0.3, 0.05, WRONG_S];
/// Standard deviations above which a correction is significant.
const SIGNIFICANT: f64 = 3.0;

/// Correction of a mount or of stamps with which a log fits better.
#[derive(Clone, Debug, PartialEq)]
pub struct Better {
    /// The correction, as in "2.9 degrees better if turned about z".
    pub text: String,
    /// Time to add to those of the clouds, if it is the correction, s.
    pub offset_s: Option<f64>,
}

impl Better {
    /// The largest significant correction, of its least one that matters; `None` if the stated mount fits.
    pub fn of(estimate: &MountEstimate) -> Option<Better> {
        // As shown: degrees, metres, seconds.
        let scale = |at: usize| if at < 3 { 1_f64.to_degrees() } else { 1.0 };
        let size = |at: usize, number: &MountNumber| {
            let least = WRONG.get(at / 3).copied().unwrap_or(f64::INFINITY);
            (number.value * scale(at)).abs() / least
        };
        let numbers = estimate.numbers.iter().enumerate();
        let wrong = numbers.filter(|(at, number)| {
            let is_significant = number.value.abs() > SIGNIFICANT * number.sigma;
            number.is_observable && is_significant && size(*at, number) > 1.0
        });
        let (at, number) = wrong.max_by(|(a, x), (b, y)| size(*a, x).total_cmp(&size(*b, y)))?;
        let by = number.value * scale(at);
        let axis = ["x", "y", "z"].get(at % 3).copied().unwrap_or_default();
        Some(match at {
            0..3 => Better {
                text: format!("{:.1} degrees better if turned about {axis}", by.abs()),
                offset_s: None,
            },
            3..6 => Better {
                text: format!("{:.2} m better if moved along {axis}", by.abs()),
                offset_s: None,
            },
            _ => Self::of_offset(by),
        })
    }

    fn of_offset(by_s: f64) -> Better {
        let way = if by_s > 0.0 { "later" } else { "earlier" };
        // A clock differs by whole seconds where it is known to tenths alone.
        let shown_s = match (by_s - by_s.round()).abs() < 0.05 && by_s.abs() > MAX_DELAY_S {
            true => by_s.round(),
            false => (by_s * 1e3).round() * 1e-3,
        };
        let text = format!(
            "{:.3} s better if stamped {way} (`time.offset_s: {shown_s}`)",
            by_s.abs()
        );
        Better {
            text,
            offset_s: Some(by_s),
        }
    }
}

impl Replay {
    /// Corrections with which the first minute fits better, each said at once.
    pub(super) fn checked_poses(
        &self,
        bag: &BagReader,
        plan: &TopicPlan,
    ) -> CliResult<Vec<String>> {
        let notes = self.check_poses(bag, plan)?;
        notes.iter().for_each(|note| log::warn!("{note}"));
        Ok(notes)
    }

    /// Corrections with which the first minute fits better, for the report; stops where stamps are of another clock.
    ///
    /// # Errors
    /// If the log cannot be read, or if clouds and poses have different clocks.
    fn check_poses(&self, bag: &BagReader, plan: &TopicPlan) -> CliResult<Vec<String>> {
        if self.trust_stamps || plan.odometry.is_some() || !plan.cameras.is_empty() {
            return Ok(Vec::new());
        }
        let from_s = self.slice().from_s;
        let slice = Slice {
            from_s,
            to_s: self.slice().to_s.min(from_s + CHECK_S),
        };
        let transformer = self.transformer(plan)?;
        let progress = Progress::new("check");
        let tell = &mut |done| progress.set(done);
        // The replay itself warns of what it leaves out.
        let level = log::max_level();
        log::set_max_level(log::LevelFilter::Off);
        let found = replay::mount_samples(bag, plan, &slice, transformer, CHECK_POINTS, tell);
        log::set_max_level(level);
        progress.done();
        let (log, _) = found?;
        let options = MountOptions::default();
        let log_name = self.bag.display();
        let remedy =
            |topic: &str| format!("`lattice calibrate mounts {log_name} --points {topic}`");
        let [degrees, least_m, least_s] = WRONG;
        let least = [degrees.to_radians(), least_m, least_s];
        let better = match check_mount(&log.samples, &options, least) {
            Ok(estimate) => estimate.as_ref().and_then(Better::of),
            Err(MountError::Stamps { offset_s }) => Some(Better::of_offset(offset_s)),
            // Too little to judge by: no alarm.
            Err(_) => None,
        };
        let all: Vec<&str> = log
            .mounts
            .iter()
            .map(|mount| mount.topic.as_str())
            .collect();
        if let Some(better) = better {
            if better.offset_s.is_some_and(|by_s| by_s.abs() > MAX_DELAY_S) {
                return Err(format!(
                    "the clocks of clouds and poses differ: clouds fit {} (no map was written; --trust-stamps writes it)",
                    better.text
                )
                .into());
            }
            let text = &better.text;
            return Ok(vec![format!(
                "clouds fit {text}: {}",
                remedy(&all.join(" --points "))
            )]);
        }
        if all.len() < 2 {
            return Ok(Vec::new());
        }
        let alone = MountOptions {
            with_time: false,
            ..options
        };
        let sensors = log.mounts.iter().enumerate().take(MAX_SENSORS);
        let found = sensors.filter_map(|(sensor, mount)| {
            let checked = check_mount(&log.of_sensor(sensor), &alone, least).ok()?;
            let Better { text, .. } = Better::of(&checked?)?;
            let topic = &mount.topic;
            Some(format!("clouds of {topic} fit {text}: {}", remedy(topic)))
        });
        Ok(found.collect())
    }
}
