//! The point file of a simulated survey.

use super::points::{ScanRecord, scans_path};
use crate::simulate::{Survey, SurveyPattern};
use crate::{AnyError, at};
use lattice_nodes::files::atomic_write::AtomicFile;
use serde::Serialize;
use std::fmt;
use std::io::Write;
use std::path::PathBuf;

/// Options of a simulated survey.
#[derive(Clone, Debug)]
pub struct SiteOptions {
    /// Seed of all noise; the same seed gives the same bytes.
    pub seed: u64,
    /// The scanners.
    pub pattern: SurveyPattern,
    /// Number of points; the last scan is cut.
    pub points: u64,
    /// The point file; its scans get `.scans` added to the name.
    pub out: PathBuf,
}

/// Summary of a written survey.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SiteSummary {
    /// The point file.
    pub out: PathBuf,
    /// Points in it.
    pub points: u64,
    /// Scans that they belong to.
    pub scans: u64,
    /// Time that the scanners took, s.
    pub duration_s: f64,
    /// Mean distance of the points from the origin of their scan, m.
    pub mean_range_m: f64,
}

impl fmt::Display for SiteSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {} points in {} scans over {:.1} s, mean range {:.2} m",
            self.out.display(),
            self.points,
            self.scans,
            self.duration_s,
            self.mean_range_m
        )
    }
}

/// Writes a survey; `progress` is called with the share done, 0..1.
pub fn write_site(
    options: &SiteOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<SiteSummary, AnyError> {
    let survey = Survey::new(options.seed, options.pattern)?;
    let scans_out = scans_path(&options.out);
    let mut points_file = AtomicFile::create(&options.out).map_err(at(&options.out))?;
    let mut scans_file = AtomicFile::create(&scans_out).map_err(at(&scans_out))?;
    let (mut points, mut scans, mut sum_m) = (0u64, 0u64, 0.0);
    for scan in survey.scans() {
        if points >= options.points {
            break;
        }
        let left = usize::try_from(options.points - points).unwrap_or(usize::MAX);
        let kept = scan.points.get(..left).unwrap_or(&scan.points);
        for &point in kept {
            let [x, y, z, _] = point.map(f64::from);
            sum_m += (nalgebra::Vector3::new(x, y, z) - scan.origin_m).norm();
            let written = points_file.write_all(point.map(f32::to_le_bytes).as_flattened());
            written.map_err(at(&options.out))?;
        }
        let record = ScanRecord {
            origin_m: scan.origin_m,
            points: kept.len(),
        };
        let written = scans_file.write_all(record.to_bytes().as_flattened());
        written.map_err(at(&scans_out))?;
        points += kept.len() as u64;
        scans += 1;
        progress(points as f64 / options.points as f64);
    }
    if points < options.points {
        return Err(
            format!("only {points} points in the longest simulation; ask for no more").into(),
        );
    }
    points_file.finish().map_err(at(&options.out))?;
    scans_file.finish().map_err(at(&scans_out))?;
    Ok(SiteSummary {
        out: options.out.clone(),
        points,
        scans,
        duration_s: scans as f64 / options.pattern.scans_per_s(),
        mean_range_m: sum_m / points.max(1) as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn written(threads: usize, seed: u64, pattern: SurveyPattern) -> (Vec<u8>, Vec<u8>) {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("site.xyzi");
        let options = SiteOptions {
            seed,
            pattern,
            points: 10_000,
            out: out.clone(),
        };
        let pool = crate::pool(threads).unwrap();
        let summary = pool.install(|| write_site(&options, &mut |_| ())).unwrap();
        assert_eq!(summary.points, 10_000);
        (fs::read(&out).unwrap(), fs::read(scans_path(&out)).unwrap())
    }

    #[test]
    fn any_number_of_threads_writes_the_same_bytes() {
        for pattern in [SurveyPattern::Lms200, SurveyPattern::Os64] {
            let one = written(1, 3, pattern);
            assert_eq!(one.0.len(), 160_000);
            assert!(one == written(3, 3, pattern), "{pattern:?}");
            assert!(one != written(1, 4, pattern), "{pattern:?}");
        }
    }
}
