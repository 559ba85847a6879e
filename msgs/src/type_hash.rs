//! Type hashes of ROS 2 (RIHS01 of REP 2016), which endpoints announce beside the type's name.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;

use hmac_sha256::Hash;

use crate::interface::RosMessage;
use crate::interface::Schema;
use crate::packages::builtin_interfaces::Time;
use crate::packages::type_description_interfaces::{
    Field, FieldType, IndividualTypeDescription, TypeDescription,
};

/// Type hash (`RIHS01_...`) of a message by its definition with all dependencies (`ros2msg` text).
///
/// `None` if the text is malformed, or lacks a message that a field refers to.
pub fn type_hash(ros_type: &str, definition: &str) -> Option<String> {
    let description = type_description(ros_type, definition)?;
    let main = json(&description.type_description);
    let referenced = description.referenced_type_descriptions.iter();
    let referenced = referenced.map(json).collect::<Vec<_>>().join(", ");
    let json = format!(
        r#"{{"type_description": {main}, "referenced_type_descriptions": [{referenced}]}}"#
    );
    let mut hash = "RIHS01_".to_owned();
    for byte in Hash::hash(json.as_bytes()) {
        let _ = write!(hash, "{byte:02x}");
    }
    Some(hash)
}

/// Description of a message by its definition with all dependencies, as in [`type_hash`].
pub fn type_description(ros_type: &str, definition: &str) -> Option<TypeDescription> {
    let [_, kind, _] = ros_type.split('/').collect::<Vec<_>>()[..] else {
        return None;
    };
    let text = format!("{ros_type}\n{definition}");
    let parts = text.split("\nMSG: ").map(|part| {
        let (name, body) = part.split_once('\n').unwrap_or((part, ""));
        (full_name(name.trim(), "", kind), body)
    });
    let parts: HashMap<_, _> = parts.collect();
    let mut described = BTreeMap::new();
    let mut wanted = vec![ros_type.to_owned()];
    while let Some(name) = wanted.pop() {
        if described.contains_key(&name) {
            continue;
        }
        let one = describe(&name, parts.get(&name)?, kind, &mut wanted)?;
        described.insert(name, one);
    }
    Some(TypeDescription {
        type_description: described.remove(ros_type)?,
        referenced_type_descriptions: described.into_values().collect(),
    })
}

/// Type hash of a service: rosidl describes it as a message of its request, response and event.
pub(crate) fn service_hash(
    service: &str,
    request: &'static Schema,
    response: &'static Schema,
) -> Option<String> {
    let (_, name) = service.rsplit_once('/')?;
    let mut definition = format!(
        "{name}_Request request_message\n{name}_Response response_message\n{name}_Event event_message\n"
    );
    let event = format!(
        "service_msgs/ServiceEventInfo info\n{name}_Request[<=1] request\n{name}_Response[<=1] response\n"
    );
    for (name, text) in [
        (&*format!("{service}_Event"), &*event),
        ("service_msgs/ServiceEventInfo", SERVICE_EVENT_INFO),
        ("builtin_interfaces/Time", Time::SCHEMA.text),
        (request.type_name, &*request.definition()),
        (response.type_name, &*response.definition()),
    ] {
        definition += &format!("====\nMSG: {name}\n{text}\n");
    }
    type_hash(service, &definition)
}

/// Fields of service_msgs/msg/ServiceEventInfo.
const SERVICE_EVENT_INFO: &str =
    "uint8 event_type\nbuiltin_interfaces/Time stamp\nchar[16] client_gid\nint64 sequence_number\n";

/// Full name of a message that a definition calls `Name` or `package/Name`.
///
/// Parts of services and actions, the only names with a `_`, have the `kind` of their owner.
fn full_name(name: &str, package: &str, kind: &str) -> String {
    let (package, last) = name.split_once('/').unwrap_or((package, name));
    match last {
        _ if last.contains('/') => name.to_owned(),
        _ if last.contains('_') => format!("{package}/{kind}/{last}"),
        _ => format!("{package}/msg/{last}"),
    }
}

