//! Log file, named and located as by rcl_logging_spdlog.

use std::env;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::Mutex;

use super::now_ns;
use crate::sync::lock;

/// Largest file; later lines are not written.
const MAX_BYTES: usize = 256 << 20;

/// Log file, appended line by line.
pub(super) struct LogFile(Mutex<(File, usize)>);

impl LogFile {
    /// Creates `<name>_<pid>_<ms>.log` in `ROS_LOG_DIR`, else in `ROS_HOME/log`, else in `~/.ros/log`.
    pub(super) fn open(
        name: Option<&str>,
        lookup: impl Fn(&str) -> Option<String>,
    ) -> Result<Self, String> {
        let program = env::args_os().next().unwrap_or_default();
        let program = Path::new(&program).file_name().unwrap_or_default();
        let name = name.map_or_else(|| program.to_string_lossy().into_owned(), str::to_owned);
        let place = folder(lookup).ok_or("no log file: set ROS_LOG_DIR or HOME")?;
        let name = format!("{name}_{}_{}.log", process::id(), now_ns() / 1_000_000);
        let path = place.join(name);
        let made = fs::create_dir_all(&place).and_then(|()| File::create_new(&path));
        let file = made
            .map_err(|error| format!("cannot create the log file {}: {error}", path.display()))?;
        Ok(Self(Mutex::new((file, MAX_BYTES))))
    }

    /// Appends a line.
    pub(super) fn write(&self, line: &str) {
        let (file, left) = &mut *lock(&self.0);
        let line = format!("{line}\n");
        match left.checked_sub(line.len()) {
            // A full disk must not end the node.
            Some(less) => (*left, _) = (less, file.write_all(line.as_bytes())),
            None => *left = 0,
        }
    }
}

fn folder(lookup: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    let set = |name: &str| lookup(name).filter(|value| !value.is_empty());
    let expanded = |path: String| match (path.strip_prefix('~'), set("HOME")) {
        (Some(rest), Some(home)) => PathBuf::from(home + rest),
        _ => PathBuf::from(path),
    };
    match (set("ROS_LOG_DIR"), set("ROS_HOME")) {
        (Some(folder), _) => Some(expanded(folder)),
        (None, Some(home)) => Some(expanded(home).join("log")),
        (None, None) => set("HOME").map(|home| PathBuf::from(home).join(".ros/log")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_those_of_rcl() {
        let found = |values: &[(&str, &str)]| {
            let value = |name: &str| values.iter().find(|(known, _)| *known == name);
            folder(|name| value(name).map(|(_, value)| (*value).to_owned()))
        };
        let home = ("HOME", "/home/robot");
        for (values, expected) in [
            (
                &[home, ("ROS_LOG_DIR", "~/logs"), ("ROS_HOME", "/ros")][..],
                Some("/home/robot/logs"),
            ),
            (&[home, ("ROS_HOME", "/ros")], Some("/ros/log")),
            (&[home, ("ROS_LOG_DIR", "")], Some("/home/robot/.ros/log")),
            (&[], None),
        ] {
            assert_eq!(found(values).as_deref(), expected.map(Path::new));
        }
    }

    #[test]
    fn a_file_is_bounded() {
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().display().to_string();
        let lookup = |name: &str| (name == "ROS_LOG_DIR").then(|| format!("{folder}/new"));
        let log = LogFile::open(Some("mapper"), lookup).unwrap();
        lock(&log.0).1 = 8;
        for line in ["one", "much too long", "two"] {
            log.write(line);
        }
        let mut files = fs::read_dir(directory.path().join("new")).unwrap();
        let path = files.next().unwrap().unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let parts: Vec<&str> = name.strip_suffix(".log").unwrap().split('_').collect();
        assert_eq!(parts[..2], ["mapper", &process::id().to_string()]);
        assert!(parts[2].parse::<u64>().unwrap() > 1_700_000_000_000);
        assert_eq!(fs::read_to_string(path).unwrap(), "one\n");
        let nowhere = LogFile::open(None, |_| Some("/proc/none".to_owned()));
        assert!(nowhere.is_err_and(|problem| problem.contains("/proc/none")));
    }
}
