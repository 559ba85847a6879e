//! Argument lines that are refused with a reason and an example, and lines of random words.

use lattice_runtime::{
    names::resolve_topic,
    ros_args::{RosArgs, RosArgsError},
};
use proptest::prelude::*;

use super::{parse, words};

fn refuse(line: &str) -> RosArgsError {
    match RosArgs::parse(words(line)) {
        Ok(args) => panic!("{line} was accepted: {args:?}"),
        Err(error) => error,
    }
}

#[test]
fn malformed_values_fail_at_once() {
    for (flag, values) in [
        (
            "-r",
            &[
                ":=",
                "foo:=",
                ":=bar",
                "foo",
                "foo=bar",
                "foo:bar",
                "__ns:=",
                "__ns:=foo",
                "__ns:=/foo/",
                "__ns:=//foo",
                "__ns:=/1foo",
                "__node:=",
                "__node:=/foo/bar",
                "__node:=1a",
                "__node:=a__b",
                ":__node:=nodename",
                "~:__node:=nodename",
                "/ns/node:a:=b",
                "}foo:=/bar",
                "f{oo:=/bar",
                "foo:=/b}ar",
                "{node}:=a",
                "foo:=~",
                "~:=foo",
                "~foo:=bar",
                "rostopic://:=rosservice",
                "rostopic::=rosservice",
                "foo:=rostopic://bar",
                "a:=b:=c",
                "a//b:=c",
                "a/:=c",
                "1a:=b",
                "a__b:=c",
                "/*:=c",
                "**:=c",
                "a:=\\1",
                "a.b:=c",
                "ä:=b",
                "--",
                "-p",
            ][..],
        ),
        (
            "-p",
            &[
                ":=",
                "foo:=",
                ":=bar",
                "foo",
                "foo=bar",
                "}foo:=/bar",
                "1a:=b",
                "a..b:=1",
                "a:b:c:=1",
                "foo:={a:1}",
                "foo:=[1,a]",
                "foo:=[[1]]",
                "foo:=[1",
                "foo:=*a",
                "foo:=&a",
                "foo:='a",
                "*:=1",
                "--",
            ][..],
        ),
        (
            "--log-level",
            &[
                "foo",
                "trace",
                ":=info",
                "mapper:=",
                "mapper:=loud",
                "a:=info:=warn",
                "--",
            ][..],
        ),
        ("-e", &["", "robot", "/robot/", "//", "/a b"][..]),
        ("--params-file", &[""][..]),
    ] {
        for value in values {
            let argv = ["--ros-args", flag, value].map(str::to_owned);
            let Err(error) = RosArgs::parse(argv) else {
                panic!("{flag} {value} was accepted")
            };
            let text = error.to_string();
            let RosArgsError::Malformed {
                argument,
                expected,
                example,
                problem,
                ..
            } = error
            else {
                panic!("{flag} {value}: {text}");
            };
            assert!(text.contains(&format!("`{flag} {argument}`")), "{text}");
            assert!(
                text.contains(expected) && text.contains(&format!("`{flag} {example}`")),
                "{text}"
            );
            assert!(!problem.is_empty());
        }
    }
    for spaced in ["f oo:=/bar", "foo:=/b ar"] {
        let argv = ["--ros-args", "-r", spaced].map(str::to_owned);
        assert!(RosArgs::parse(argv).is_err(), "{spaced}");
    }
}

#[test]
fn flags_at_the_end_need_their_value() {
    for flag in [
        "-r",
        "--remap",
        "-p",
        "--param",
        "--params-file",
        "-e",
        "--enclave",
        "--log-level",
        "--log-config-file",
        "--log-file-name",
    ] {
        let error = refuse(&format!("mapper --ros-args {flag}"));
        let text = error.to_string();
        let RosArgsError::MissingValue {
            expected, example, ..
        } = error
        else {
            panic!("{text}")
        };
        assert!(text.contains(flag) && text.contains(expected), "{text}");
        // The example in the message is itself right.
        let _ = parse(&format!("mapper --ros-args {flag} {example}"));
    }
}

/// A word that is often close to something the grammar knows.
fn word() -> impl Strategy<Value = String> {
    prop_oneof![
        proptest::sample::select(vec![
            "--ros-args",
            "--",
            "-r",
            "--remap",
            "-p",
            "--param",
            "--params-file",
            "-e",
            "--log-level",
            "--log-config-file",
            "--disable-rosout-logs",
            "__ns:=/a",
            "__node:=b",
            "a:=b",
            "a:=[1, 2]",
        ])
        .prop_map(str::to_owned),
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
                let kept = args.user_args.len() + args.unparsed.len() + args.remaps.len()
                    + args.param_overrides.len() + args.params_files.len() + args.log_levels.len();
                prop_assert!(kept <= argv.len());
                let name = args.node_name("mapper");
                let namespace = args.namespace("mapper");
                for topic in ["points", "~/map", "/tf"] {
                    prop_assert!(resolve_topic(topic, &name, &namespace, &args.remaps).is_ok());
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
