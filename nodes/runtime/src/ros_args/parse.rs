use super::{RemapRule, RosArgs, RosArgsError};
use crate::names::shown;

const SCOPE: &str = "--ros-args";
const SCOPE_END: &str = "--";

/// What may follow a flag that takes a value, and an example.
struct Value {
    expected: &'static str,
    example: &'static str,
}

const REMAP: Value = Value {
    expected: "[node:]from:=to, [node:]__node:=name or [node:]__ns:=/namespace",
    example: "points:=/velodyne_points",
};
const PARAM: Value = Value {
    expected: "[node:]name:=value with the value in YAML",
    example: "cell_volume_m3:=0.1",
};
const PARAMS_FILE: Value = Value {
    expected: "the path of a YAML file",
    example: "params/bobcat.yaml",
};
const ENCLAVE: Value = Value {
    expected: "an absolute enclave name",
    example: "/robot/mapper",
};
const LOG_LEVEL: Value = Value {
    expected: "[logger:=]level with a level of debug, info, warn, error, fatal, unset",
    example: "lattice_mapper:=debug",
};
const LOG_FILE: Value = Value {
    expected: "a file name",
    example: "mapper",
};

/// The values still to read and the flag they belong to.
struct Arguments<I> {
    rest: I,
}

impl<I: Iterator<Item = String>> Arguments<I> {
    /// The value of `flag`, turned into what it means.
    fn value<T>(
        &mut self,
        flag: &str,
        value: &Value,
        read: impl FnOnce(&str) -> Result<T, String>,
    ) -> Result<T, RosArgsError> {
        let Value { expected, example } = *value;
        let Some(argument) = self.rest.next() else {
            return Err(RosArgsError::MissingValue {
                flag: flag.to_owned(),
                expected,
                example,
            });
        };
        read(&argument).map_err(|problem| RosArgsError::Malformed {
            flag: flag.to_owned(),
            argument: shown(&argument),
            problem,
            expected,
            example,
        })
    }
}

pub(super) fn parse(argv: impl IntoIterator<Item = String>) -> Result<RosArgs, RosArgsError> {
    let mut args = RosArgs::default();
    let mut arguments = Arguments {
        rest: argv.into_iter(),
    };
    let mut in_scope = false;
    while let Some(argument) = arguments.rest.next() {
        match (in_scope, argument.as_str()) {
            (_, SCOPE) => in_scope = true,
            (true, SCOPE_END) => in_scope = false,
            (true, _) => ros_argument(&mut args, argument, &mut arguments)?,
            (false, _) => user_argument(&mut args, argument),
        }
    }
    Ok(args)
}

fn ros_argument<I: Iterator<Item = String>>(
    args: &mut RosArgs,
    flag: String,
    next: &mut Arguments<I>,
) -> Result<(), RosArgsError> {
    match flag.as_str() {
        "-r" | "--remap" => args.remaps.push(next.value(&flag, &REMAP, str::parse)?),
        "-p" | "--param" => args
            .param_overrides
            .push(next.value(&flag, &PARAM, str::parse)?),
        "--params-file" => args
            .params_files
            .push(next.value(&flag, &PARAMS_FILE, not_empty)?),
        "-e" | "--enclave" => args.enclave = Some(next.value(&flag, &ENCLAVE, enclave)?),
        "--log-level" => args
            .log_levels
            .push(next.value(&flag, &LOG_LEVEL, str::parse)?),
        "--log-config-file" => {
            args.log_config_file = Some(next.value(&flag, &LOG_FILE, not_empty)?);
            args.warnings
                .push(format!("{flag} is accepted and has no effect"));
        }
        "--log-file-name" => {
            args.log_file_name = Some(next.value(&flag, &LOG_FILE, not_empty)?);
            args.warnings
                .push(format!("{flag} is accepted and has no effect"));
        }
        "--enable-stdout-logs" => args.stdout_logs = true,
        "--disable-stdout-logs" => args.stdout_logs = false,
        "--enable-rosout-logs" => args.rosout_logs = true,
        "--disable-rosout-logs" => args.rosout_logs = false,
        "--enable-external-lib-logs" => args.external_lib_logs = true,
        "--disable-external-lib-logs" => args.external_lib_logs = false,
        _ => {
            args.warnings.push(unknown(&flag));
            args.unparsed.push(flag);
        }
    }
    Ok(())
}

/// Outside a scope rcl still takes a bare remap rule, and complains.
fn user_argument(args: &mut RosArgs, argument: String) {
    match argument.parse::<RemapRule>() {
        Ok(rule) => {
            args.warnings.push(format!(
                "the remap rule `{0}` outside {SCOPE} is deprecated; write `{SCOPE} -r {0}`",
                shown(&argument)
            ));
            args.remaps.push(rule);
        }
        Err(_) => args.user_args.push(argument),
    }
}

fn unknown(argument: &str) -> String {
    let argument = shown(argument);
    let hint = if argument.contains(":=") {
        format!("; for a remap rule write `-r {argument}`, for a parameter `-p {argument}`")
    } else {
        format!("; `{SCOPE_END}` ends the ROS arguments where yours begin")
    };
    format!("`{argument}` is no ROS argument and is left alone{hint}")
}

fn not_empty<T: From<String>>(text: &str) -> Result<T, String> {
    if text.is_empty() {
        Err("it is empty".to_owned())
    } else {
        Ok(text.to_owned().into())
    }
}

/// rcl's rule for enclaves: the tokens of a node's full name.
fn enclave(text: &str) -> Result<String, String> {
    crate::names::validate_namespace(text).map_err(|error| error.to_string())?;
    Ok(text.to_owned())
}
