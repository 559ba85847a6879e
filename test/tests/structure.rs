//! Rules of the architecture that the compiler does not know.

use std::path::Path;
use std::process::Command;

use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::runtime::params::Params;
use lattice_nodes::runtime::ros_args::RosArgs;
use lattice_nodes::semantic_icp_server::ServerOptions;
use lattice_nodes::simulate;
use lattice_nodes::voxel_marker_publisher::MarkerOptions;
use serde_json::Value;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

#[test]
fn dependencies_point_one_way() {
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--no-deps",
            "--format-version",
            "1",
            "--offline",
        ])
        .current_dir(root())
        .output()
        .unwrap();
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert_eq!(packages.len(), 4);
    for package in packages {
        let name = package["name"].as_str().unwrap();
        let allowed: &[&str] = match name {
            "lattice_core" | "lattice_msgs" => &[],
            "lattice_nodes" => &["lattice_core", "lattice_msgs"],
            _ => &["lattice_core", "lattice_msgs", "lattice_nodes"],
        };
        for dependency in package["dependencies"].as_array().unwrap() {
            let on = dependency["name"].as_str().unwrap();
            let ours = on.starts_with("lattice_");
            assert!(!ours || allowed.contains(&on), "{name} depends on {on}");
            let ros = ["ros2-client", "rustdds"].contains(&on);
            let may = ["lattice_nodes", "lattice_test"].contains(&name);
            assert!(!ros || may, "{name} depends on {on}");
        }
    }
}

fn params(file: &str, node: &str) -> Params {
    let file = root().join("params").join(file).display().to_string();
    let arguments = ["--ros-args", "--params-file", &file].map(str::to_owned);
    Params::load(&RosArgs::parse(arguments).unwrap(), node).unwrap()
}

#[test]
fn parameter_files_name_only_what_nodes_read() {
    for namespace in ["", "/robot"] {
        let params = params("bobcat.yaml", &format!("{namespace}/enu_transformer"));
        TransformerOptions::from_params(&params).unwrap();
        let shell = [
            "inbox_events",
            "ins.imu_topic",
            "ins.topic",
            "points_topics",
            "report_file",
            "threads",
        ];
        assert_eq!(params.unused(), shell);
        let params = self::params("bobcat.yaml", &format!("{namespace}/lattice_mapper"));
        MapperOptions::from_params(&params).unwrap();
        let shell = [
            "centers_period_s",
            "inbox_bytes",
            "inbox_events",
            "report_file",
            "threads",
            "update_period_s",
        ];
        assert_eq!(params.unused(), shell);
        let params = self::params(
            "bobcat.yaml",
            &format!("{namespace}/voxel_marker_publisher"),
        );
        MarkerOptions::from_params(&params).unwrap();
        let shell = [
            "inbox_bytes",
            "inbox_events",
            "mapper",
            "max_bytes_per_s",
            "rate_hz",
            "report_file",
            "threads",
        ];
        assert_eq!(params.unused(), shell);
    }
}

#[test]
fn every_parameter_is_in_the_file_for_the_simulated_loader() {
    let declared = |params: &Params| {
        let names = params.declared().into_iter().map(|declared| declared.name);
        names
            .filter(|name| !params.is_given(name))
            .collect::<Vec<_>>()
    };
    let params = params("bobcat.yaml", "/enu_transformer");
    TransformerOptions::from_params(&params).unwrap();
    assert_eq!(declared(&params), Vec::<String>::new());
    let params = self::params("bobcat.yaml", "/lattice_mapper");
    MapperOptions::from_params(&params).unwrap();
    assert_eq!(declared(&params), Vec::<String>::new());
    let params = self::params("bobcat.yaml", "/voxel_marker_publisher");
    MarkerOptions::from_params(&params).unwrap();
    assert_eq!(declared(&params), Vec::<String>::new());
}

#[test]
fn the_file_for_a_headset_has_every_parameter_and_its_default() {
    let params = params("semantic_icp.yaml", "/robot/semantic_icp_server");
    let options = ServerOptions::from_params(&params).unwrap();
    assert_eq!(
        format!("{options:?}"),
        format!("{:?}", ServerOptions::default())
    );
    let shell = [
        "inbox_bytes",
        "inbox_events",
        "mapper",
        "tf_rate_hz",
        "threads",
    ];
    assert_eq!(params.unused(), shell);
    let declared = params.declared().into_iter().map(|d| d.name);
    let missing: Vec<_> = declared.filter(|name| !params.is_given(name)).collect();
    assert_eq!(missing, Vec::<String>::new());
    let params = self::params("semantic_icp.yaml", "/lattice_mapper");
    let options = MapperOptions::from_params(&params).unwrap();
    assert!(options.labels.is_some() && params.unused().is_empty());
}

#[test]
fn the_parameter_file_fits_the_simulated_loader() {
    let params = params("bobcat.yaml", "/enu_transformer");
    let options = TransformerOptions::from_params(&params).unwrap();
    assert_eq!(options.ins.origin, simulate::bobcat_origin().ok());
    assert_eq!(options.ins.leap_seconds, simulate::BOBCAT_LEAP_SECONDS);
    let lever_arm_m: [f64; 3] = options.ins.mount.lever_arm_m.into();
    assert_eq!(lever_arm_m, lattice_core::simulate::BASE_FROM_IMU_M);
    assert_eq!(
        params.string("ins.topic", "").unwrap(),
        simulate::INSPVAX_TOPIC
    );
    let topics = params.string_array("points_topics", &[]).unwrap();
    let lasers = lattice_core::simulate::Laser::ALL.map(simulate::points_topic);
    assert_eq!(topics, lasers);
}
