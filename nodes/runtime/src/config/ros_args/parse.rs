use super::{RosArgs, RosArgsError};
use crate::config::names::{RemapRule, shown, validate_namespace};

const SCOPE: &str = "--ros-args";
const SCOPE_END: &str = "--";

/// Form of the value of a flag, and an example.
#[derive(Clone, Copy)]
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

/// Parses the value that follows `flag`.
fn value<T>(
    rest: &mut impl Iterator<Item = String>,
    flag: &str,
    Value { expected, example }: Value,
    read: impl FnOnce(&str) -> Result<T, String>,
) -> Result<T, RosArgsError> {
    let flag = flag.to_owned();
    let Some(argument) = rest.next() else {
        return Err(RosArgsError::MissingValue {
            flag,
            expected,
            example,
        });
    };
    read(&argument).map_err(|problem| RosArgsError::Malformed {
        flag,
        argument: shown(&argument),
        problem,
        expected,
        example,
    })
}

pub(super) fn parse(argv: impl IntoIterator<Item = String>) -> Result<RosArgs, RosArgsError> {
    let mut args = RosArgs::default();
    let mut rest = argv.into_iter();
    let mut in_scope = false;
    while let Some(argument) = rest.next() {
        match (in_scope, argument.as_str()) {
            (_, SCOPE) => in_scope = true,
            (true, SCOPE_END) => in_scope = false,
            (true, flag) => ros_argument(&mut args, flag, &mut rest)?,
            (false, _) => user_argument(&mut args, argument),
        }
    }
    Ok(args)
}

fn ros_argument(
    args: &mut RosArgs,
    flag: &str,
    rest: &mut impl Iterator<Item = String>,
) -> Result<(), RosArgsError> {
    match flag {
        "-r" | "--remap" => args.remaps.push(value(rest, flag, REMAP, str::parse)?),
        "-p" | "--param" => (args.param_overrides).push(value(rest, flag, PARAM, str::parse)?),
        "--params-file" => (args.params_files).push(value(rest, flag, PARAMS_FILE, not_empty)?),
        "-e" | "--enclave" => args.enclave = Some(value(rest, flag, ENCLAVE, enclave)?),
        "--log-level" => (args.log_levels).push(value(rest, flag, LOG_LEVEL, str::parse)?),
        "--log-file-name" => args.log_file_name = Some(value(rest, flag, LOG_FILE, file_name)?),
        "--log-config-file" => {
            let file: String = value(rest, flag, LOG_FILE, not_empty)?;
            let file = shown(&file);
            let warning =
                format!("{flag} {file} has no effect: use --log-level, and README's variables");
            args.warnings.push(warning);
        }
        "--enable-stdout-logs" => args.no_stdout_logs = false,
        "--disable-stdout-logs" => args.no_stdout_logs = true,
        "--enable-rosout-logs" => args.no_rosout_logs = false,
        "--disable-rosout-logs" => args.no_rosout_logs = true,
        "--enable-external-lib-logs" => args.no_log_file = false,
        "--disable-external-lib-logs" => args.no_log_file = true,
        _ => args.warnings.push(unknown(flag)),
    }
    Ok(())
}

/// Handles an argument outside the scope: rcl accepts a bare remap rule with a warning.
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
    format!("`{argument}` is not a ROS argument and is ignored{hint}")
}

fn not_empty<T: From<String>>(text: &str) -> Result<T, String> {
    match text.is_empty() {
        true => Err("it is empty".to_owned()),
        false => Ok(text.to_owned().into()),
    }
}

/// Validates a log file name: no folder, and not hidden.
fn file_name(text: &str) -> Result<String, String> {
    match text.contains('/') || text.starts_with('.') || text.len() > 128 {
        true => Err("it is not a plain file name of at most 128 bytes".to_owned()),
        false => not_empty(text),
    }
}

/// Validates an enclave by the rule of rcl: tokens of a node's full name.
fn enclave(text: &str) -> Result<String, String> {
    validate_namespace(text).map_err(|error| error.to_string())?;
    Ok(text.to_owned())
}
