//! The `--ros-args` grammar as a table: argument lines against their meaning.

mod refused;

use lattice_runtime::{
    names::{resolve_service, resolve_topic},
    params::{ParamValue, Params},
    ros_args::{LogLevel, NameKind, RemapTarget, RosArgs},
};

/// Splits at spaces.
fn words(line: &str) -> Vec<String> {
    line.split(' ')
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

fn parse(line: &str) -> RosArgs {
    RosArgs::parse(words(line)).unwrap_or_else(|error| panic!("{line}: {error}"))
}

#[test]
fn scopes_separate_ros_arguments_from_the_users() {
    for (line, user, unparsed) in [
        ("", "", ""),
        ("mapper", "mapper", ""),
        ("mapper --ros-args", "mapper", ""),
        ("mapper --ros-args --", "mapper", ""),
        ("mapper -r a:b", "mapper -r a:b", ""),
        ("mapper --ros-args -r a:=b", "mapper", ""),
        ("mapper --ros-args --ros-args -r a:=b", "mapper", ""),
        ("mapper --ros-args -r a:=b -- --", "mapper --", ""),
        ("mapper --ros-args -- arg --ros-args", "mapper arg", ""),
        (
            "mapper -d --ros-args -r __ns:=/foo -- --foo=bar --ros-args -p a:=b -- arg",
            "mapper -d --foo=bar arg",
            "",
        ),
        (
            "mapper --ros-args a:= -r b:=c }b:=d --custom -- arg",
            "mapper arg",
            "a:= }b:=d --custom",
        ),
        (
            "mapper --ros-args __node:=a file.yaml stdout-logs",
            "mapper",
            "__node:=a file.yaml stdout-logs",
        ),
        (
            "mapper --ros-args --log info --loglevel info",
            "mapper",
            "--log info --loglevel info",
        ),
    ] {
        let args = parse(line);
        assert_eq!(args.user_args, words(user), "{line}");
        assert_eq!(args.unparsed, words(unparsed), "{line}");
        assert_eq!(
            args.warnings.len(),
            args.unparsed.len(),
            "one warning each: {line}"
        );
    }
}

#[test]
fn name_rules() {
    use NameKind::{Any, Service, Topic};
    for (rule, node, kind, from, to) in [
        ("foo:=bar", None, Any, "foo", "bar"),
        ("~/foo:=~/bar", None, Any, "~/foo", "~/bar"),
        ("/foo/bar:=bar", None, Any, "/foo/bar", "bar"),
        ("/foo123:=/bar123", None, Any, "/foo123", "/bar123"),
        (
            "node:/foo123:=/bar123",
            Some("node"),
            Any,
            "/foo123",
            "/bar123",
        ),
        ("node:foo:=bar", Some("node"), Any, "foo", "bar"),
        ("_:=kq", None, Any, "_", "kq"),
        ("rostopic:=/foo/bar", None, Any, "rostopic", "/foo/bar"),
        ("rosservice:=baz", None, Any, "rosservice", "baz"),
        (
            "rostopic://rostopic:=rosservice",
            None,
            Topic,
            "rostopic",
            "rosservice",
        ),
        ("rostopic:///foo/bar:=baz", None, Topic, "/foo/bar", "baz"),
        ("rosservice:///foo:=baz", None, Service, "/foo", "baz"),
        (
            "node:rostopic://foo:=baz",
            Some("node"),
            Topic,
            "foo",
            "baz",
        ),
    ] {
        for flag in ["-r", "--remap"] {
            let args = parse(&format!("--ros-args {flag} {rule}"));
            assert_eq!(args.remaps.len(), 1, "{rule}");
            assert_eq!(args.remaps[0].node.as_deref(), node, "{rule}");
            let (from, to) = (from.to_owned(), to.to_owned());
            assert_eq!(
                args.remaps[0].target,
                RemapTarget::Name { kind, from, to },
                "{rule}"
            );
        }
    }
}

#[test]
fn node_and_namespace_rules() {
    for (rules, name, namespace) in [
        ("", "mapper", "/"),
        ("-r __node:=front", "front", "/"),
        ("-r __name:=front", "front", "/"),
        ("-r mapper:__node:=front", "front", "/"),
        ("-r other:__node:=front", "mapper", "/"),
        ("-r __node:=nodename123 -r __node:=late", "nodename123", "/"),
        ("-r __ns:=/", "mapper", "/"),
        ("-r __ns:=/foo/bar -r __ns:=/fiz", "mapper", "/foo/bar"),
        ("-r mapper:__ns:=/foo", "mapper", "/foo"),
        ("-r other:__ns:=/foo -r __ns:=/bar", "mapper", "/bar"),
        (
            "-r __node:=front -- --ros-args -r __ns:=/robot",
            "front",
            "/robot",
        ),
    ] {
        let args = parse(&format!("mapper --ros-args {rules}"));
        assert_eq!(args.node_name("mapper"), name, "{rules}");
        assert_eq!(args.namespace("mapper"), namespace, "{rules}");
    }
}

#[test]
fn parameters_files_and_logs() {
    let args = parse(
        "mapper --ros-args -p a:=1 --param node:b.c:=[1.0] --params-file one.yaml -p s:=~/x \
         --params-file two.yaml -e /old --enclave /new/one --log-level debug \
         --log-level mapper:=WARN --disable-rosout-logs --disable-stdout-logs --enable-stdout-logs \
         --disable-external-lib-logs --log-config-file log.conf --log-file-name mapper",
    );
    let overrides: Vec<_> = args
        .param_overrides
        .iter()
        .map(|rule| (rule.node.as_deref(), rule.name.as_str(), rule.value.clone()))
        .collect();
    let expected = [
        (None, "a", ParamValue::I64(1)),
        (Some("node"), "b.c", ParamValue::F64Array(vec![1.0])),
        (None, "s", ParamValue::String("~/x".to_owned())),
    ];
    assert_eq!(overrides, expected);
    assert_eq!(
        args.params_files,
        [
            std::path::Path::new("one.yaml"),
            std::path::Path::new("two.yaml")
        ]
    );
    assert_eq!(args.enclave.as_deref(), Some("/new/one"));
    let levels: Vec<_> = args
        .log_levels
        .iter()
        .map(|rule| (rule.logger.as_deref(), rule.level))
        .collect();
    assert_eq!(
        levels,
        [(None, LogLevel::Debug), (Some("mapper"), LogLevel::Warn)]
    );
    assert_eq!(
        (args.stdout_logs, args.rosout_logs, args.external_lib_logs),
        (true, false, false)
    );
    assert_eq!(args.log_config_file.as_deref(), Some("log.conf"));
    assert_eq!(args.log_file_name.as_deref(), Some("mapper"));
    assert_eq!(args.user_args, ["mapper"]);
    assert!(args.unparsed.is_empty());
}

#[test]
fn a_flag_takes_the_next_word_whatever_it_is() {
    let args = parse("--ros-args --params-file --ros-args -p a:=1");
    assert_eq!(args.params_files, [std::path::Path::new("--ros-args")]);
    assert_eq!(args.param_overrides.len(), 1);
}

#[test]
fn bare_rules_outside_a_scope_still_work_with_a_warning() {
    let args = parse("mapper points:=/velodyne_points file.mcap");
    assert_eq!(args.user_args, ["mapper", "file.mcap"]);
    assert_eq!(args.remaps.len(), 1);
    assert!(
        args.warnings[0].contains("--ros-args -r points:=/velodyne_points"),
        "{:?}",
        args.warnings
    );
}

#[test]
fn a_launch_file_configures_a_node() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("params.yaml");
    let yaml = "/**:\n  ros__parameters:\n    use_sim_time: true\n    rate: 1.0\n\
                /robot/front:\n  ros__parameters:\n    rate: 2.0\n    qos: {map: {depth: 7}}\n";
    std::fs::write(&file, yaml).unwrap();
    let line = format!(
        "mapper --ros-args -r __node:=front -r __ns:=/robot --params-file {} -r points:=/velodyne_points \
         -r rosservice://~/reset:=~/clear -p front:frame:=earth",
        file.display()
    );
    let args = parse(&line);
    let (name, namespace) = (args.node_name("mapper"), args.namespace("mapper"));
    let topic = |topic| resolve_topic(topic, &name, &namespace, &args.remaps).unwrap();
    assert_eq!(topic("points"), "/velodyne_points");
    assert_eq!(topic("map"), "/robot/map");
    assert_eq!(topic("~/reset"), "/robot/front/reset");
    let service = resolve_service("~/reset", &name, &namespace, &args.remaps);
    assert_eq!(service.unwrap(), "/robot/front/clear");
    let params = Params::load(&args, "/robot/front").unwrap();
    assert!(params.bool("use_sim_time", false).unwrap());
    assert_eq!(params.f64("rate", 0.0).unwrap(), 2.0);
    assert_eq!(params.string("frame", "map").unwrap(), "earth");
    assert_eq!(params.unused(), ["qos.map.depth"]);
}
