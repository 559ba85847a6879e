//! Command line of a report.

use std::path::PathBuf;

/// The command line of a paper's report, with the names of files of each option but not where they lie.
pub fn command<'a>(
    paper: &str,
    (seed, quick): (u64, bool),
    files: impl IntoIterator<Item = (&'a str, &'a [PathBuf])>,
) -> String {
    let mut words = format!("lattice paper {paper} --seed {seed}");
    if quick {
        words.push_str(" --quick");
    }
    for (option, paths) in files {
        words.push_str(&format!(" --{option}"));
        for path in paths {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            words.push_str(&format!(" {name}"));
        }
    }
    words
}
