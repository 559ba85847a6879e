//! Odometry of a lidar measured in simulated drives and logs: drift, verdicts, and covariances against the truth.

mod log;
mod loops;
mod measurement;
mod report;

use std::path::Path;

use lattice_nodes::files::atomic_write::write_text;

pub use log::{OdometryLog, measure_log};
pub use measurement::OdometryTrial;
pub use report::odometry_report;

use crate::simulate::drive::DriveScene;
use crate::{AnyError, at};

/// File of the trials in their folder.
const TRIALS: &str = "trials.jsonl";

/// Runs all drives that the folder does not have yet, and gives all trials.
pub fn run_odometry(
    folder: &Path,
    scenes: &[DriveScene],
    seeds: u64,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Vec<OdometryTrial>, AnyError> {
    std::fs::create_dir_all(folder).map_err(at(folder))?;
    let path = folder.join(TRIALS);
    let mut trials: Vec<OdometryTrial> = Vec::new();
    if path.exists() {
        let text = std::fs::read_to_string(&path).map_err(at(&path))?;
        for line in text.lines() {
            trials.push(serde_json::from_str(line)?);
        }
    }
    let all = scenes
        .iter()
        .flat_map(|scene| (0..seeds).map(|seed| (*scene, seed)));
    let all: Vec<(DriveScene, u64)> = all.collect();
    for (i, (scene, seed)) in all.iter().enumerate() {
        progress(i, all.len());
        let is_it = |trial: &OdometryTrial| trial.scene == scene.name() && trial.seed == *seed;
        if trials.iter().any(is_it) {
            continue;
        }
        trials.push(OdometryTrial::run(*scene, *seed)?);
        let lines = trials.iter().map(serde_json::to_string);
        let lines = lines.collect::<Result<Vec<_>, _>>()?;
        write_text(&path, &(lines.join("\n") + "\n"))?;
    }
    trials.sort_by(|a, b| (&a.scene, a.seed).cmp(&(&b.scene, b.seed)));
    Ok(trials)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::markdown;

    #[test]
    fn a_plane_is_never_called_certain_and_results_are_continued() {
        let folder = tempfile::tempdir().unwrap();
        let scenes = [DriveScene::Yard];
        let trials = run_odometry(folder.path(), &scenes, 1, &mut |_, _| {}).unwrap();
        let [trial] = trials.as_slice() else {
            panic!("{trials:?}")
        };
        assert_eq!((trial.ok, trial.wrong), (0, 0), "{trial:?}");
        assert_eq!(trial.weak + trial.lost, trial.scans);
        let again = run_odometry(folder.path(), &scenes, 1, &mut |_, _| {}).unwrap();
        // Not driven again: times are those of the file, whose last digit the parser of JSON may change.
        let mut kept = again[0].clone();
        let is_same = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b;
        assert!(is_same(kept.ms, trial.ms) && is_same(kept.cpu_ms, trial.cpu_ms));
        assert!(is_same(
            kept.loops.cpu_s.unwrap(),
            trial.loops.cpu_s.unwrap()
        ));
        (kept.ms, kept.cpu_ms, kept.loops.cpu_s) = (trial.ms, trial.cpu_ms, trial.loops.cpu_s);
        assert_eq!((again.len(), &kept), (1, trial));
        assert!(markdown(&odometry_report(&trials)).contains("| yard | 1 |"));
    }
}
