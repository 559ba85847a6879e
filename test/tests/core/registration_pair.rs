//! The pair of clouds that small_gicp tests itself with.

use std::path::Path;

use lattice_core::registration::{
    PrepareOptions, PreparedCloud, RegisterOptions, SemanticCloud, register, voxel_downsample,
};
use lattice_lab::metrics::PoseError;
use lattice_nodes::files::points::{PointFileOptions, read_points};
use lattice_test::data;
use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion};

fn cloud(path: &Path) -> SemanticCloud {
    let file = read_points(path, &PointFileOptions::default()).unwrap();
    // small_gicp keeps rays without return, which are at 0 0 0.
    let no_returns = std::iter::repeat_n([0.0; 3], file.no_returns);
    let points_m = file.points_m.into_iter().chain(no_returns);
    SemanticCloud::unlabelled(points_m.map(Into::into).collect())
}

fn pose(rows: &[f64]) -> Isometry3<f64> {
    let matrix = Matrix4::from_row_slice(rows);
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let rotation = Rotation3::from_matrix(&rotation);
    let translation = Translation3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]);
    Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Answers of small_gicp 1.0.1 from PyPI: `voxelgrid_sampling` to 0.25 m, `estimate_covariances` with so
/// many neighbours, `align` with its defaults (pairs up to 1 m), one thread.
const SMALL_GICP: [(usize, [f64; 16]); 2] = [
    (
        10,
        [
            0.9998907194161507,
            0.014747998402179144,
            -0.001022628271494225,
            0.4929762738635651,
            -0.014755108161066769,
            0.9998642440982802,
            -0.007333495546444165,
            0.12686243186577673,
            0.0009143350630697576,
            0.007347783128523658,
            0.9999725866614988,
            -0.02615921807252313,
            0.0,
            0.0,
            0.0,
            1.0,
        ],
    ),
    (
        20,
        [
            0.9998882841014581,
            0.014876248945871645,
            -0.0014548312419070347,
            0.49106860956650733,
            -0.01489495523423695,
            0.9997934676448572,
            -0.013826147809203259,
            0.12957679798871805,
            0.0012488495554121835,
            0.013846272854898952,
            0.9999033558813649,
            -0.022010929690926363,
            0.0,
            0.0,
            0.0,
            1.0,
        ],
    ),
];

#[test]
fn gicp_ends_where_small_gicp_does() {
    let Some(folder) = data::shared("pairs/small_gicp") else {
        return;
    };
    let [source, target] =
        ["source.ply", "target.ply"].map(|name| voxel_downsample(&cloud(&folder.join(name)), 0.25));
    // As many as voxelgrid_sampling leaves.
    assert_eq!((source.len(), target.len()), (6167, 6147));
    let text = std::fs::read_to_string(folder.join("T_target_source.txt")).unwrap();
    let rows: Vec<f64> = text
        .split_whitespace()
        .map(|w| w.parse().unwrap())
        .collect();
    let truth = pose(&rows);
    for (neighbors, theirs) in SMALL_GICP {
        let options = PrepareOptions {
            neighbors,
            ..PrepareOptions::default()
        };
        let prepare = |cloud: &SemanticCloud| PreparedCloud::new(cloud.clone(), &options).unwrap();
        let (source, target) = (prepare(&source), prepare(&target));
        let start = Isometry3::identity();
        let found = register(&source, &target, &start, &RegisterOptions::gicp(1.0));
        assert!(found.converged);
        let apart = PoseError::between(&found.target_from_source, &pose(&theirs));
        assert!(apart.translation_m < 1e-3, "{neighbors}: {apart:?}");
        assert!(
            apart.rotation_rad < 0.01_f64.to_radians(),
            "{neighbors}: {apart:?}"
        );
        let error = PoseError::between(&found.target_from_source, &truth);
        assert!(error.translation_m < 0.05, "{neighbors}: {error:?}");
        assert!(
            error.rotation_rad < 1.5_f64.to_radians(),
            "{neighbors}: {error:?}"
        );
    }
}
