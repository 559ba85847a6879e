//! The grammar as tables: argument lines with their meaning, or the reason why they are refused.

use std::path::Path;

use log::LevelFilter;
use proptest::prelude::*;

use super::*;
use crate::config::names::RemapRule;

use crate::config::names::NameKind;
use crate::config::param_value::ParamValue;

fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

fn parse(line: &str) -> RosArgs {
    RosArgs::parse(words(line)).unwrap_or_else(|error| panic!("{line}: {error}"))
}

/// Lines, the arguments of the user in them, and those that are unknown.
const SCOPES: &str = "
    mapper                                              | mapper |
    mapper --ros-args                                   | mapper |
    mapper --ros-args --                                | mapper |
    mapper -r a:b                                       | mapper -r a:b |
    mapper --ros-args -r a:=b                           | mapper |
    mapper --ros-args --ros-args -r a:=b                | mapper |
    mapper --ros-args -r a:=b -- --                     | mapper -- |
    mapper --ros-args -- arg --ros-args                 | mapper arg |
    mapper -d --ros-args -r b:=c -- -f --ros-args -- ar | mapper -d -f ar |
    mapper --ros-args a:= -r b:=c }b:=d --my -- arg     | mapper arg | a:= }b:=d --my
    mapper --ros-args __node:=a file.yaml stdout-logs   | mapper | __node:=a file.yaml stdout-logs
    mapper --ros-args --log info --loglevel info        | mapper | --log info --loglevel info";

#[test]
fn scopes_separate_ros_arguments_from_the_users() {
    assert_eq!(parse(""), RosArgs::default());
    for row in SCOPES.trim().lines() {
        let [line, user, unknown] = row.split('|').collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let args = parse(line);
        assert_eq!(args.user_args, words(user), "{row}");
        assert_eq!(args.warnings.len(), words(unknown).len(), "{row}");
        for (warning, unknown) in args.warnings.iter().zip(words(unknown)) {
            assert!(warning.starts_with(&format!("`{unknown}`")), "{warning}");
        }
    }
}

/// Rules with the node they are for (- is all), their kind, and both names.
const NAME_RULES: &str = "
    foo:=bar                        -    Any     foo        bar
    ~/foo:=~/bar                    -    Any     ~/foo      ~/bar
    /foo/bar:=bar                   -    Any     /foo/bar   bar
    /foo123:=/bar123                -    Any     /foo123    /bar123
    node:/foo123:=/bar123           node Any     /foo123    /bar123
    node:foo:=bar                   node Any     foo        bar
    _:=kq                           -    Any     _          kq
    rostopic:=/foo/bar              -    Any     rostopic   /foo/bar
    rosservice:=baz                 -    Any     rosservice baz
    rostopic:/a:=b                  rostopic Any /a         b
    rostopic://rostopic:=rosservice -    Topic   rostopic   rosservice
    rostopic:///foo/bar:=baz        -    Topic   /foo/bar   baz
    rosservice:///foo:=baz          -    Service /foo       baz
    node:rostopic://foo:=baz        node Topic   foo        baz";

#[test]
fn name_rules() {
    for row in NAME_RULES.trim().lines() {
        let [rule, node, kind, from, to] = &words(row)[..] else {
            panic!("{row}");
        };
        for flag in ["-r", "--remap"] {
            let [remap] = &parse(&format!("--ros-args {flag} {rule}")).remaps[..] else {
                panic!("{row}");
            };
            assert_eq!(remap.node.as_deref().unwrap_or("-"), node, "{row}");
            let kind = match kind.as_str() {
                "Any" => NameKind::Any,
                "Topic" => NameKind::Topic,
                _ => NameKind::Service,
            };
            let (from, to) = (from.clone(), to.clone());
            assert_eq!(remap.target, RemapTarget::Name { kind, from, to }, "{row}");
        }
    }
}

