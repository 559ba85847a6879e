//! Scans that are matched: of a simulated house, and pairs of files.

use crate::matching::{MultiResolutionList, Spread, search};
use crate::poses::read_pose;
use crate::simulate::RANGE_NOISE_M;
use crate::simulate::house::{House, LaserView};
use crate::{AnyError, at};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::registration::{
    PrepareOptions, PreparedCloud, RegisterOptions, SemanticCloud, register, voxel_downsample,
};
use lattice_nodes::files::points::{PointFileOptions, read_points};
use nalgebra::{Isometry3, Vector3};
use std::path::{Path, PathBuf};

/// Pairs of stands all over the house.
const STANDS: usize = 12;
/// Most bytes of the lists of a trial.
pub(super) const MAX_BYTES: usize = 1 << 28;

/// Source of scans.
pub(super) enum Source {
    /// Views of the house, each trial with range noise of its own.
    Simulated(Vec<[LaserView; 2]>),
    /// One scan as the map, one to match.
    Files {
        scans: [Vec<[f32; 3]>; 2],
        map_from_scan: Isometry3<f64>,
        /// If the truth is our own: how far it and that from the other scan are apart, metres.
        doubt_m: Option<f64>,
    },
}

/// Two scans, each in the frame of its scanner, metres, and the truth.
pub(super) struct Pair {
    pub(super) map: Vec<[f32; 3]>,
    pub(super) scan: Vec<[f32; 3]>,
    pub(super) map_from_scan: Isometry3<f64>,
}

impl Source {
    /// The scans of trial `number`, with noise of lane `lane`.
    pub(super) fn pair(&self, seed: u64, lane: usize, number: usize) -> Option<Pair> {
        match self {
            Source::Simulated(views) => {
                let [map, scan] = views.get(number % views.len().max(1))?;
                let stream = ((lane as u64) << 32 | number as u64) << 1;
                Some(Pair {
                    map: map.scan(RANGE_NOISE_M, seed, stream),
                    scan: scan.scan(RANGE_NOISE_M, seed, stream + 1),
                    map_from_scan: map.house_from_laser.inverse() * scan.house_from_laser,
                })
            }
            Source::Files {
                scans: [map, scan],
                map_from_scan,
                ..
            } => Some(Pair {
                map: map.clone(),
                scan: scan.clone(),
                map_from_scan: *map_from_scan,
            }),
        }
    }

    /// Doubt about our own truth, metres, if it is ours.
    pub(super) fn doubt_m(&self) -> Option<f64> {
        match self {
            Source::Simulated(_) => None,
            Source::Files { doubt_m, .. } => *doubt_m,
        }
    }
}

/// One panel of the figure.
pub(super) struct Scene {
    /// "simulated rooms".
    pub(super) place: String,
    /// Number of the source.
    pub(super) source: usize,
    /// Side of a cube of the finest cell's volume, metres.
    pub(super) side_m: f64,
    /// A start is off by up to this along each axis, metres.
    pub(super) start_m: f64,
}

impl Scene {
    /// "simulated rooms, 0.1 m cells, start ±0.2 m".
    pub(super) fn title(&self) -> String {
        let Scene {
            place,
            side_m,
            start_m,
            ..
        } = self;
        format!("{place}, {side_m} m cells, start ±{start_m} m")
    }
}

/// The name of what is simulated.
pub(super) const ROOMS: &str = "simulated rooms";
/// The pair of small_gicp.
pub(super) const STREET: &str = "street (small_gicp)";
/// The pair of the Point Cloud Library.
pub(super) const OFFICE: &str = "room (PCL)";

