//! The `--ros-args` grammar on any words.

use lattice_runtime::names::resolve_topic;
use lattice_runtime::ros_args::RosArgs;
use proptest::prelude::*;

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
