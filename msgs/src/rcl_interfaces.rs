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

/// One line of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Log {
    /// Time of writing.
    pub stamp: Time,
    /// One of the constants.
    pub level: u8,
    /// The logger.
    pub name: String,
    /// The text.
    pub msg: String,
    /// Source file it came from.
    pub file: String,
    /// Function it came from.
    pub function: String,
    /// Line it came from.
    pub line: u32,
}

impl Log {
    /// For debugging.
    pub const DEBUG: u8 = 10;
    /// Of interest to the operator.
    pub const INFO: u8 = 20;
    /// May lead to a fault.
    pub const WARN: u8 = 30;
    /// Something failed.
    pub const ERROR: u8 = 40;
    /// The node cannot continue.
    pub const FATAL: u8 = 50;
}

/// The types of parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterType {
    /// Padding: a structure on the wire has at least one byte.
    pub structure_needs_at_least_one_member: u8,
}

impl ParameterType {
    /// No value.
    pub const PARAMETER_NOT_SET: u8 = 0;
    /// Bool_value.
    pub const PARAMETER_BOOL: u8 = 1;
    /// Integer_value.
    pub const PARAMETER_INTEGER: u8 = 2;
    /// Double_value.
    pub const PARAMETER_DOUBLE: u8 = 3;
    /// String_value.
    pub const PARAMETER_STRING: u8 = 4;
    /// Byte_array_value.
    pub const PARAMETER_BYTE_ARRAY: u8 = 5;
    /// Bool_array_value.
    pub const PARAMETER_BOOL_ARRAY: u8 = 6;
    /// Integer_array_value.
    pub const PARAMETER_INTEGER_ARRAY: u8 = 7;
    /// Double_array_value.
    pub const PARAMETER_DOUBLE_ARRAY: u8 = 8;
    /// String_array_value.
    pub const PARAMETER_STRING_ARRAY: u8 = 9;
}

/// Value of a parameter: the one field that type names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterValue {
    /// One of ParameterType.
    #[serde(rename = "type")]
    pub type_: u8,
    /// Of PARAMETER_BOOL.
    pub bool_value: bool,
    /// Of PARAMETER_INTEGER.
    pub integer_value: i64,
    /// Of PARAMETER_DOUBLE.
    pub double_value: f64,
    /// Of PARAMETER_STRING.
    pub string_value: String,
    /// Of PARAMETER_BYTE_ARRAY.
    pub byte_array_value: ByteBuf,
    /// Of PARAMETER_BOOL_ARRAY.
    pub bool_array_value: Vec<bool>,
    /// Of PARAMETER_INTEGER_ARRAY.
    pub integer_array_value: Vec<i64>,
    /// Of PARAMETER_DOUBLE_ARRAY.
    pub double_array_value: Vec<f64>,
    /// Of PARAMETER_STRING_ARRAY.
    pub string_array_value: Vec<String>,
}

/// A named value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Full name, dots between levels.
    pub name: String,
    /// Its value.
    pub value: ParameterValue,
}

/// Numbers a parameter may take, both ends included.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FloatingPointRange {
    /// Least.
    pub from_value: f64,
    /// Greatest.
    pub to_value: f64,
    /// Between neighbours, 0: any.
    pub step: f64,
}

/// Integers a parameter may take, both ends included.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IntegerRange {
    /// Least.
    pub from_value: i64,
    /// Greatest.
    pub to_value: i64,
    /// Between neighbours, 0: any.
    pub step: u64,
}

/// Description of a parameter besides its value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterDescriptor {
    /// Full name.
    pub name: String,
    /// One of ParameterType.
    #[serde(rename = "type")]
    pub type_: u8,
    /// Its purpose.
    pub description: String,
    /// Rules in words.
    pub additional_constraints: String,
    /// True: cannot change while the node runs.
    pub read_only: bool,
    /// True: may change its type.
    pub dynamic_typing: bool,
    /// Range of a number.
    pub floating_point_range: Vec<FloatingPointRange>,
    /// Range of an integer.
    pub integer_range: Vec<IntegerRange>,
}