#[test]
fn node_and_namespace_rules() {
    for (rules, name, namespace) in [
        ("", "mapper", "/"),
        ("__node:=front", "front", "/"),
        ("__name:=front", "front", "/"),
        ("mapper:__node:=front __node:=late", "front", "/"),
        ("other:__node:=front", "mapper", "/"),
        ("__node:=name123 __node:=late", "name123", "/"),
        ("__ns:=/", "mapper", "/"),
        ("__ns:=/foo/bar __ns:=/fiz", "mapper", "/foo/bar"),
        ("mapper:__ns:=/foo", "mapper", "/foo"),
        ("other:__ns:=/foo __ns:=/bar", "mapper", "/bar"),
        ("__node:=b mapper:__ns:=/x b:__ns:=/y", "b", "/y"),
    ] {
        let rules: String = words(rules).iter().map(|r| format!(" -r {r}")).collect();
        let args = parse(&format!("mapper --ros-args {rules}"));
        assert_eq!(args.node_name("mapper"), name, "{rules}");
        assert_eq!(args.namespace("mapper"), namespace, "{rules}");
    }
    let two_scopes = parse("mapper --ros-args -r __node:=a -- --ros-args -r __ns:=/b");
    assert_eq!(two_scopes.node_name("mapper"), "a");
    assert_eq!(two_scopes.namespace("mapper"), "/b");
}

#[test]
fn parameters_files_and_logs() {
    let args = parse(
        "mapper --ros-args -p a:=1 --param node:b.c:=[1.0] --params-file one.yaml -p s:=~/x \
         --params-file two.yaml -e /old --enclave /new/one --log-level debug \
         --log-level mapper:=WARN --disable-rosout-logs --disable-stdout-logs --enable-stdout-logs \
         --disable-external-lib-logs --log-config-file log.conf --log-file-name mapper",
    );
    let overrides = args.param_overrides.iter();
    let overrides = overrides.map(|rule| (rule.node.as_deref(), &*rule.name, rule.value.clone()));
    let expected = [
        (None, "a", ParamValue::I64(1)),
        (Some("node"), "b.c", ParamValue::F64Array(vec![1.0])),
        (None, "s", ParamValue::String("~/x".to_owned())),
    ];
    assert!(overrides.eq(expected));
    assert_eq!(args.params_files, ["one.yaml", "two.yaml"].map(Path::new));
    assert_eq!(args.enclave.as_deref(), Some("/new/one"));
    let levels = args.log_levels.iter();
    let levels = levels.map(|rule| (rule.logger.as_deref(), rule.level));
    assert!(levels.eq([
        (None, LevelFilter::Debug),
        (Some("mapper"), LevelFilter::Warn)
    ]));
    assert!(!args.no_stdout_logs && args.no_rosout_logs);
    assert_eq!(args.user_args, ["mapper"]);
    assert_eq!(args.warnings.len(), 1, "the log has no file of settings");
    assert!(args.no_log_file && args.log_file_name.as_deref() == Some("mapper"));
    for name in ["../mapper", ".mapper", &"m".repeat(129)] {
        let words = ["--ros-args", "--log-file-name", name].map(str::to_owned);
        assert!(RosArgs::parse(words).is_err(), "{name}");
    }
    for name in words("a a.b qos./robot/points.depth qos.~/x.depth ~/a /a/b a__b") {
        assert_eq!(
            parse(&format!("--ros-args -p {name}:=1")).param_overrides[0].name,
            name
        );
    }
    for level in words("unset debug INFO warn error Fatal robot.mapper:=Debug") {
        parse(&format!("--ros-args --log-level {level}"));
    }
}

#[test]
fn a_flag_takes_the_next_word_whatever_it_is() {
    let args = parse("--ros-args --params-file --ros-args -p a:=1");
    assert_eq!(args.params_files, [Path::new("--ros-args")]);
    assert_eq!(args.param_overrides.len(), 1);
}

#[test]
fn bare_rules_outside_a_scope_still_work_with_a_warning() {
    let args = parse("mapper points:=/velodyne_points file.mcap");
    assert_eq!(args.user_args, ["mapper", "file.mcap"]);
    assert_eq!(args.remaps.len(), 1);
    assert!(args.warnings[0].contains("--ros-args -r points:=/velodyne_points"));
}

/// Values that a flag refuses.
const MALFORMED: [(&str, &str); 3] = [
    (
        "-r",
        ":= foo:= :=bar foo foo=bar foo:bar __ns:= __ns:=foo __ns:=/foo/ __ns:=//foo __ns:=/1foo \
         __node:= __node:=/foo/bar __node:=1a __node:=a__b :__node:=nodename ~:__node:=nodename \
         /ns/node:a:=b }foo:=/bar f{oo:=/bar foo:=/b}ar {node}:=a foo:=~ ~:=foo ~foo:=bar \
         rostopic://:=rosservice rostopic::=rosservice foo:=rostopic://bar a:=b:=c a//b:=c a/:=c \
         1a:=b a__b:=c /*:=c **:=c a:=\\1 a.b:=c ä:=b -- -p",
    ),
    (
        "-p",
        ":= foo:= :=bar foo foo=bar }foo:=/bar 1a:=b a..b:=1 a:b:c:=1 foo:={a:1} foo:=[1,a] \
         foo:=[[1]] foo:=[1 foo:=*a foo:=&a foo:='a *:=1 .:=1 a.:=1 .a:=1 a//b:=1 a/:=1 /:=1 --",
    ),
    (
        "--log-level",
        "foo trace :=info mapper:= mapper:=loud a:=info:=warn --",
    ),
];