/// Canonical JSON of one message, without default values.
fn json(description: &IndividualTypeDescription) -> String {
    let field = |field: &Field| {
        let FieldType {
            type_id,
            capacity,
            string_capacity,
            nested_type_name,
        } = &field.type_;
        format!(
            "{{\"name\": \"{}\", \"type\": {{\"type_id\": {type_id}, \"capacity\": {capacity}, \
             \"string_capacity\": {string_capacity}, \"nested_type_name\": \"{nested_type_name}\"}}}}",
            field.name
        )
    };
    let fields: Vec<String> = description.fields.iter().map(field).collect();
    let (name, fields) = (&description.type_name, fields.join(", "));
    format!(r#"{{"type_name": "{name}", "fields": [{fields}]}}"#)
}

/// Description of one message; the names of its dependencies are added to `nested`.
fn describe(
    type_name: &str,
    text: &str,
    kind: &str,
    nested: &mut Vec<String>,
) -> Option<IndividualTypeDescription> {
    let (package, _) = type_name.split_once('/')?;
    let mut fields = Vec::new();
    for line in text.lines().filter(|line| !line.starts_with("====")) {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let (field_type, rest) = line.split_once(char::is_whitespace)?;
        let rest = rest.trim_start();
        let end = rest.find(|c: char| c == '=' || c.is_whitespace());
        let (name, value) = rest.split_at(end.unwrap_or(rest.len()));
        let is_constant = value.trim_start().starts_with('=');
        if !is_constant {
            let type_ = field_of(field_type, package, kind, nested)?;
            fields.push(named(name, type_, value.trim())?);
        }
    }
    if fields.is_empty() {
        let padding = "structure_needs_at_least_one_member";
        let type_ = field_of("uint8", package, kind, nested)?;
        fields.push(named(padding, type_, "")?);
    }
    is_plain(type_name).then(|| IndividualTypeDescription {
        type_name: type_name.to_owned(),
        fields,
    })
}

fn named(name: &str, type_: FieldType, default: &str) -> Option<Field> {
    is_plain(name).then(|| Field {
        name: name.to_owned(),
        type_,
        default_value: default.to_owned(),
    })
}

/// Type of a field.
fn field_of(
    field_type: &str,
    package: &str,
    kind: &str,
    nested: &mut Vec<String>,
) -> Option<FieldType> {
    // The numbers are those of type_description_interfaces/msg/FieldType.
    let (element, array) = match field_type.split_once('[') {
        Some((element, array)) => (element, Some(array.strip_suffix(']')?)),
        None => (field_type, None),
    };
    let (array_id, capacity) = match array {
        None => (0, 0),
        Some("") => (144, 0),
        Some(length) => match length.strip_prefix("<=") {
            Some(bound) => (96, bound.parse::<u64>().ok()?),
            None => (48, length.parse().ok()?),
        },
    };
    let (element, bound) = element.split_once("<=").unwrap_or((element, "0"));
    let string_capacity: u64 = bound.parse().ok()?;
    let mut nested_type_name = String::new();
    let element_id = match element {
        "int8" => 2,
        "uint8" | "char" => 3,
        "int16" => 4,
        "uint16" => 5,
        "int32" => 6,
        "uint32" => 7,
        "int64" => 8,
        "uint64" => 9,
        "float32" => 10,
        "float64" => 11,
        "bool" => 15,
        "byte" => 16,
        "string" if string_capacity == 0 => 17,
        "wstring" if string_capacity == 0 => 18,
        "string" => 21,
        "wstring" => 22,
        _ => {
            nested_type_name = full_name(element, package, kind);
            nested.push(nested_type_name.clone());
            1
        }
    };
    Some(FieldType {
        type_id: array_id + element_id,
        capacity,
        string_capacity,
        nested_type_name,
    })
}

/// True if the name needs no escaping in JSON.
fn is_plain(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '/';
    !name.is_empty() && name.chars().all(plain)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MessageVisitor, hash_of, visit_messages};

    #[test]
    fn hashes_are_those_of_jazzy() {
        for (ros_type, hash) in [
            (
                "std_msgs/msg/Empty",
                "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312",
            ),
            (
                "sensor_msgs/msg/PointCloud2",
                "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
            ),
            (
                "sensor_msgs/msg/Image",
                "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
            ),
            (
                "sensor_msgs/msg/CameraInfo",
                "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
            ),
            (
                "std_srvs/srv/Trigger_Request",
                "d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199",
            ),
            (
                "std_srvs/srv/Trigger",
                "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
            ),
            (
                "lattice_msgs/action/Calibrate_SendGoal",
                "03108507d6de7fa3aa4c8ae3e8d06a3ca5b9abefe6d1d3367d609f80e4950b10",
            ),
            (
                "lattice_msgs/action/Calibrate_SendGoal_Request",
                "633ff632cf5fce07a9ad82ca5b69b512e6bc981c9789c5001c7e490213e9e1a3",
            ),
            (
                "rmw_dds_common/msg/ParticipantEntitiesInfo",
                "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
            ),
        ] {
            let expected = format!("RIHS01_{hash}");
            assert_eq!(hash_of(ros_type), Some(expected.as_str()), "{ros_type}");
        }
        assert_eq!(hash_of("std_msgs/msg/Nothing"), None);
    }

    #[test]
    fn every_message_has_a_hash() {
        struct Known;
        impl MessageVisitor for Known {
            fn visit<M: RosMessage>(&mut self) {
                assert!(hash_of(M::TYPE).is_some(), "{}", M::TYPE);
            }
        }
        visit_messages(&mut Known);
    }

    #[test]
    fn definitions_of_other_writers_are_read() {
        // Bounded sequences, parts of a service, a full name, line ends of Windows.
        let event = "service_msgs/ServiceEventInfo info\r\nTrigger_Request[<=1] request\r\n\
                     Trigger_Response[<=1] response\r\n====\r\nMSG: std_srvs/srv/Trigger_Request\r\n\
                     ====\r\nMSG: std_srvs/Trigger_Response\r\nbool success\r\nstring message\r\n\
                     ====\r\nMSG: service_msgs/ServiceEventInfo\r\nuint8 REQUEST_SENT = 0\r\n\
                     uint8 event_type 0 # a default\r\nbuiltin_interfaces/Time stamp\r\n\
                     char[16] client_gid\r\nint64 sequence_number\r\n====\r\n\
                     MSG: builtin_interfaces/msg/Time\r\nint32 sec\r\nuint32 nanosec\r\n";
        let hash = type_hash("std_srvs/srv/Trigger_Event", event);
        assert_eq!(
            hash.as_deref(),
            Some("RIHS01_ec4a1d26b0575e61906890342aba9523a2360e9845857c5590fa6e23bc39e1c2")
        );
        // The main definition has a head, too; a part that nobody needs does not count.
        let string = "====\nMSG: std_msgs/msg/String\nstring data\n====\nMSG: a/B\nstring";
        let hash = type_hash("std_msgs/msg/String", string);
        assert_eq!(hash.as_deref(), hash_of("std_msgs/msg/String"));
    }

    #[test]
    fn what_is_no_definition_has_no_hash() {
        for wrong in [
            "string",
            "Missing x",
            "int32[ x",
            "int32[<=x] x",
            "int32 x\"y",
            "---",
            "====\nIDL: a/msg/B\nmodule a {};",
        ] {
            assert_eq!(
                type_hash("a/msg/A", &format!("int32 a\n{wrong}\n")),
                None,
                "{wrong}"
            );
        }
        assert_eq!(type_hash("String", "string data\n"), None);
    }
}