/// Outcome of setting a parameter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersResult {
    /// True: it was.
    pub successful: bool,
    /// Reason of a refusal.
    pub reason: String,
}

/// Names of parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListParametersResult {
    /// Full names.
    pub names: Vec<String>,
    /// The levels above them.
    pub prefixes: Vec<String>,
}

/// Change of parameters of a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterEvent {
    /// Time of the change.
    pub stamp: Time,
    /// Full name of the node.
    pub node: String,
    /// Declared.
    pub new_parameters: Vec<Parameter>,
    /// Set anew.
    pub changed_parameters: Vec<Parameter>,
    /// Undeclared.
    pub deleted_parameters: Vec<Parameter>,
}

/// Descriptors of parameters.
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
    /// In the order of the names.
    pub descriptors: Vec<ParameterDescriptor>,
}

/// Values of parameters.
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
    /// In the order of the names.
    pub values: Vec<ParameterValue>,
}

/// Types of parameters.
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
    /// One of ParameterType each, in the order of the names.
    pub types: ByteBuf,
}

/// Names of parameters.
#[derive(Clone, Copy, Debug)]
pub struct ListParameters;

/// Request of [`ListParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListParametersRequest {
    /// Only below these; none: all.
    pub prefixes: Vec<String>,
    /// Levels below a prefix.
    pub depth: u64,
}

impl ListParametersRequest {
    /// No limit.
    pub const DEPTH_RECURSIVE: u64 = 0;
}

/// Response of [`ListParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListParametersResponse {
    /// The listing.
    pub result: ListParametersResult,
}

/// Set parameters, each on its own.
#[derive(Clone, Copy, Debug)]
pub struct SetParameters;

/// Request of [`SetParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersRequest {
    /// Names and values.
    pub parameters: Vec<Parameter>,
}

/// Response of [`SetParameters`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersResponse {
    /// In the order of the parameters.
    pub results: Vec<SetParametersResult>,
}

/// Set parameters, all or none.
#[derive(Clone, Copy, Debug)]
pub struct SetParametersAtomically;

/// Request of [`SetParametersAtomically`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersAtomicallyRequest {
    /// Names and values.
    pub parameters: Vec<Parameter>,
}

/// Response of [`SetParametersAtomically`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersAtomicallyResponse {
    /// For all of them.
    pub result: SetParametersResult,
}

/// Level of a logger.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoggerLevel {
    /// The logger, levels parted by dots.
    pub name: String,
    /// One of the constants.
    pub level: u32,
}

impl LoggerLevel {
    /// Not set.
    pub const LOG_LEVEL_UNKNOWN: u8 = 0;
    /// As in [`Log`].
    pub const LOG_LEVEL_DEBUG: u8 = 10;
    /// As in [`Log`].
    pub const LOG_LEVEL_INFO: u8 = 20;
    /// As in [`Log`].
    pub const LOG_LEVEL_WARN: u8 = 30;
    /// As in [`Log`].
    pub const LOG_LEVEL_ERROR: u8 = 40;
    /// As in [`Log`].
    pub const LOG_LEVEL_FATAL: u8 = 50;
}

/// Outcome of setting the level of a logger.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetLoggerLevelsResult {
    /// True: it was.
    pub successful: bool,
    /// Reason of a refusal.
    pub reason: String,
}

/// Levels of loggers.
#[derive(Clone, Copy, Debug)]
pub struct GetLoggerLevels;

/// Loggers whose levels are asked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetLoggerLevelsRequest {
    /// Names of loggers.
    pub names: Vec<String>,
}

/// Their levels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetLoggerLevelsResponse {
    /// In the order of the names.
    pub levels: Vec<LoggerLevel>,
}

/// Sets levels of loggers.
#[derive(Clone, Copy, Debug)]
pub struct SetLoggerLevels;

/// Levels to set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetLoggerLevelsRequest {
    /// Loggers and their levels.
    pub levels: Vec<LoggerLevel>,
}

/// Outcomes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetLoggerLevelsResponse {
    /// In the order of the levels.
    pub results: Vec<SetLoggerLevelsResult>,
}
