//! Log and parameters of nodes.

use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;

use crate::builtin_interfaces::Time;
use crate::interface::messages;
use crate::interface::services;

messages! {
    "rcl_interfaces" in "../definitions/rcl_interfaces/";
    Log [Time];
    ParameterType [];
    ParameterValue [];
    Parameter [ParameterValue];
    FloatingPointRange [];
    IntegerRange [];
    ParameterDescriptor [FloatingPointRange, IntegerRange];
    SetParametersResult [];
    ListParametersResult [];
    ParameterEvent [Time, Parameter];
    LoggerLevel [];
    SetLoggerLevelsResult [];
}

services! {
    "rcl_interfaces" in "../definitions/rcl_interfaces/";
    DescribeParameters: DescribeParametersRequest [], DescribeParametersResponse [ParameterDescriptor];
    GetParameters: GetParametersRequest [], GetParametersResponse [ParameterValue];
    GetParameterTypes: GetParameterTypesRequest [], GetParameterTypesResponse [];
    ListParameters: ListParametersRequest [], ListParametersResponse [ListParametersResult];
    SetParameters: SetParametersRequest [Parameter], SetParametersResponse [SetParametersResult];
    GetLoggerLevels: GetLoggerLevelsRequest [], GetLoggerLevelsResponse [LoggerLevel];
    SetLoggerLevels: SetLoggerLevelsRequest [LoggerLevel], SetLoggerLevelsResponse [SetLoggerLevelsResult];
    SetParametersAtomically: SetParametersAtomicallyRequest [Parameter], SetParametersAtomicallyResponse [SetParametersResult];
}

/// Log message, as on `/rosout`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Log {
    /// Time at which it was logged.
    pub stamp: Time,
    /// Severity, one of the constants of this struct.
    pub level: u8,
    /// Name of the logger.
    pub name: String,
    /// Text of the message.
    pub msg: String,
    /// Source file of the call.
    pub file: String,
    /// Function of the call.
    pub function: String,
    /// Line of the call.
    pub line: u32,
}

impl Log {
    /// Severity of messages for debugging.
    pub const DEBUG: u8 = 10;
    /// Severity of messages for the operator.
    pub const INFO: u8 = 20;
    /// Severity of warnings: a fault is possible.
    pub const WARN: u8 = 30;
    /// Severity of errors: an operation failed.
    pub const ERROR: u8 = 40;
    /// Severity of fatal errors: the node cannot continue.
    pub const FATAL: u8 = 50;
}

/// Types of parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterType {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

impl ParameterType {
    /// No value.
    pub const PARAMETER_NOT_SET: u8 = 0;
    /// Type of `bool_value`.
    pub const PARAMETER_BOOL: u8 = 1;
    /// Type of `integer_value`.
    pub const PARAMETER_INTEGER: u8 = 2;
    /// Type of `double_value`.
    pub const PARAMETER_DOUBLE: u8 = 3;
    /// Type of `string_value`.
    pub const PARAMETER_STRING: u8 = 4;
    /// Type of `byte_array_value`.
    pub const PARAMETER_BYTE_ARRAY: u8 = 5;
    /// Type of `bool_array_value`.
    pub const PARAMETER_BOOL_ARRAY: u8 = 6;
    /// Type of `integer_array_value`.
    pub const PARAMETER_INTEGER_ARRAY: u8 = 7;
    /// Type of `double_array_value`.
    pub const PARAMETER_DOUBLE_ARRAY: u8 = 8;
    /// Type of `string_array_value`.
    pub const PARAMETER_STRING_ARRAY: u8 = 9;
}

/// Value of a parameter: `type` selects the field in use.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterValue {
    /// Type, one of [`ParameterType`].
    #[serde(rename = "type")]
    pub type_: u8,
    /// Value of type PARAMETER_BOOL.
    pub bool_value: bool,
    /// Value of type PARAMETER_INTEGER.
    pub integer_value: i64,
    /// Value of type PARAMETER_DOUBLE.
    pub double_value: f64,
    /// Value of type PARAMETER_STRING.
    pub string_value: String,
    /// Value of type PARAMETER_BYTE_ARRAY.
    pub byte_array_value: ByteBuf,
    /// Value of type PARAMETER_BOOL_ARRAY.
    pub bool_array_value: Vec<bool>,
    /// Value of type PARAMETER_INTEGER_ARRAY.
    pub integer_array_value: Vec<i64>,
    /// Value of type PARAMETER_DOUBLE_ARRAY.
    pub double_array_value: Vec<f64>,
    /// Value of type PARAMETER_STRING_ARRAY.
    pub string_array_value: Vec<String>,
}

/// Parameter: name and value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Full name, with dots between levels.
    pub name: String,
    /// Value of the parameter.
    pub value: ParameterValue,
}

/// Range of a floating-point parameter, both ends included.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FloatingPointRange {
    /// Smallest value.
    pub from_value: f64,
    /// Largest value.
    pub to_value: f64,
    /// Step between allowed values; 0 if any is allowed.
    pub step: f64,
}

/// Range of an integer parameter, both ends included.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IntegerRange {
    /// Smallest value.
    pub from_value: i64,
    /// Largest value.
    pub to_value: i64,
    /// Step between allowed values; 0 if any is allowed.
    pub step: u64,
}

/// Description of a parameter without its value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterDescriptor {
    /// Full name.
    pub name: String,
    /// Type, one of [`ParameterType`].
    #[serde(rename = "type")]
    pub type_: u8,
    /// Purpose of the parameter.
    pub description: String,
    /// Constraints as text.
    pub additional_constraints: String,
    /// True if the parameter cannot change while the node runs.
    pub read_only: bool,
    /// True if the type may change.
    pub dynamic_typing: bool,
    /// Range of a floating-point parameter; at most one entry.
    pub floating_point_range: Vec<FloatingPointRange>,
    /// Range of an integer parameter; at most one entry.
    pub integer_range: Vec<IntegerRange>,
}

