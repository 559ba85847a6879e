//! Pose corrections of logs: proposed by `lattice fleet align`, applied by `lattice fleet map`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::files::{at, read_json};

/// Version of the file.
pub const VERSION: u32 = 1;

/// Corrections of several logs.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Corrections {
    /// Version of the file.
    pub version: u32,
    /// The logs.
    pub logs: Vec<Correction>,
}

/// Correction of a log: `corrected_from_map`, applied to all of its poses in the map frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Path of the log.
    pub log: String,
    /// SHA-256 of its files; not compared if empty.
    #[serde(default)]
    pub sha256: String,
    /// Treatment of the log.
    pub action: Action,
    /// Translation, m.
    #[serde(default)]
    pub translation_m: [f64; 3],
    /// Rotation about the origin of the map before it: fixed-axis roll, pitch, yaw.
    #[serde(default)]
    pub rpy_rad: [f64; 3],
    /// Results of the registration, for the reader.
    #[serde(default)]
    pub found: Option<Found>,
    /// Reason for the action.
    #[serde(default)]
    pub reason: String,
}

/// Treatment of a log.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Mapped with corrected poses.
    Move,
    /// Mapped without a correction.
    Keep,
    /// Not mapped.
    #[default]
    LeaveOut,
}

/// Results of the registration of a log's map with the reference.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// Verdict of `lattice calibrate`.
    pub verdict: String,
    /// Largest move of a corner of the box around the log's map, m.
    pub largest_move_m: f64,
    /// Angle of the rotation, degrees.
    pub turn_deg: f64,
    /// Fraction of the points that lie on the reference.
    pub inlier_fraction: f64,
    /// Probability of error, as the registration estimates it.
    pub p_wrong: f64,
    /// Standard deviation of the translation, m.
    pub sigma_m: [f64; 3],
    /// Standard deviation of the rotation, degrees.
    pub sigma_deg: [f64; 3],
}

impl Corrections {
    /// Reads a file. Fails if a log has two entries.
    pub fn read(path: &Path) -> Result<Corrections> {
        let read: Corrections = read_json(path)?;
        if read.version != VERSION {
            let (is, known) = (read.version, VERSION);
            return Err(at(
                path,
                format!("version {is} is not supported, only {known}"),
            ));
        }
        for (number, entry) in read.logs.iter().enumerate() {
            let same = |other: &&Correction| match entry.sha256.is_empty() {
                true => entry.log == other.log,
                false => entry.sha256 == other.sha256,
            };
            if let Some(other) = read.logs.iter().skip(number + 1).find(same) {
                let reason = format!("{} and {} are one log", entry.log, other.log);
                return Err(at(path, format!("{reason}; remove an entry")));
            }
            let numbers = entry.translation_m.iter().chain(&entry.rpy_rad);
            if let Some(wrong) = numbers.into_iter().find(|number| !number.is_finite()) {
                let log = &entry.log;
                return Err(at(
                    path,
                    format!("{log}: {wrong} in a correction is not finite"),
                ));
            }
        }
        Ok(read)
    }

    /// Parameters for a log, by its canonical path and its digest; none for a log without an entry. Fails for a log
    /// to be left out, and for one that has changed.
    pub fn params_of(&self, log: &Path, sha256: &str) -> Result<Option<Vec<String>>> {
        let by_digest = self.logs.iter().find(|entry| entry.sha256 == sha256);
        let is_there = |entry: &&Correction| {
            Path::new(&entry.log)
                .canonicalize()
                .is_ok_and(|path| path == log)
        };
        let Some(entry) = by_digest.or_else(|| self.logs.iter().find(is_there)) else {
            return Ok(None);
        };
        if !entry.sha256.is_empty() && entry.sha256 != sha256 {
            return Err(
                "the log differs from the aligned one: its files have changed since".into(),
            );
        }
        match entry.action {
            Action::Keep => Ok(Some(Vec::new())),
            Action::LeaveOut => {
                Err(format!("left out by the corrections: {}", entry.reason).into())
            }
            Action::Move => Ok(Some(vec![
                format!("correction.translation_m:={:?}", entry.translation_m),
                format!("correction.rpy_rad:={:?}", entry.rpy_rad),
            ])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn correction(log: &str, sha256: &str, action: Action) -> Correction {
        Correction {
            log: log.into(),
            sha256: sha256.into(),
            action,
            translation_m: [0.5, 0.0, -1e-6],
            reason: "it lies elsewhere".into(),
            ..Correction::default()
        }
    }

    #[test]
    fn a_log_is_found_by_its_digest_and_by_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().canonicalize().unwrap();
        let path = folder.display().to_string();
        let corrections = Corrections {
            version: VERSION,
            logs: vec![
                correction("/elsewhere", "aa", Action::Move),
                correction(&path, "", Action::Keep),
                correction("/third", "cc", Action::LeaveOut),
            ],
        };
        let moved = [
            "correction.translation_m:=[0.5, 0.0, -1e-6]".to_owned(),
            "correction.rpy_rad:=[0.0, 0.0, 0.0]".to_owned(),
        ];
        let other = Path::new("/other");
        let params_of = |log, sha256| corrections.params_of(log, sha256).unwrap();
        assert_eq!(params_of(other, "aa"), Some(moved.to_vec()));
        assert_eq!(params_of(&folder, "bb"), Some(Vec::new()));
        assert_eq!(params_of(other, "dd"), None);
        let left_out = corrections.params_of(other, "cc").unwrap_err().to_string();
        assert!(left_out.contains("it lies elsewhere"), "{left_out}");
    }

    #[test]
    fn a_log_that_changed_and_a_log_with_two_entries_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().canonicalize().unwrap();
        let path = log.display().to_string();
        let mut corrections = Corrections {
            version: VERSION,
            logs: vec![correction(&path, "aa", Action::Move)],
        };
        let changed = corrections.params_of(&log, "bb").unwrap_err().to_string();
        assert!(changed.contains("changed"), "{changed}");
        corrections
            .logs
            .push(correction("/again", "aa", Action::Keep));
        let file = log.join("corrections.json");
        crate::files::write_json(&file, &corrections).unwrap();
        let twice = Corrections::read(&file).unwrap_err().to_string();
        assert!(twice.contains("/again"), "{twice}");
    }
}
