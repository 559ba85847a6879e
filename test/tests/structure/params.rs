//! Parameter files have every parameter of the nodes, and no other; what they say of them is what the code
//! declares.

use std::collections::BTreeMap;

use lattice_core::pose::Axes;
use lattice_lab::datasets;
use lattice_nodes::bag_player;
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::executables::PARAMETERS;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::semantic_icp_server::ServerOptions;
use lattice_runtime::params::{ParamValue, Params};
use lattice_runtime::ros_args::RosArgs;

use super::root;

fn params(file: &str, node: &str) -> Params {
    let file = root().join("params").join(file).display().to_string();
    let arguments = ["--ros-args", "--params-file", &file].map(str::to_owned);
    Params::load(&RosArgs::parse(arguments).unwrap(), node).unwrap()
}

/// Every node with the file that has all its parameters.
fn nodes() -> impl Iterator<Item = (&'static str, &'static str, Params)> {
    let player = (bag_player::NAME, bag_player::declare as _);
    let all = PARAMETERS.iter().copied().chain([player]);
    all.map(|(node, declare)| {
        let file = match node {
            "segmenter" => "segmenter.yaml",
            "semantic_cloud" => "rgbd.yaml",
            "headset_cloud" => "headset.yaml",
            "lidar_odometry" => "lidar_odometry.yaml",
            "map_merger" => "map_merger.yaml",
            "map_projector" => "map_projector.yaml",
            "semantic_icp_server" => "semantic_icp.yaml",
            "viewer_server" => "viewer.yaml",
            _ => "bobcat.yaml",
        };
        let params = params(file, &format!("/robot/{node}"));
        declare(&params).unwrap();
        (file, node, params)
    })
}

/// Comments of the parameters of a node in a file, by full name.
fn comments(file: &str, node: &str) -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(root().join("params").join(file)).unwrap();
    let mut found = BTreeMap::new();
    let (mut path, mut comment) = (Vec::new(), String::new());
    let lines = text.lines();
    let lines = lines.skip_while(|line| *line != format!("/**/{node}:"));
    for line in lines.skip(2).take_while(|line| !line.starts_with("/**")) {
        let depth = (line.len() - line.trim_start().len()) / 2;
        if let Some(more) = line.trim_start().strip_prefix("# ") {
            comment = format!("{comment} {more}").trim_start().to_owned();
        } else if let Some((key, value)) = line.trim_start().split_once(':') {
            path.truncate(depth.saturating_sub(2));
            path.push(key);
            let comment = std::mem::take(&mut comment);
            if !value.is_empty() {
                found.insert(path.join("."), comment);
            }
        }
    }
    found
}

#[test]
fn the_files_have_every_parameter_and_no_other() {
    for (file, node, params) in nodes() {
        assert_eq!(params.unused(), [""; 0], "{file}: {node}");
        let declared = params.declared().into_keys();
        let missing: Vec<_> = declared.filter(|name| !params.is_given(name)).collect();
        assert_eq!(missing, [""; 0], "{file}: {node}");
    }
}

#[test]
fn the_files_say_what_the_code_declares() {
    for (file, node, params) in nodes() {
        let comments = comments(file, node);
        for (name, declared) in params.described() {
            let comment = comments.get(&name).map_or("", String::as_str);
            let (says, here) = comment.split_once(" Here: ").unwrap_or((comment, ""));
            assert_eq!(says, declared.text(), "{file}: {node}: {name}");
            let is_default = declared.value == declared.default;
            assert!(
                is_default || !here.is_empty(),
                "{file}: {node}: {name}: the default is {}",
                declared.default
            );
        }
    }
}

#[test]
fn every_parameter_is_described_with_its_unit() {
    let units = "_m _s _hz _rad _deg _m3 _per_s".split(' ');
    let units: Vec<_> = units.collect();
    let numbers = "robability hare raction pacity likelihood scale seconds".split(' ');
    let numbers: Vec<_> = numbers.collect();
    for (_, node, params) in nodes() {
        for (name, declared) in params.described() {
            let text = declared.text();
            assert!(text.ends_with('.'), "{node}: {name} is not described");
            let has_unit = units.iter().any(|unit| name.ends_with(unit));
            if matches!(declared.default, ParamValue::F64(_)) && !has_unit {
                let is_number = numbers.iter().any(|word| text.contains(word));
                assert!(is_number, "{node}: the unit of {name}");
            }
        }
    }
}

#[test]
fn the_headset_has_a_map_with_labels() {
    for file in ["semantic_icp.yaml", "headset.yaml"] {
        let params = params(file, "/lattice_mapper");
        let options = MapperOptions::from_params(&params).unwrap();
        assert!(options.labels.is_some() && params.unused().is_empty());
    }
    // The clouds of headset_cloud have the axes of ROS.
    let params = params("headset.yaml", "/semantic_icp_server");
    let options = ServerOptions::from_params(&params).unwrap();
    assert_eq!(options.semantic.axes, Axes::RosFlu);
    assert!(params.unused().is_empty());
}

#[test]
fn the_file_in_place_of_octomap_server_has_parameters_that_there_are() {
    for (node, name) in [
        ("enu_transformer", "enu_transformer"),
        ("lattice_mapper", "octomap_server"),
        ("voxel_marker_publisher", "voxel_marker_publisher"),
    ] {
        let mut nodes = PARAMETERS.iter();
        let (_, declare) = nodes.find(|(known, _)| *known == node).unwrap();
        let params = params("octomap_compat.yaml", &format!("/robot/{name}"));
        declare(&params).unwrap();
        assert_eq!(params.unused(), [""; 0], "{name}");
    }
}

#[test]
fn the_parameter_file_fits_the_simulated_loader() {
    let params = params("bobcat.yaml", "/enu_transformer");
    let options = TransformerOptions::from_params(&params).unwrap();
    assert_eq!(options.ins.origin, datasets::bobcat_origin().ok());
    assert_eq!(options.ins.leap_seconds, datasets::BOBCAT_LEAP_SECONDS);
    let lever_arm_m: [f64; 3] = options.ins.lever_arm_m.unwrap().into();
    assert_eq!(lever_arm_m, lattice_lab::simulate::BASE_FROM_IMU_M);
    assert_eq!(
        params.string("ins.topic", "").unwrap(),
        datasets::INSPVAX_TOPIC
    );
    let topics = params.string_array("points_topics", &[]).unwrap();
    let lasers = lattice_lab::simulate::Laser::ALL.map(datasets::points_topic);
    assert_eq!(topics, lasers);
}
