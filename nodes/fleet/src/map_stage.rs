//! The map stage: one task for each log, slice of time and settings, each of which makes one part.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::Result;
use crate::corrections::Corrections;
use crate::files::{FileId, at};
use crate::part::Source;
use crate::tables::{Added, Tables, digest_of_log, read_map_file};

/// Settings by which logs are mapped, the same for all.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Settings {
    /// The program `lattice`.
    pub program: PathBuf,
    /// Parameter files of the nodes.
    pub params: Vec<PathBuf>,
    /// Further options of `lattice replay`.
    pub options: Vec<String>,
    /// Threads of a task.
    pub threads: usize,
}

/// A task: what a worker, in this process or on a cluster, has to know.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Task {
    /// Folder of the tables.
    pub tables: PathBuf,
    /// Settings of the replay.
    pub settings: Settings,
    /// Source of the part.
    pub source: Source,
    /// True if the poses of the log are corrected.
    pub corrected: bool,
}

impl Task {
    /// The tasks of a log: one, or one for each slice of `slice_s`; fails where the corrections leave it out.
    pub fn of_log(
        log: &Path,
        slice_s: Option<f64>,
        settings: &Settings,
        corrections: Option<&Corrections>,
        tables: &Tables,
    ) -> Result<Vec<Task>> {
        let absolute = |path: &Path| path.canonicalize().map_err(|error| at(path, error));
        let log = absolute(log)?;
        let sha256 = digest_of_log(&log)?;
        let correction = match corrections {
            Some(corrections) => corrections.options_of(&log, &sha256)?,
            None => Vec::new(),
        };
        let mut settings = settings.clone();
        settings.options.extend_from_slice(&correction);
        let mut recorded = settings.options.clone();
        for path in &settings.params {
            let id = FileId::of(path).map_err(|error| at(path, error))?;
            recorded.push(format!("--params of SHA-256 {}", id.sha256));
        }
        let task = |slice_s| -> Result<Task> {
            Ok(Task {
                tables: absolute(tables.folder())?,
                settings: Settings {
                    params: settings
                        .params
                        .iter()
                        .map(|path| absolute(path))
                        .collect::<Result<_>>()?,
                    ..settings.clone()
                },
                source: Source {
                    kind: "log".to_owned(),
                    path: log.display().to_string(),
                    sha256: sha256.clone(),
                    slice_s,
                    settings: recorded.clone(),
                    program: version_of(&settings.program)?,
                },
                corrected: !correction.is_empty(),
            })
        };
        let mut tasks = vec![];
        match slice_s {
            None => tasks.push(task((0.0, None))?),
            Some(length_s) => {
                let slices = (duration_s(&settings.program, &log)? / length_s)
                    .ceil()
                    .max(1.0);
                // An infinite log, or one whose length is not a number, is refused too.
                if !slices.is_finite() || slices > 1e6 {
                    return Err(at(&log, format!("slices of {length_s} s are too many")));
                }
                for number in 0..slices as u32 {
                    let from_s = f64::from(number) * length_s;
                    let last = f64::from(number + 1) >= slices;
                    let to_s = f64::from(number + 1) * length_s;
                    tasks.push(task((from_s, (!last).then_some(to_s)))?);
                }
            }
        }
        Ok(tasks)
    }

    /// True if its part is complete.
    pub fn is_done(&self) -> Result<bool> {
        Ok(Tables::open(&self.tables)?.has(&self.source.part_name()))
    }

    /// Maps the slice in a process of its own and adds the part; any number of times, it counts once.
    pub fn run(&self) -> Result<Added> {
        let tables = Tables::open(&self.tables)?;
        let name = self.source.part_name();
        if tables.has(&name) {
            return Ok(Added { name, new: false });
        }
        let scratch = tables.scratch_folder();
        let scratch = tempfile::tempdir_in(&scratch).map_err(|error| at(&scratch, error))?;
        let file = scratch.path().join("map.lat");
        let mut command = Command::new(&self.settings.program);
        let (from_s, to_s) = self.source.slice_s;
        command.args(["replay", &self.source.path, "--direct", "--json"]);
        command.args(["--threads", &self.settings.threads.to_string()]);
        command.args(["--start", &from_s.to_string()]);
        if let Some(to_s) = to_s {
            command.args(["--stop", &to_s.to_string()]);
        }
        for path in &self.settings.params {
            command.arg("--params").arg(path);
        }
        command
            .args(&self.settings.options)
            .arg("--map-out")
            .arg(&file);
        let report: Value = serde_json::from_slice(&output_of(command)?)?;
        let number = |at: usize| report.get("origin")?.get(at)?.as_f64();
        let origin = match (number(0), number(1), number(2)) {
            (Some(latitude), Some(longitude), Some(height)) => Some([latitude, longitude, height]),
            _ => None,
        };
        tables.add(&read_map_file(&file)?.into(), self.source.clone(), origin)
    }

    /// Name of the task for its user.
    pub fn title(&self) -> String {
        match self.source.slice_s {
            (_, None) if self.source.slice_s.0 == 0.0 => self.source.path.clone(),
            (from_s, Some(to_s)) => format!("{} from {from_s} to {to_s} s", self.source.path),
            (from_s, None) => format!("{} from {from_s} s", self.source.path),
        }
    }
}

/// Runs tasks on `workers` threads; gives the number of new parts, and what failed.
///
/// `progress` gets the number of tasks that have ended.
pub fn run_all(
    tasks: &[Task],
    workers: usize,
    progress: &(dyn Fn(usize) + Sync),
) -> (usize, Vec<String>) {
    let (next, ended, new) = (
        AtomicUsize::new(0),
        AtomicUsize::new(0),
        AtomicUsize::new(0),
    );
    let failures = Mutex::new(Vec::new());
    let work = || {
        while let Some(task) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
            match task.run() {
                Ok(added) => {
                    new.fetch_add(usize::from(added.new), Ordering::Relaxed);
                }
                Err(error) => {
                    let mut failures = failures.lock().unwrap_or_else(|held| held.into_inner());
                    failures.push(format!("{}: {error}", task.title()));
                }
            }
            progress(ended.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..workers.clamp(1, tasks.len().max(1)) {
            scope.spawn(work);
        }
    });
    (
        new.into_inner(),
        failures
            .into_inner()
            .unwrap_or_else(|held| held.into_inner()),
    )
}

fn version_of(program: &Path) -> Result<String> {
    let mut command = Command::new(program);
    command.arg("--version");
    Ok(String::from_utf8_lossy(&output_of(command)?)
        .trim()
        .to_owned())
}

fn duration_s(program: &Path, log: &Path) -> Result<f64> {
    let mut command = Command::new(program);
    command.args(["bag", "info", "--json"]).arg(log);
    let info: Value = serde_json::from_slice(&output_of(command)?)?;
    let duration_s = info.get("duration_s").and_then(Value::as_f64);
    duration_s.ok_or_else(|| at(log, "the log does not say how long it is"))
}

/// Standard output of a program; where it fails, what it said.
fn output_of(mut command: Command) -> Result<Vec<u8>> {
    let program = PathBuf::from(command.get_program());
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let output = command.output().map_err(|error| at(&program, error))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let said = said.trim().lines().last().unwrap_or("it said nothing");
    Err(format!("{said} ({})", output.status).into())
}
