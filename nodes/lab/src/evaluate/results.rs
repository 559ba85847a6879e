//! The file of results: a line of settings, then a line for each trial, as it is done.

use super::settings::{Cell, Settings};
use super::trial::Trial;
use crate::{AnyError, at};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::HashSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

pub const FILE: &str = "trials.jsonl";

/// Results that grow.
#[derive(Debug, Default)]
pub struct Results {
    /// File of the results, if they are kept.
    file: Option<(PathBuf, File)>,
    trials: Vec<Trial>,
    done: HashSet<String>,
}

#[derive(Serialize, Deserialize)]
struct Head {
    settings: Settings,
}

impl Results {
    pub(crate) fn in_memory() -> Results {
        Results::default()
    }

    /// Reads the results in a folder and what they are of; a last line that was not finished is left out.
    pub fn read(folder: &Path) -> Result<(Settings, Vec<Trial>), AnyError> {
        let path = folder.join(FILE);
        let text = fs::read(&path).map_err(at(&path))?;
        let (text, _) = whole_lines(&text);
        let first = text.lines().next().unwrap_or_default();
        let head: Head = serde_json::from_str(first).map_err(|e| damaged(&path, 1, &e))?;
        let trials = read(&path, &text, &head.settings)?;
        Ok((head.settings, sorted(trials)))
    }

    /// Opens the results in a folder, which is made if need be; a last line that was not finished is
    /// cut off.
    pub fn open(folder: &Path, settings: &Settings) -> Result<Results, AnyError> {
        let path = folder.join(FILE);
        let io = at(&path);
        fs::create_dir_all(folder).map_err(&io)?;
        let text = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(e) => return Err(io(e)),
        };
        let (text, whole) = whole_lines(&text);
        let trials = read(&path, &text, settings)?;
        let mut file = OpenOptions::new();
        let mut file = file.create(true).append(true).open(&path).map_err(&io)?;
        file.set_len(whole as u64).map_err(&io)?;
        if whole == 0 {
            let head = Head {
                settings: settings.clone(),
            };
            write_line(&mut file, &head).map_err(&io)?;
        }
        let done = trials.iter().map(|t| name(&t.cell, &t.method)).collect();
        Ok(Results {
            file: Some((path, file)),
            trials,
            done,
        })
    }

    /// Keeps a trial, on the disk when this returns if it is kept there.
    pub fn add(&mut self, trial: Trial) -> Result<(), AnyError> {
        if let Some((path, file)) = &mut self.file {
            write_line(file, &trial).map_err(at(path))?;
        }
        self.done.insert(name(&trial.cell, &trial.method));
        self.trials.push(trial);
        Ok(())
    }

    /// All trials, in an order that does not depend on when each was done.
    pub fn sorted(self) -> Vec<Trial> {
        sorted(self.trials)
    }

    /// Names of the trials that need not be run again.
    pub fn done(&self) -> HashSet<String> {
        self.done.clone()
    }
}

fn sorted(mut trials: Vec<Trial>) -> Vec<Trial> {
    trials.sort_by(|a, b| {
        let key = |t: &Trial| (t.cell.scene.clone(), t.cell.start.clone(), t.method.clone());
        key(a)
            .cmp(&key(b))
            .then(a.cell.q.total_cmp(&b.cell.q))
            .then(a.cell.seed.cmp(&b.cell.seed))
    });
    trials
}

/// The lines that were finished, and where they end.
fn whole_lines(bytes: &[u8]) -> (Cow<'_, str>, usize) {
    let end = bytes.iter().rposition(|byte| *byte == b'\n');
    let whole = end.map_or(0, |at| at + 1);
    let lines = bytes.get(..whole).unwrap_or_default();
    (String::from_utf8_lossy(lines), whole)
}

pub fn name(cell: &Cell, method: &str) -> String {
    format!(
        "{} {} {} {} {method}",
        cell.scene, cell.seed, cell.q, cell.start
    )
}

fn damaged(path: &Path, line: usize, reason: &serde_json::Error) -> AnyError {
    format!("{}, line {line}: {reason}", path.display()).into()
}

fn read(path: &Path, text: &str, settings: &Settings) -> Result<Vec<Trial>, AnyError> {
    let mut lines = text.lines().enumerate();
    let Some((_, first)) = lines.next() else {
        return Ok(Vec::new());
    };
    let head: Result<Head, _> = serde_json::from_str(first);
    if !head.is_ok_and(|head| head.settings == *settings) {
        let found: String = first.chars().take(400).collect();
        return Err(format!(
            "{} has results of other settings: {found}; take another folder, or the same mesh and options",
            path.display()
        )
        .into());
    }
    lines
        .map(|(i, line)| serde_json::from_str(line).map_err(|e| damaged(path, i + 1, &e)))
        .collect()
}

fn write_line(file: &mut File, value: &impl Serialize) -> io::Result<()> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    file.write_all(&line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    fn trial(seed: u64) -> Trial {
        let cell = Cell {
            scene: "desk".to_owned(),
            seed,
            q: 0.2,
            start: "0.3/10".to_owned(),
        };
        let pose = Isometry3::translation(0.1, 0.0, 0.0);
        Trial::of_pose(&cell, "icp", &pose, &Isometry3::identity(), &[], 2.5)
    }

    #[test]
    fn results_are_continued_after_a_torn_line() {
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings::default();
        let mut results = Results::open(folder.path(), &settings).unwrap();
        results.add(trial(1)).unwrap();
        results.add(trial(0)).unwrap();
        drop(results);
        let path = folder.path().join(FILE);
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() - 7]).unwrap();

        let mut results = Results::open(folder.path(), &settings).unwrap();
        assert_eq!(results.done(), [name(&trial(1).cell, "icp")].into());
        results.add(trial(0)).unwrap();
        assert_eq!(fs::read(&path).unwrap(), whole);
        assert_eq!(results.sorted(), [trial(0), trial(1)]);
        let read = Results::read(folder.path()).unwrap();
        assert_eq!(read, (settings.clone(), vec![trial(0), trial(1)]));

        // Not even the settings were written.
        fs::write(&path, &whole[..20]).unwrap();
        let error = Results::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("line 1"), "{error}");
        let results = Results::open(folder.path(), &settings).unwrap();
        assert_eq!(results.sorted(), []);
        let head = whole.iter().position(|b| *b == b'\n').unwrap() + 1;
        assert_eq!(fs::read(&path).unwrap(), &whole[..head]);
    }

    #[test]
    fn what_is_not_kept_is_counted_all_the_same() {
        let mut results = Results::in_memory();
        results.add(trial(1)).unwrap();
        results.add(trial(0)).unwrap();
        assert_eq!(results.sorted(), [trial(0), trial(1)]);
        let folder = tempfile::tempdir().unwrap();
        assert!(Results::read(folder.path()).is_err());
    }

    #[test]
    fn other_settings_and_damage_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        drop(Results::open(folder.path(), &Settings::default()).unwrap());
        let other = Settings {
            headset_scans: 2,
            ..Settings::default()
        };
        let fault = |settings| {
            Results::open(folder.path(), settings)
                .unwrap_err()
                .to_string()
        };
        assert!(fault(&other).contains("other settings"));

        let path = folder.path().join(FILE);
        let mut text = fs::read_to_string(&path).unwrap();
        text.push_str("{\"scene\":\n");
        fs::write(&path, text).unwrap();
        assert!(fault(&Settings::default()).contains("line 2"));
    }
}