#[test]
fn malformed_values_fail_at_once() {
    let values = MALFORMED.iter().flat_map(|(flag, values)| {
        let values = values.split(' ').map(str::to_owned);
        values.map(move |value| (*flag, value))
    });
    let spaced = [("-r", "f oo:=/bar"), ("-r", "foo:=/b ar"), ("-e", "/a b")];
    let others = [("-e", ""), ("-e", "robot"), ("-e", "/robot/"), ("-e", "//")];
    let others = spaced.into_iter().chain(others);
    let empty = [("--params-file", ""), ("--log-level", "")];
    let others = others.chain(empty).chain([("--log-level", "a b:=info")]);
    let others = others.map(|(flag, value)| (flag, value.to_owned()));
    for (flag, value) in values.chain(others) {
        let argv = ["--ros-args", flag, &value].map(str::to_owned);
        let error = RosArgs::parse(argv).expect_err(&value);
        let text = error.to_string();
        let RosArgsError::Malformed {
            argument,
            problem,
            expected,
            example,
            ..
        } = error
        else {
            panic!("{flag} {value}: {text}");
        };
        assert!(text.starts_with(&format!("`{flag} {argument}`")), "{text}");
        assert!(text.contains(&format!("`{flag} {example}`")), "{text}");
        assert!(text.contains(expected) && !problem.is_empty(), "{text}");
    }
}

#[test]
fn problems_say_what_is_wrong() {
    for (rule, problem) in [
        ("points", "`:=` is missing"),
        ("points:=", "one side of `:=` is empty"),
        ("/**:=points", "wildcard"),
        ("__node:=/a/b", "`/a/b` is not a valid node name"),
        ("__ns:=robot", "robot"),
    ] {
        let found = rule.parse::<RemapRule>().unwrap_err();
        assert!(found.contains(problem), "{found}");
    }
}

#[test]
fn flags_at_the_end_need_their_value() {
    for flag in words(
        "-r --remap -p --param --params-file -e --enclave --log-level --log-config-file \
         --log-file-name",
    ) {
        let error = RosArgs::parse(words(&format!("mapper --ros-args {flag}"))).unwrap_err();
        let text = error.to_string();
        let RosArgsError::MissingValue {
            expected, example, ..
        } = error
        else {
            panic!("{text}")
        };
        assert!(text.contains(&flag) && text.contains(expected), "{text}");
        // The example in the message is itself right.
        parse(&format!("mapper --ros-args {flag} {example}"));
    }
}

/// A word that is often close to something the grammar knows.
fn word() -> impl Strategy<Value = String> {
    let known = words(
        "--ros-args -- -r --remap -p --param --params-file -e --log-level --log-config-file \
         --disable-rosout-logs __ns:=/a __node:=b a:=b a:=[1,2]",
    );
    prop_oneof![
        proptest::sample::select(known),
        "[a-z0-9_~/:=.{}*\\[\\]'\" -]{0,12}",
        "\\PC{0,12}",
        any::<String>(),
    ]
}

proptest! {
    #[test]
    fn no_command_line_panics(argv in proptest::collection::vec(word(), 0..12)) {
        match RosArgs::parse(argv.clone()) {
            Ok(args) => {
                let kept = args.user_args.len() + args.remaps.len() + args.param_overrides.len()
                    + args.params_files.len() + args.log_levels.len();
                prop_assert!(kept <= argv.len());
                let name = args.node_name("mapper");
                let namespace = args.namespace("mapper");
                for topic in ["points", "~/map", "/tf"] {
                    let kind = NameKind::Topic;
                    let full = crate::config::names::resolve(kind, topic, &name, &namespace, &args.remaps);
                    prop_assert!(full.is_ok());
                }
            }
            Err(error) => prop_assert!(error.to_string().contains("for example")),
        }
    }

    #[test]
    fn words_outside_a_scope_are_left_alone(argv in proptest::collection::vec("[a-zA-Z0-9=./_-]{0,12}", 0..12)) {
        let args = RosArgs::parse(argv.clone()).unwrap();
        prop_assert_eq!(args.user_args, argv);
    }
}