/// Result of setting a parameter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersResult {
    /// True if the parameter was set.
    pub successful: bool,
    /// Reason of a failure.
    pub reason: String,
}

/// Names of parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListParametersResult {
    /// Full names.
    pub names: Vec<String>,
    /// Prefixes of the names, one per level above them.
    pub prefixes: Vec<String>,
}

/// Change of the parameters of a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterEvent {
    /// Time of the change.
    pub stamp: Time,
    /// Full name of the node.
    pub node: String,
    /// Declared parameters.
    pub new_parameters: Vec<Parameter>,
    /// Changed parameters.
    pub changed_parameters: Vec<Parameter>,
    /// Undeclared parameters.
    pub deleted_parameters: Vec<Parameter>,
}

/// Queries descriptors of parameters.
#[derive(Clone, Copy, Debug)]
pub struct DescribeParameters;

/// Request of [`DescribeParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DescribeParametersRequest {
    /// Names of the parameters.
    pub names: Vec<String>,
}

/// Response of [`DescribeParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DescribeParametersResponse {
    /// Descriptors in the order of the names.
    pub descriptors: Vec<ParameterDescriptor>,
}

/// Queries values of parameters.
#[derive(Clone, Copy, Debug)]
pub struct GetParameters;

/// Request of [`GetParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetParametersRequest {
    /// Names of the parameters.
    pub names: Vec<String>,
}

/// Response of [`GetParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetParametersResponse {
    /// Values in the order of the names.
    pub values: Vec<ParameterValue>,
}

/// Queries types of parameters.
#[derive(Clone, Copy, Debug)]
pub struct GetParameterTypes;

/// Request of [`GetParameterTypes`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetParameterTypesRequest {
    /// Names of the parameters.
    pub names: Vec<String>,
}

/// Response of [`GetParameterTypes`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetParameterTypesResponse {
    /// Types in the order of the names, each one of [`ParameterType`].
    pub types: ByteBuf,
}

/// Lists names of parameters.
#[derive(Clone, Copy, Debug)]
pub struct ListParameters;

/// Request of [`ListParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListParametersRequest {
    /// Prefixes of the listed names; empty lists all.
    pub prefixes: Vec<String>,
    /// Maximum number of levels below a prefix, [`Self::DEPTH_RECURSIVE`] without limit.
    pub depth: u64,
}

impl ListParametersRequest {
    /// Depth without limit.
    pub const DEPTH_RECURSIVE: u64 = 0;
}

/// Response of [`ListParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListParametersResponse {
    /// Listed names and prefixes.
    pub result: ListParametersResult,
}

/// Sets parameters one by one.
#[derive(Clone, Copy, Debug)]
pub struct SetParameters;

/// Request of [`SetParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersRequest {
    /// Parameters to set.
    pub parameters: Vec<Parameter>,
}

/// Response of [`SetParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersResponse {
    /// Results in the order of the parameters.
    pub results: Vec<SetParametersResult>,
}

/// Sets parameters, all or none.
#[derive(Clone, Copy, Debug)]
pub struct SetParametersAtomically;

/// Request of [`SetParametersAtomically`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersAtomicallyRequest {
    /// Parameters to set.
    pub parameters: Vec<Parameter>,
}

/// Response of [`SetParametersAtomically`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersAtomicallyResponse {
    /// Result of the whole request.
    pub result: SetParametersResult,
}

/// Severity threshold of a logger.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoggerLevel {
    /// Name of the logger, with dots between levels.
    pub name: String,
    /// Threshold, one of the constants of this struct.
    pub level: u32,
}

impl LoggerLevel {
    /// Threshold not set.
    pub const LOG_LEVEL_UNKNOWN: u8 = 0;
    /// Threshold [`Log::DEBUG`].
    pub const LOG_LEVEL_DEBUG: u8 = 10;
    /// Threshold [`Log::INFO`].
    pub const LOG_LEVEL_INFO: u8 = 20;
    /// Threshold [`Log::WARN`].
    pub const LOG_LEVEL_WARN: u8 = 30;
    /// Threshold [`Log::ERROR`].
    pub const LOG_LEVEL_ERROR: u8 = 40;
    /// Threshold [`Log::FATAL`].
    pub const LOG_LEVEL_FATAL: u8 = 50;
}

/// Result of setting the level of a logger.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetLoggerLevelsResult {
    /// True if the level was set.
    pub successful: bool,
    /// Reason of a failure.
    pub reason: String,
}

/// Queries levels of loggers.
#[derive(Clone, Copy, Debug)]
pub struct GetLoggerLevels;

/// Request of [`GetLoggerLevels`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetLoggerLevelsRequest {
    /// Names of loggers.
    pub names: Vec<String>,
}

/// Response of [`GetLoggerLevels`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetLoggerLevelsResponse {
    /// Levels in the order of the names.
    pub levels: Vec<LoggerLevel>,
}

/// Sets levels of loggers.
#[derive(Clone, Copy, Debug)]
pub struct SetLoggerLevels;

/// Request of [`SetLoggerLevels`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetLoggerLevelsRequest {
    /// Loggers and their levels.
    pub levels: Vec<LoggerLevel>,
}

/// Response of [`SetLoggerLevels`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetLoggerLevelsResponse {
    /// Results in the order of the levels.
    pub results: Vec<SetLoggerLevelsResult>,
}
