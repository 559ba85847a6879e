//! Point clouds for the evaluation of quantization: uniform, simulated, or from files.

use super::report_options::Options;
use crate::paper::streams::{Purpose, stream};
use crate::simulate::house::{House, LaserView};
use crate::simulate::{RANGE_NOISE_M, Survey, SurveyPattern};
use crate::{AnyError, at};
use lattice_nodes::files::points::{PointFileOptions, read_points};
use std::path::Path;

/// Number of points of a simulated scan.
const POINTS: usize = 20_000;
/// Maximum number of points of a file; the rest is dropped at random.
const FILE_POINTS: usize = 60_000;
/// Edge of the cube of uniformly distributed points, metres.
const CUBE_M: f64 = 20.0;

/// Source of points.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Source {
    /// Uniformly distributed in a cube.
    Uniform,
    /// Scan of a simulated scanner.
    Simulated,
    /// Point file.
    File,
}

/// Point cloud with the scanner or the centroid at the origin, z up, metres.
pub struct Scan {
    /// Stem of file names.
    pub id: String,
    /// Title in the report.
    pub title: String,
    /// Source of its points.
    pub source: Source,
    /// True if most points are on the ground.
    pub outdoors: bool,
    /// Points, metres.
    pub points: Vec<[f32; 3]>,
    /// Cell volumes for the quantization, m^3; figures show the first.
    pub volumes_m3: Vec<f64>,
}

/// All clouds of a run.
pub fn scans(options: &Options) -> Result<Vec<Scan>, AnyError> {
    let mut scans = vec![uniform(options), room(options)?, site(options)?];
    for (number, path) in options.scans.iter().enumerate() {
        scans.push(file(path, number, options)?);
    }
    Ok(scans)
}

fn uniform(options: &Options) -> Scan {
    let mut stream = stream(options.seed, Purpose::Uniform, 0);
    let mut point = || CUBE_M * (stream.point().add_scalar(-0.5));
    Scan {
        id: "uniform".into(),
        title: "evenly spread points".into(),
        source: Source::Uniform,
        outdoors: false,
        points: (0..POINTS).map(|_| point().cast::<f32>().into()).collect(),
        volumes_m3: vec![0.125],
    }
}

/// A nodding laser scanner in a furnished house.
fn room(options: &Options) -> Result<Scan, AnyError> {
    let house = House::generated(options.seed)?;
    let pairs = LaserView::pairs(&house, 1, options.seed)?;
    let [view, _] = pairs.first().ok_or("no place for a scanner in the house")?;
    let points = view.scan(RANGE_NOISE_M, options.seed, 0);
    Ok(Scan {
        id: "room".into(),
        title: "simulated scan in a house".into(),
        source: Source::Simulated,
        outdoors: false,
        points: thinned(points, POINTS, options.seed, 0),
        volumes_m3: vec![0.125, 0.001],
    })
}

/// One turn of a scanner on a loader at an earth-moving site.
fn site(options: &Options) -> Result<Scan, AnyError> {
    let survey = Survey::new(options.seed, SurveyPattern::Os64)?;
    let scan = survey.scans().next().ok_or("the survey has no scan")?;
    let about = |[x, y, z, _]: &[f32; 4]| {
        let p = [x, y, z].map(|x| f64::from(*x));
        let p = nalgebra::Vector3::from(p) - scan.origin_m;
        p.cast::<f32>().into()
    };
    let points = scan.points.iter().map(about).collect();
    Ok(Scan {
        id: "site".into(),
        title: "simulated scan of an earth-moving site".into(),
        source: Source::Simulated,
        outdoors: true,
        points: thinned(points, POINTS, options.seed, 1),
        volumes_m3: vec![0.125],
    })
}

fn file(path: &Path, number: usize, options: &Options) -> Result<Scan, AnyError> {
    let file = read_points(path, &PointFileOptions::default());
    let points_m = file.map_err(at(path))?.points_m;
    if points_m.is_empty() {
        return Err(at(path)("no points"));
    }
    // About the middle, so that single precision is enough.
    let mean = |axis: usize| {
        let axis = points_m.iter().filter_map(|p| p.get(axis));
        axis.sum::<f64>() / points_m.len() as f64
    };
    let middle = [mean(0), mean(1), mean(2)];
    let about = |[x, y, z]: &[f64; 3]| [x - middle[0], y - middle[1], z - middle[2]];
    let points = points_m.iter().map(|p| about(p).map(|x| x as f32));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(Scan {
        id: format!("scan{}", number + 1),
        title: format!("scan {name}"),
        source: Source::File,
        outdoors: false,
        points: thinned(points.collect(), FILE_POINTS, options.seed, 2 + number),
        volumes_m3: vec![0.125, 0.008],
    })
}

/// Random subset of at most `most` points, in their order.
fn thinned(points: Vec<[f32; 3]>, most: usize, seed: u64, number: usize) -> Vec<[f32; 3]> {
    let mut stream = stream(seed, Purpose::Thin, number);
    let (mut left, mut wanted) = (points.len() as f64, most as f64);
    let mut draw = |_: &[f32; 3]| {
        let taken = stream.uniform() * left < wanted;
        left -= 1.0;
        wanted -= f64::from(u8::from(taken));
        taken
    };
    points.into_iter().filter(|p| draw(p)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_takes_as_many_as_wanted_from_all_over() {
        let points: Vec<[f32; 3]> = (0..1000).map(|i| [i as f32, 0.0, 0.0]).collect();
        let some = thinned(points.clone(), 100, 1, 0);
        assert_eq!(some.len(), 100);
        assert!(some.is_sorted() && some[20][0] > 100.0 && some[80][0] < 900.0);
        assert_eq!(thinned(points.clone(), 5000, 1, 0), points);
    }

    #[test]
    fn a_file_that_is_missing_is_named() {
        let options = Options {
            seed: 1,
            quick: true,
            scans: vec!["/nowhere/scan.ply".into()],
            bags: Vec::new(),
            pairs: None,
            pair_files: Vec::new(),
        };
        let error = scans(&options).err().unwrap().to_string();
        assert!(error.contains("/nowhere/scan.ply"), "{error}");
    }
}