/// All scenes, and what they are made of; `files` are of a map, a scan and its pose in the map.
pub(super) fn scenes(
    seed: u64,
    pairs: Option<&Path>,
    files: &[[PathBuf; 3]],
) -> Result<(Vec<Source>, Vec<Scene>), AnyError> {
    let house = House::generated(seed)?;
    let views = LaserView::pairs(&house, STANDS, seed)?;
    let mut sources = vec![Source::Simulated(views)];
    let mut scenes = Vec::new();
    let mut add = |place: &str, source, cases: &[(f64, f64)]| {
        scenes.extend(cases.iter().map(|&(side_m, start_m)| Scene {
            place: place.to_owned(),
            source,
            side_m,
            start_m,
        }));
    };
    add(ROOMS, 0, &[(0.1, 0.2), (0.2, 0.3), (0.2, 0.6)]);
    for [map, scan, truth] in files {
        let scans = [points(map)?, points(scan)?];
        let side_m = side_of(&scans[0]).ok_or_else(|| format!("{}: no points", map.display()))?;
        let cases = [side_m, side_m / 2.0].map(|side_m| (side_m, 2.0 * side_m));
        let name = |path: &Path| {
            path.file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        add(
            &format!("{} on {}", name(scan), name(map)),
            sources.len(),
            &cases,
        );
        sources.push(Source::Files {
            scans,
            map_from_scan: read_pose(truth)?,
            doubt_m: None,
        });
    }
    let Some(folder) = pairs else {
        return Ok((sources, scenes));
    };
    let given = sources.len();
    let both = |names: [&str; 2]| -> Result<[Vec<[f32; 3]>; 2], AnyError> {
        let [map, scan] = names.map(|name| points(&folder.join(name)));
        Ok([map?, scan?])
    };
    let truth = folder.join("small_gicp/T_target_source.txt");
    if truth.is_file() {
        add(STREET, sources.len(), &[(0.5, 1.0), (0.25, 0.5)]);
        sources.push(Source::Files {
            scans: both(["small_gicp/target.ply", "small_gicp/source.ply"])?,
            map_from_scan: read_pose(&truth)?,
            doubt_m: None,
        });
    }
    let scans = ["room_scan1.pcd", "room_scan2.pcd"];
    if scans.iter().all(|name| folder.join(name).is_file()) {
        let [map, scan] = both(scans)?;
        let truth = registered(&map, &scan)?;
        let back = registered(&scan, &map)?.inverse();
        let apart = truth.translation.vector - back.translation.vector;
        add(OFFICE, sources.len(), &[(0.1, 0.2), (0.2, 0.3)]);
        sources.push(Source::Files {
            scans: [map, scan],
            map_from_scan: truth,
            doubt_m: Some(apart.norm()),
        });
    }
    if sources.len() == given {
        let words =
            "has neither small_gicp/T_target_source.txt nor room_scan1.pcd and room_scan2.pcd";
        return Err(format!("{}: {words}", folder.display()).into());
    }
    Ok((sources, scenes))
}

/// Side of cells for a scan: a four hundredth of the diagonal of its box, of the sides 1, 2, 5, 10 and so on cm
/// the nearest.
fn side_of(points_m: &[[f32; 3]]) -> Option<f64> {
    let bounds = |axis: usize| {
        let along = points_m.iter().map(move |p| f64::from(p[axis]));
        let low = along.clone().fold(f64::INFINITY, f64::min);
        along.fold(f64::NEG_INFINITY, f64::max) - low
    };
    let diagonal_m = [0, 1, 2]
        .map(bounds)
        .iter()
        .map(|d| d * d)
        .sum::<f64>()
        .sqrt();
    let wanted_m = diagonal_m / 400.0;
    let sides_m = (-2..=2).flat_map(|power| [1.0, 2.0, 5.0].map(|d| d * 10_f64.powi(power)));
    let off = |side_m: &f64| (side_m / wanted_m).ln().abs();
    let is_finite = wanted_m.is_finite() && wanted_m > 0.0;
    sides_m
        .min_by(|a, b| off(a).total_cmp(&off(b)))
        .filter(|_| is_finite)
}

fn points(path: &Path) -> Result<Vec<[f32; 3]>, AnyError> {
    let file = read_points(path, &PointFileOptions::default());
    let file = file.map_err(at(path))?;
    let narrow = |p: &[f64; 3]| p.map(|x| x as f32);
    // Rays without return, which are at 0 0 0, are points of the peers.
    let no_returns = std::iter::repeat_n([0.0; 3], file.no_returns);
    Ok(file.points_m.iter().map(narrow).chain(no_returns).collect())
}

/// Pose of a scan that comes without one: by our search for a heading and a place, then by GICP.
fn registered(map: &[[f32; 3]], scan: &[[f32; 3]]) -> Result<Isometry3<f64>, AnyError> {
    let cloud = |points: &[[f32; 3]]| Cloud {
        stamp_ns: 0,
        datum_m: Vector3::zeros(),
        offsets_m: points.to_vec(),
    };
    let lattice = Lattice::new(LatticeKind::Bcc, 0.2_f64.powi(3))?;
    let mut list = MultiResolutionList::new(&lattice, Vector3::zeros(), 3, MAX_BYTES)?;
    list.insert(&cloud(map));
    let spread = Spread {
        translation_m: [4.0, 4.0, 0.4],
        rotation_rad: [0.0, 0.0, std::f64::consts::PI],
    };
    let found = search(&list, &cloud(scan), &Isometry3::identity(), &spread)?;
    let best = found.first().ok_or("the search found nothing")?;
    let prepare = |points: &[[f32; 3]]| {
        let wide = |p: &[f32; 3]| p.map(f64::from).into();
        let cloud = SemanticCloud::unlabelled(points.iter().map(wide).collect());
        PreparedCloud::new(voxel_downsample(&cloud, 0.05), &PrepareOptions::default())
    };
    let (source, target) = (prepare(scan)?, prepare(map)?);
    let mut pose = best.map_from_cloud;
    // From a wide gate to a narrow one.
    for gate_m in [0.5, 0.2, 0.1] {
        let options = RegisterOptions {
            max_iterations: 100,
            rotation_tolerance_rad: 1e-5,
            translation_tolerance_m: 1e-5,
            ..RegisterOptions::gicp(gate_m)
        };
        pose = register(&source, &target, &pose, &options).target_from_source;
    }
    Ok(pose)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_pairs_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let error = scenes(1, Some(folder.path()), &[])
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains("room_scan1.pcd"), "{error}");
        let (sources, scenes) = scenes(1, None, &[]).unwrap();
        assert_eq!((sources.len(), scenes.len()), (1, 3));
    }

    #[test]
    fn a_pair_of_files_is_a_place_with_cells_of_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let points = "0 0 0\n60 0 0\n60 70 3\n";
        for name in ["map.xyz", "scan.xyz"] {
            std::fs::write(path(name), points).unwrap();
        }
        std::fs::write(path("pose.txt"), "1 0 0 2\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").unwrap();
        let files = [["map.xyz", "scan.xyz", "pose.txt"].map(path)];
        let (sources, scenes) = scenes(1, None, &files).unwrap();
        assert_eq!((sources.len(), scenes.len()), (2, 5));
        let last = scenes.last().unwrap();
        assert_eq!(
            last.title(),
            "scan.xyz on map.xyz, 0.1 m cells, start ±0.2 m"
        );
        let pair = sources[1].pair(1, 0, 0).unwrap();
        assert_eq!(pair.map_from_scan.translation.x, 2.0);
        assert_eq!(side_of(&[]), None);
        assert_eq!(side_of(&[[1.0; 3]]), None);
    }
}
