//! Odometry over the clouds of a log, against a trajectory in a TUM file.

use std::path::PathBuf;

use lattice_bag::BagReader;
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lidar_odometry::{DriveLoops, LidarOdometry, LidarOdometryOptions};
use lattice_nodes::replay::{OdometryInput, TopicWishes, feed_odometry, plan};

use super::loops::LoopTrial;
use super::measurement::{Measurement, OdometryTrial};
use super::report::report_of;
use crate::bench::timed;
use crate::poses::read_tum;
use crate::report::Report;
use crate::{AnyError, at};

/// A log with its truth.
#[derive(Clone, Debug)]
pub struct OdometryLog {
    /// rosbag2 directory.
    pub log: PathBuf,
    /// TUM file with the true poses of the frame that odometry has poses of.
    pub truth: PathBuf,
    /// Topic of the clouds; `None`: as in a replay.
    pub points: Option<String>,
}

/// Runs the odometry of a replay over the clouds of a log, and measures it. Poses that the log has are not used.
///
/// # Errors
/// Names a truth that is no TUM file or has no pose at the time of any scan, and a log without usable clouds.
pub fn measure_log(
    of: &OdometryLog,
    progress: &mut dyn FnMut(f64),
) -> Result<(OdometryTrial, Report), AnyError> {
    let truth = read_tum(&of.truth)?;
    let bag = BagReader::open(&of.log)?.past_cut();
    let wishes = TopicWishes {
        points: of.points.iter().cloned().collect(),
        lidar_odometry: true,
        ..TopicWishes::default()
    };
    let plan = plan(&bag, &wishes)?;
    let topic = plan.odometry.ok_or("no topic of clouds")?;
    let name = bag.topics().get(topic).map_or("", |topic| &topic.name);
    let mut transformer = TransformerOptions::new(plan.source);
    transformer.map_frame.clone_from(&plan.map_frame);
    transformer.base_frame.clone_from(&plan.base_frame);
    let mut machine = LidarOdometry::new(LidarOdometryOptions::of(&transformer));

    let mut measurement = Measurement::default();
    // Times of the scans, and the number of those with a truth.
    let (mut span_ns, mut known) = (None, 0);
    let (mut loops, mut loops_s) = (DriveLoops::default(), 0.0);
    let on_input = &mut |machine: &mut LidarOdometry, input: OdometryInput| {
        let refused = machine.counts().clouds_refused();
        let (found, spent) = timed(|| input.give(machine));
        measurement.spend(spent);
        for _ in refused..machine.counts().clouds_refused() {
            measurement.add(None);
        }
        for found in found {
            let ((), spent) = timed(|| loops.add(&found));
            loops_s += spent.cpu_s;
            let result = found.result;
            let (first_ns, _) = span_ns.unwrap_or((result.end_ns, result.end_ns));
            span_ns = Some((first_ns, result.end_ns));
            let truth = truth.at(result.end_ns).ok();
            known += u64::from(truth.is_some());
            measurement.add(Some((result, truth)));
        }
    };
    let (start_ns, end_ns) = (bag.start_ns().unwrap_or(0), bag.end_ns().unwrap_or(0));
    let all_ns = end_ns.saturating_sub(start_ns).max(1) as f64;
    let told = &mut |time_ns: i64| progress(time_ns.saturating_sub(start_ns) as f64 / all_ns);
    feed_odometry(&bag, &plan, topic, &mut machine, on_input, told)?;

    let Some((first_ns, last_ns)) = span_ns else {
        let why = machine
            .refusals()
            .first()
            .map_or("it has none", |refusal| &refusal.text);
        return Err(at(&of.log)(format!("no cloud of {name} has a pose: {why}")));
    };
    if known == 0 {
        let [first, last] = [first_ns, last_ns].map(seconds);
        let [from, to] = [truth.oldest_ns(), truth.newest_ns()].map(|ns| seconds(ns.unwrap_or(0)));
        let why = format!(
            "has poses from {from} to {to} s, and none within 0.25 s around the scans of {name}, \
             from {first} to {last} s; give the truth in the clock of the scans"
        );
        return Err(at(&of.truth)(why));
    }
    let (loops, spent) = timed(|| loops.finish(&mut machine));
    let loops_s = loops_s + spent.cpu_s;
    measurement.trial.loops = LoopTrial::of(&loops, &measurement.found, loops_s);
    let log = of.log.file_name().unwrap_or(of.log.as_os_str());
    let trial = OdometryTrial {
        scene: log.to_string_lossy().into_owned(),
        ..measurement.finish()
    };
    let OdometryTrial {
        without_truth,
        refused,
        scans,
        ..
    } = trial;
    let lead = format!(
        "Scans of {name} in {}, poses of {} against {}. Of {scans} scans, {refused} are refused, and {without_truth} are OK \
         at times without a truth, which is not measured.",
        of.log.display(),
        plan.base_frame,
        of.truth.display(),
    );
    let report = report_of(&lead, std::slice::from_ref(&trial));
    Ok((trial, report))
}

