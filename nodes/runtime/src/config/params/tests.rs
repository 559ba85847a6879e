use super::*;
use std::io::Write;

fn load(yaml: &[&str], rules: &[&str]) -> Result<Params, ParamError> {
    let files = yaml.iter().map(|text| {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        file
    });
    let files: Vec<_> = files.collect();
    let args = RosArgs {
        params_files: files.iter().map(|file| file.path().to_owned()).collect(),
        param_overrides: rules.iter().map(|rule| rule.parse().unwrap()).collect(),
        ..RosArgs::default()
    };
    Params::load(&args, "/robot/mapper")
}

#[test]
fn later_sources_win() {
    let first = "/**: {ros__parameters: {a: 1, b: 1, c: 1, d: 1}}\n/robot/mapper: {ros__parameters: {b: 2}}";
    let second = "/**: {ros__parameters: {c: 3, d: 3}}";
    let params = load(&[first, second], &["d:=4", "mapper:d:=5", "other:d:=6"]).unwrap();
    for (name, value) in [("a", 1), ("b", 2), ("c", 3), ("d", 5), ("e", -1)] {
        assert_eq!(params.i64(name, -1).unwrap(), value, "{name}");
    }
}

#[test]
fn other_nodes_parameters_are_not_ours() {
    let params = load(&["/mapper: {ros__parameters: {a: 1}}"], &["markers:b:=2"]).unwrap();
    assert!(!params.is_given("a") && !params.is_given("b"));
    assert!(params.unused().is_empty());
}

#[test]
fn readers_convert_as_rcl_does() {
    let yaml = "/**: {ros__parameters: {on: yes, mask: 010, rate: 5, speeds: [1, 2], empty: [], names: [a], ids: [0x10]}}";
    let params = load(&[yaml], &[]).unwrap();
    assert!(params.bool("on", false).unwrap());
    assert_eq!(params.i64("mask", 0).unwrap(), 8);
    assert_eq!(params.f64("rate", 0.0).unwrap(), 5.0);
    assert_eq!(params.f64_array("speeds", &[]).unwrap(), [1.0, 2.0]);
    assert_eq!(params.f64_array("empty", &[1.0]).unwrap(), [0.0; 0]);
    assert_eq!(params.string_array("names", &[]).unwrap(), ["a"]);
    assert_eq!(params.i64_array("ids", &[]).unwrap(), [16]);
    assert_eq!(params.string("frame", "map").unwrap(), "map");
}

#[test]
fn wrong_types_name_the_place() {
    fn says<T: std::fmt::Debug>(refused: Result<T, ParamError>, part: &str) {
        let error = refused.unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    let yaml = "/**: {ros__parameters: {grid: {cell: 1.5, name: 7}}}";
    let params = load(&[yaml], &["x:=.nan"]).unwrap();
    let expected = "`grid.cell` of /robot/mapper: expected an integer";
    for part in [expected, "a float 1.5", "/**.ros__parameters.grid.cell"] {
        says(params.i64("grid.cell", 0), part);
    }
    says(params.string("grid.name", ""), "quotes");
    says(params.f64("x", 0.0), "command line");
    says(params.bool("grid.cell", true), "a bool");
    says(params.f64_array("grid.cell", &[]), "a list of floats");
    says(params.string_array("grid.name", &[]), "a list of texts");
    assert!(params.declared().is_empty(), "the refused are not declared");
}

#[test]
fn a_launch_file_configures_a_node() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("params.yaml");
    let yaml = "/**:\n  ros__parameters:\n    use_sim_time: true\n    rate: 1.0\n\
                /robot/front:\n  ros__parameters:\n    rate: 2.0\n    qos: {map: {depth: 7}}\n";
    std::fs::write(&file, yaml).unwrap();
    let line = format!(
        "mapper --ros-args -r __node:=front -r __ns:=/robot --params-file {} \
         -p front:frame:=earth",
        file.display()
    );
    let args = RosArgs::parse(line.split(' ').map(str::to_owned)).unwrap();
    let fqn =
        crate::config::names::fully_qualified(&args.node_name("mapper"), &args.namespace("mapper"));
    let params = Params::load(&args, &fqn).unwrap();
    assert!(params.bool("use_sim_time", false).unwrap());
    assert_eq!(params.f64("rate", 0.0).unwrap(), 2.0);
    assert_eq!(params.string("frame", "map").unwrap(), "earth");
    assert_eq!(params.unused(), ["qos.map.depth"]);
}

#[test]
fn what_is_read_is_declared_and_the_rest_is_unused() {
    let params = load(&[], &["rate:=2.0", "tpyo:=1"]).unwrap();
    assert_eq!(params.f64("rate", 1.0).unwrap(), 2.0);
    assert!(!params.bool("use_sim_time", false).unwrap());
    assert_eq!(params.unused(), ["tpyo"]);
    let declared = params.declared();
    let rate = ("rate".to_owned(), ParamValue::F64(2.0));
    let sim_time = ("use_sim_time".to_owned(), ParamValue::Bool(false));
    assert_eq!(declared, [rate, sim_time].into());
}

#[test]
fn invalid_values_say_where_they_come_from() {
    let params = Params::from_values("/mapper", [("volume", ParamValue::F64(-1.0))]);
    let given = "parameter `volume` of /mapper = -1.0 (from the command line): too low";
    let default = "parameter `span_s` of /mapper = 2.0 (the default): too low";
    for (name, expected) in [("volume", given), ("span_s", default)] {
        params.f64(name, 2.0).unwrap();
        assert_eq!(params.invalid(name, "too low").to_string(), expected);
    }
}

#[test]
fn a_missing_file_is_an_error_with_its_name() {
    let args = RosArgs {
        params_files: vec!["/nowhere/bobcat.yaml".into()],
        ..RosArgs::default()
    };
    let error = Params::load(&args, "/mapper").unwrap_err().to_string();
    assert!(error.contains("/nowhere/bobcat.yaml"), "{error}");
}

#[test]
fn the_shipped_files_are_for_nodes_of_any_namespace_and_name() {
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/bobcat.yaml");
    let mut args = RosArgs {
        params_files: vec![shipped.into()],
        ..RosArgs::default()
    };
    let mode = |args: &RosArgs, node: &str| {
        let params = Params::load_renamed(args, node, "enu_transformer").unwrap();
        params.string("origin.mode", "none given").unwrap()
    };
    for node in [
        "/enu_transformer",
        "/robot1/enu_transformer",
        "/to_enu",
        "/robot1/to_enu",
    ] {
        assert_eq!(mode(&args, node), "fixed", "{node}");
    }
    // A file that names the node itself holds as rcl says.
    let mut own = tempfile::NamedTempFile::new().unwrap();
    let text = "/**/enu_transformer: {ros__parameters: {origin: {mode: first_fix}}}\n\
                /robot1/to_enu: {ros__parameters: {map_frame: odom}}\n";
    own.write_all(text.as_bytes()).unwrap();
    args.params_files = vec![own.path().into()];
    assert_eq!(mode(&args, "/robot1/to_enu"), "none given");
    assert_eq!(mode(&args, "/robot2/to_enu"), "first_fix");
}
