//! Parameter files have every parameter of the nodes, and no other.

use lattice_lab::datasets;
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::semantic_icp_server::ServerOptions;
use lattice_nodes::voxel_marker_publisher::MarkerOptions;
use lattice_runtime::params::Params;
use lattice_runtime::ros_args::RosArgs;

use super::root;

fn params(file: &str, node: &str) -> Params {
    let file = root().join("params").join(file).display().to_string();
    let arguments = ["--ros-args", "--params-file", &file].map(str::to_owned);
    Params::load(&RosArgs::parse(arguments).unwrap(), node).unwrap()
}

/// Reader of the options of a node.
type ReadOptions = fn(&Params);

/// A node of the loader, what reads its options, and the parameters that its shell reads.
const NODES: [(&str, ReadOptions, &str); 3] = [
    (
        "enu_transformer",
        |params| _ = TransformerOptions::from_params(params).unwrap(),
        "inbox_events ins.imu_topic ins.topic points_topics report_file threads",
    ),
    (
        "lattice_mapper",
        |params| _ = MapperOptions::from_params(params).unwrap(),
        "autosave_file autosave_period_s centers_period_s free_period_s inbox_bytes inbox_events \
         map_dir octomap_services report_file resume \
         threads update_period_s",
    ),
    (
        "voxel_marker_publisher",
        |params| _ = MarkerOptions::from_params(params).unwrap(),
        "inbox_bytes inbox_events mapper max_bytes_per_s rate_hz report_file threads",
    ),
];

fn missing(params: &Params) -> Vec<String> {
    let declared = params.declared().into_keys();
    declared.filter(|name| !params.is_given(name)).collect()
}

#[test]
fn the_file_for_the_simulated_loader_has_every_parameter_and_no_other() {
    for (node, read, shell) in NODES {
        for namespace in ["", "/robot"] {
            let params = params("bobcat.yaml", &format!("{namespace}/{node}"));
            read(&params);
            assert_eq!(params.unused().join(" "), shell);
            assert_eq!(missing(&params), Vec::<String>::new());
        }
    }
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
    assert_eq!(missing(&params), Vec::<String>::new());
    let params = self::params("semantic_icp.yaml", "/lattice_mapper");
    let options = MapperOptions::from_params(&params).unwrap();
    assert!(options.labels.is_some() && params.unused().is_empty());
}

#[test]
fn the_file_in_place_of_octomap_server_has_parameters_that_there_are() {
    let names = [
        "enu_transformer",
        "octomap_server",
        "voxel_marker_publisher",
    ];
    for ((_, read, shell), name) in NODES.into_iter().zip(names) {
        let params = params("octomap_compat.yaml", &format!("/robot/{name}"));
        read(&params);
        for unused in params.unused() {
            assert!(
                shell.split(' ').any(|known| known == unused),
                "{name}: {unused}"
            );
        }
    }
}

#[test]
fn the_parameter_file_fits_the_simulated_loader() {
    let params = params("bobcat.yaml", "/enu_transformer");
    let options = TransformerOptions::from_params(&params).unwrap();
    assert_eq!(options.ins.origin, datasets::bobcat_origin().ok());
    assert_eq!(options.ins.leap_seconds, datasets::BOBCAT_LEAP_SECONDS);
    let lever_arm_m: [f64; 3] = options.ins.mount.lever_arm_m.into();
    assert_eq!(lever_arm_m, lattice_lab::simulate::BASE_FROM_IMU_M);
    assert_eq!(
        params.string("ins.topic", "").unwrap(),
        datasets::INSPVAX_TOPIC
    );
    let topics = params.string_array("points_topics", &[]).unwrap();
    let lasers = lattice_lab::simulate::Laser::ALL.map(datasets::points_topic);
    assert_eq!(topics, lasers);
}