fn seconds(ns: i64) -> String {
    format!(
        "{}.{:03}",
        ns.div_euclid(1_000_000_000),
        ns.rem_euclid(1_000_000_000) / 1_000_000
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::datasets::{DriveLogOptions, TRUTH_FILE, write_drive};
    use crate::simulate::drive::{Drive, DriveScene};

    /// A log of some seconds.
    fn log(folder: &std::path::Path, duration_s: f64) -> OdometryLog {
        let out = folder.join("log");
        let options = DriveLogOptions {
            out: out.clone(),
            overwrite: false,
            scene: DriveScene::Indoor,
            seed: 3,
            duration_s: Some(duration_s),
        };
        let summary = write_drive(&options, &mut |_| {}).unwrap();
        assert_eq!(summary.scans, (duration_s * 10.0).round() as u64);
        assert_eq!(summary.truth, out.join(TRUTH_FILE));
        let again = write_drive(&options, &mut |_| {}).unwrap_err().to_string();
        assert!(again.contains("overwrite"), "{again}");
        OdometryLog {
            log: out,
            truth: summary.truth,
            points: None,
        }
    }

    #[test]
    fn a_log_is_measured_as_the_drive_that_it_is_of() {
        let folder = tempfile::tempdir().unwrap();
        let of = log(folder.path(), 4.0);
        let (measured, report) = measure_log(&of, &mut |_| {}).unwrap();
        let mut drive = Measurement::default();
        let simulated = Drive::new(DriveScene::Indoor, 3);
        drive.drive(&simulated, 40).unwrap();
        let expected = drive.finish();
        let verdicts = |t: &OdometryTrial| [t.scans, t.ok, t.weak, t.lost, t.submaps, t.refused];
        assert_eq!(verdicts(&measured), verdicts(&expected));
        assert!(measured.ok > 20, "{measured:?}");
        // Points of the log are in single precision.
        assert!(
            (measured.ate_m - expected.ate_m).abs() < 1e-3,
            "{measured:?}, {expected:?}"
        );
        assert_eq!(measured.without_truth, 0);
        assert!(crate::markdown(&report).contains("| log | 1 |"));

        // A part of the truth.
        let text = fs::read_to_string(&of.truth).unwrap();
        let part: String = text
            .lines()
            .skip(250)
            .map(|line| format!("{line}\n"))
            .collect();
        let truth = folder.path().join("part.tum");
        fs::write(&truth, part).unwrap();
        let of = OdometryLog { truth, ..of };
        let (part, _) = measure_log(&of, &mut |_| {}).unwrap();
        assert_eq!(verdicts(&part), verdicts(&expected));
        assert!(
            part.without_truth > 0 && part.without_truth < part.ok,
            "{part:?}"
        );

        // None.
        fs::write(&of.truth, "1.5 0 0 0 0 0 0 1\n").unwrap();
        let error = measure_log(&of, &mut |_| {}).unwrap_err().to_string();
        assert!(
            error.contains("part.tum: has poses from 1.500 to 1.500 s"),
            "{error}"
        );
        let of = OdometryLog {
            points: Some("/other".to_owned()),
            ..of
        };
        let error = measure_log(&of, &mut |_| {}).unwrap_err().to_string();
        assert!(error.contains("/other"), "{error}");
    }
}
