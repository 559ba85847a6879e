//! Point files that others wrote, and maps of them. Skipped where the files are absent.

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::VoxelList;
use lattice_lab::render::{RenderOptions, render_png};
use lattice_nodes::files::export::{write_centers_ply, write_mesh_ply};
use lattice_nodes::files::points::{PointFile, PointFileOptions, PointFormat, read_points};
use lattice_test::data::shared;
use nalgebra::Vector3;

fn read(name: &str) -> Option<PointFile> {
    let limits = PointFileOptions {
        max_points: 200_000,
        ..PointFileOptions::default()
    };
    shared(name).map(|path| read_points(&path, &limits).unwrap())
}

/// Lowest and highest of each coordinate, to the millimetre.
fn bounds_mm(file: &PointFile) -> [[i64; 2]; 3] {
    [0, 1, 2].map(|axis| {
        let values = file.points_m.iter().map(|p| p[axis]);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        [low, high].map(|v| (v * 1e3).round() as i64)
    })
}

#[test]
fn ply_scans_of_cloud_compare_are_read() {
    for (name, points) in [("target", 69_088), ("source", 69_792)] {
        let Some(file) = read(&format!("pairs/small_gicp/{name}.ply")) else {
            return;
        };
        assert_eq!(file.points_m.len() + file.no_returns, points);
        assert!(file.no_returns > 0, "rays without return");
        assert_eq!(file.format, PointFormat::PlyBinaryLittleEndian);
        assert_eq!(file.skipped_not_finite, 0);
    }
}

#[test]
fn a_ply_mesh_gives_its_vertices() {
    let Some(file) = read("house/small_house.ply") else {
        return;
    };
    assert_eq!(file.points_m.len(), 78_390);
    let extent = bounds_mm(&file).map(|[low, high]| high - low);
    assert!(
        extent
            .iter()
            .zip([19_000, 11_400, 3_000])
            .all(|(a, b)| (a - b).abs() < 600),
        "{extent:?}"
    );
}

#[test]
fn compressed_pcd_scans_are_read() {
    for (name, points, bounds) in [
        (
            "room_scan1",
            112_586,
            [[-13_800, 15_447], [-6_493, 7_980], [-1_352, 1_709]],
        ),
        (
            "room_scan2",
            112_624,
            [[-12_552, 12_299], [-10_919, 10_050], [-1_718, 1_882]],
        ),
    ] {
        let Some(file) = read(&format!("pairs/{name}.pcd")) else {
            return;
        };
        assert_eq!((file.points_m.len(), file.skipped_not_finite), (points, 0));
        assert_eq!(file.format, PointFormat::PcdBinaryCompressed);
        assert_eq!(bounds_mm(&file), bounds);
    }
}

#[test]
fn packed_text_is_read() {
    let Some(file) = read("indoor/octomap_scan.xyz.bz2") else {
        return;
    };
    assert_eq!(file.points_m.len(), 88_206);
    assert_eq!(file.format, PointFormat::Text);
    assert_eq!(file.points_m[0], [-0.0434742, -4.82982, 0.499645]);
}

#[test]
fn maps_go_out_and_come_back() {
    let Some(file) = read("indoor/octomap_scan.xyz.bz2") else {
        return;
    };
    let points: Vec<_> = file.points_m.iter().map(|&p| Vector3::from(p)).collect();
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.001).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 1 << 20).unwrap();
        list.insert(&Cloud::from_points(0, Vector3::zeros(), &points));
        let folder = tempfile::tempdir().unwrap();
        let create = |name| std::fs::File::create(folder.path().join(name)).unwrap();
        write_centers_ply(&list, create("centers.ply")).unwrap();
        write_mesh_ply(&list, create("mesh.ply")).unwrap();
        let limits = PointFileOptions {
            max_points: 10_000_000,
            ..PointFileOptions::default()
        };

        let centers = read_points(&folder.path().join("centers.ply"), &limits).unwrap();
        let expected = list
            .sorted()
            .into_iter()
            .map(|(key, _)| list.center_m(key).into());
        assert_eq!(
            centers.points_m,
            expected.collect::<Vec<[f64; 3]>>(),
            "{kind}"
        );

        let mesh = read_points(&folder.path().join("mesh.ply"), &limits).unwrap();
        let reach = list.lattice().covering_radius_m();
        let inset = list.lattice().packing_radius_m();
        let quantize = |p: &[f64; 3]| {
            let p = Vector3::from(*p);
            let w = list.lattice().quantize(&p).unwrap();
            (p - list.lattice().center(w)).norm()
        };
        // Corners of cells are as far from all lattice points as corners can be.
        assert!(
            mesh.points_m
                .iter()
                .map(quantize)
                .all(|d| inset < d && d < reach * 1.000_001),
            "{kind}"
        );
        let mut corners = mesh.points_m.clone();
        corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let apart = corners.windows(2).filter(|w| w[0] == w[1]).count();
        assert_eq!(apart, 0, "{kind}");

        let options = RenderOptions {
            width: 160,
            height: 90,
            ..RenderOptions::default()
        };
        let mut png = Vec::new();
        render_png(&list, &options, &mut png).unwrap();
        assert!(png.len() > 5_000, "{kind}: {} bytes", png.len());
    }
}
