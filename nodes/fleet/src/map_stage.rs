//! Map stage: one task for each log, slice of time and settings. Each task makes one part.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::Result;
use crate::corrections::Corrections;
use crate::files::at;
use crate::part::Source;
use crate::replay_options::ReplayOptions;
use crate::roots::Roots;
use crate::stop::{self, Scratch};
use crate::tables::{Added, Tables, digest_of_log, read_map_file};

/// Largest number of slices of a log.
const MAX_SLICES: f64 = 1e6;

/// Program and folders of the process that runs tasks. No task names a program.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Worker {
    /// The program `lattice`.
    pub program: PathBuf,
    /// Its version.
    pub version: String,
    /// Folders of logs and tables; none in the user's own process, which takes any.
    pub roots: Option<Roots>,
}

impl Worker {
    /// A worker with a program, which is asked for its version.
    pub fn new(program: PathBuf, roots: Option<Roots>) -> Result<Worker> {
        let mut command = Command::new(&program);
        command.arg("--version");
        let version = String::from_utf8_lossy(&output_of(command)?)
            .trim()
            .to_owned();
        Ok(Worker {
            program,
            version,
            roots,
        })
    }
}

/// A task in the form that is sent to a worker.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Folder of the tables.
    pub tables: PathBuf,
    /// Options of the replay.
    pub options: ReplayOptions,
    /// Source of the part.
    pub source: Source,
    /// True if the poses of the log are corrected.
    pub corrected: bool,
}

impl Task {
    /// The tasks of a log: one, or one for each slice of `slice_s`. Fails where the corrections leave it out.
    pub fn of_log(
        log: &Path,
        slice_s: Option<f64>,
        options: &ReplayOptions,
        corrections: Option<&Corrections>,
        tables: &Tables,
        worker: &Worker,
    ) -> Result<Vec<Task>> {
        let absolute = |path: &Path| path.canonicalize().map_err(|error| at(path, error));
        let log = absolute(log)?;
        let sha256 = digest_of_log(&log)?;
        let correction = match corrections {
            Some(corrections) => corrections.params_of(&log, &sha256)?,
            None => None,
        };
        let mut options = options.clone();
        options.param.extend(correction.iter().flatten().cloned());
        options.check()?;
        let path = log
            .to_str()
            .ok_or_else(|| at(&log, "the path is not UTF-8"))?;
        let folder = absolute(tables.folder())?;
        let task = |slice_s| Task {
            tables: folder.clone(),
            source: Source {
                kind: "log".to_owned(),
                path: path.to_owned(),
                sha256: sha256.clone(),
                slice_s,
                settings: options.settings(),
                program: worker.version.clone(),
                placed: correction.is_some(),
            },
            options: options.clone(),
            corrected: correction.as_ref().is_some_and(|params| !params.is_empty()),
        };
        let mut tasks = vec![];
        match slice_s {
            None => tasks.push(task((0.0, None))),
            Some(length_s) => {
                let duration_s = duration_s(&worker.program, &log)?;
                let slices = (duration_s / length_s).ceil().max(1.0);
                // An infinite duration, or one that is not a number, is refused too.
                if !slices.is_finite() || slices > MAX_SLICES {
                    let reason = format!(
                        "{duration_s} s in slices of {length_s} s are more than {MAX_SLICES} slices: raise --slice"
                    );
                    return Err(at(&log, reason));
                }
                for number in 0..slices as u32 {
                    let from_s = f64::from(number) * length_s;
                    let last = f64::from(number + 1) >= slices;
                    let to_s = f64::from(number + 1) * length_s;
                    tasks.push(task((from_s, (!last).then_some(to_s))));
                }
            }
        }
        Ok(tasks)
    }

    /// True if its part is complete.
    pub fn is_done(&self) -> Result<bool> {
        Ok(Tables::open(&self.tables)?.has(&self.source.part_name()))
    }

