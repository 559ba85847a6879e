//! Descriptions of types.

use serde::{Deserialize, Serialize};

use crate::interface::messages;
use crate::interface::services;

messages! {
    "type_description_interfaces" in "../definitions/type_description_interfaces/";
    FieldType [];
    Field [FieldType];
    IndividualTypeDescription [Field];
    TypeDescription [IndividualTypeDescription];
    KeyValue [];
    TypeSource [];
}

services! {
    "type_description_interfaces" in "../definitions/type_description_interfaces/";
    GetTypeDescription: GetTypeDescriptionRequest [], GetTypeDescriptionResponse [TypeDescription, TypeSource, KeyValue];
}

/// Type of a field.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FieldType {
    /// Number of the type.
    pub type_id: u8,
    /// Length of an array, or most elements of a bounded sequence.
    pub capacity: u64,
    /// Most characters of a bounded string.
    pub string_capacity: u64,
    /// Full name of a message.
    pub nested_type_name: String,
}

/// One field of a type.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Field {
    /// Name of the field.
    pub name: String,
    /// Type of the field.
    #[serde(rename = "type")]
    pub type_: FieldType,
    /// Default value as it is written.
    pub default_value: String,
}

/// A type without its dependencies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IndividualTypeDescription {
    /// Full name.
    pub type_name: String,
    /// Fields in their order.
    pub fields: Vec<Field>,
}

/// A type with its dependencies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TypeDescription {
    /// The type itself.
    pub type_description: IndividualTypeDescription,
    /// The others, sorted by name.
    pub referenced_type_descriptions: Vec<IndividualTypeDescription>,
}

/// Further information.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeyValue {
    /// Kind of the entry.
    pub key: String,
    /// Text of the entry.
    pub value: String,
}

/// Source of a type.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TypeSource {
    /// Full name.
    pub type_name: String,
    /// `msg`, `srv`, `action`, or `implicit` for a part of one.
    pub encoding: String,
    /// Text of the file.
    pub raw_file_contents: String,
}

/// Describes a type.
#[derive(Clone, Copy, Debug)]
pub struct GetTypeDescription;

/// Type that is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GetTypeDescriptionRequest {
    /// Full name.
    pub type_name: String,
    /// `RIHS01_` and 64 hexadecimal digits.
    pub type_hash: String,
    /// True: with the texts of the definitions.
    pub include_type_sources: bool,
}

impl Default for GetTypeDescriptionRequest {
    fn default() -> Self {
        Self {
            type_name: String::new(),
            type_hash: String::new(),
            include_type_sources: true,
        }
    }
}

/// Description of a type.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetTypeDescriptionResponse {
    /// True: what follows is set.
    pub successful: bool,
    /// Reason of a refusal.
    pub failure_reason: String,
    /// Fields of the type.
    pub type_description: TypeDescription,
    /// Texts of the definitions.
    pub type_sources: Vec<TypeSource>,
    /// All else.
    pub extra_information: Vec<KeyValue>,
}