    /// Fails unless a worker may run the task: its paths lie below the roots, its options are known, and its source
    /// is what it makes.
    fn admit(&self, worker: &Worker) -> Result {
        self.options.check()?;
        if let Some(roots) = &worker.roots {
            roots.admit_log(Path::new(&self.source.path))?;
            roots.admit_tables(&self.tables)?;
        }
        let (from_s, to_s) = self.source.slice_s;
        let is_time = |time_s: f64| time_s >= 0.0 && time_s.is_finite();
        if !is_time(from_s) || to_s.is_some_and(|to_s| !is_time(to_s) || to_s <= from_s) {
            return Err(
                format!("slice from {from_s} to {to_s:?} s is not a range of log time").into(),
            );
        }
        if self.source.kind != "log" || self.source.settings != self.options.settings() {
            return Err("the source of the task differs from its options".into());
        }
        if self.source.program != worker.version {
            return Err(format!(
                "the task is of {}, this worker has {}: install one version of lattice everywhere",
                self.source.program, worker.version
            )
            .into());
        }
        Ok(())
    }

    /// Maps the slice in a process of its own and adds the part. However often it runs, the part counts once.
    pub fn run(&self, worker: &Worker) -> Result<Added> {
        self.admit(worker)?;
        let tables = Tables::open(&self.tables)?;
        let name = self.source.part_name();
        if tables.has(&name) {
            return Ok(Added { name, new: false });
        }
        let parent = tables.scratch_folder();
        let scratch = Scratch::create(&parent, ".map-").map_err(|error| at(&parent, error))?;
        let file = scratch.path().join("map.lat");
        let mut command = Command::new(&worker.program);
        let (from_s, to_s) = self.source.slice_s;
        command.args(["replay", &self.source.path, "--direct", "--json"]);
        command.args(["--threads", "1", "--start", &from_s.to_string()]);
        if let Some(to_s) = to_s {
            command.args(["--stop", &to_s.to_string()]);
        }
        command.args(self.options.arguments(scratch.path())?);
        command.arg("--map-out").arg(&file);
        let report: Value = serde_json::from_slice(&output_of(command)?)?;
        let number = |at: usize| report.get("origin")?.get(at)?.as_f64();
        let origin = match (number(0), number(1), number(2)) {
            (Some(latitude), Some(longitude), Some(height)) => Some([latitude, longitude, height]),
            _ => None,
        };
        tables.add(&read_map_file(&file)?.into(), self.source.clone(), origin)
    }

    /// Name of the task in messages.
    pub fn title(&self) -> String {
        match self.source.slice_s {
            (_, None) if self.source.slice_s.0 == 0.0 => self.source.path.clone(),
            (from_s, Some(to_s)) => format!("{} from {from_s} to {to_s} s", self.source.path),
            (from_s, None) => format!("{} from {from_s} s", self.source.path),
        }
    }
}

/// Runs tasks on some threads. Returns the number of new parts, and the errors of the tasks that failed.
///
/// `progress` gets the number of tasks that have ended.
pub fn run_all(
    tasks: &[Task],
    worker: &Worker,
    threads: usize,
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
            match task.run(worker) {
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
        for _ in 0..threads.clamp(1, tasks.len().max(1)) {
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

fn duration_s(program: &Path, log: &Path) -> Result<f64> {
    let mut command = Command::new(program);
    command.args(["bag", "info", "--json"]).arg(log);
    let info: Value = serde_json::from_slice(&output_of(command)?)?;
    let duration_s = info.get("duration_s").and_then(Value::as_f64);
    duration_s.ok_or_else(|| at(log, "the report of `lattice bag info` has no duration"))
}

/// Standard output of a program, or the last line of its error output if it fails.
fn output_of(command: Command) -> Result<Vec<u8>> {
    let program = PathBuf::from(command.get_program());
    let output = stop::output_of(command).map_err(|error| at(&program, error))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let said = said.trim().lines().last().unwrap_or("no error output");
    Err(format!("{said} ({})", output.status).into())
}
