//! The service `~/get_type_description`: field types from our message definitions.

use lattice_msgs::type_description_interfaces::{
    GetTypeDescription, GetTypeDescriptionRequest, GetTypeDescriptionResponse, TypeSource,
};
use lattice_msgs::{Schema, hash_of, schema_of, type_description};

use super::logical_node::Node;
use crate::communication::service::Server;
use crate::error::RuntimeError;

/// Serves type descriptions, unless the parameter `start_type_description_service` is false.
pub(crate) fn serve(node: &Node) -> Result<Option<Server>, RuntimeError> {
    match node.params().bool("start_type_description_service", true)? {
        false => Ok(None),
        true => node
            .service::<GetTypeDescription>("~/get_type_description", |request| answer(&request))
            .map(Some),
    }
}

fn answer(request: &GetTypeDescriptionRequest) -> GetTypeDescriptionResponse {
    describe(request).unwrap_or_else(|failure_reason| GetTypeDescriptionResponse {
        failure_reason,
        ..GetTypeDescriptionResponse::default()
    })
}

fn describe(request: &GetTypeDescriptionRequest) -> Result<GetTypeDescriptionResponse, String> {
    let name = request.type_name.as_str();
    let (Some(hash), Some(schema)) = (hash_of(name), schema_of(name)) else {
        let name: String = name.chars().take(255).collect();
        return Err(format!("unknown type {name:?}"));
    };
    if hash != request.type_hash {
        let asked: String = request.type_hash.chars().take(80).collect();
        return Err(format!("{name} has the hash {hash} here, not {asked:?}"));
    }
    let description = type_description(name, &schema.definition());
    let type_description = description.ok_or("its definition cannot be parsed")?;
    let mut type_sources = Vec::new();
    if request.include_type_sources {
        let others = &type_description.referenced_type_descriptions;
        let others = others
            .iter()
            .filter_map(|other| schema_of(&other.type_name));
        type_sources = [schema].into_iter().chain(others).map(source).collect();
    }
    Ok(GetTypeDescriptionResponse {
        successful: true,
        type_description,
        type_sources,
        ..GetTypeDescriptionResponse::default()
    })
}

fn source(schema: &Schema) -> TypeSource {
    // Parts of a service or an action have no file.
    let is_whole = schema.type_name.contains("/msg/");
    let (encoding, text) = match is_whole {
        true => ("msg", schema.text),
        false => ("implicit", ""),
    };
    TypeSource {
        type_name: schema.type_name.to_owned(),
        encoding: encoding.to_owned(),
        raw_file_contents: text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(type_name: &str, type_hash: &str) -> GetTypeDescriptionResponse {
        answer(&GetTypeDescriptionRequest {
            type_name: type_name.to_owned(),
            type_hash: type_hash.to_owned(),
            include_type_sources: true,
        })
    }

    #[test]
    fn a_known_type_is_described_with_all_that_it_refers_to() {
        let name = "sensor_msgs/msg/PointCloud2";
        let answer = ask(name, hash_of(name).unwrap());
        assert!(answer.successful && answer.failure_reason.is_empty());
        let description = answer.type_description;
        let fields = &description.type_description.fields;
        assert_eq!(
            (fields[0].name.as_str(), fields[0].type_.type_id),
            ("header", 1)
        );
        assert_eq!(fields[0].type_.nested_type_name, "std_msgs/msg/Header");
        let data = &fields[7];
        assert_eq!((data.name.as_str(), data.type_.type_id), ("data", 147));
        let others = description.referenced_type_descriptions.iter();
        let others: Vec<_> = others.map(|other| other.type_name.as_str()).collect();
        let expected = [
            "builtin_interfaces/msg/Time",
            "sensor_msgs/msg/PointField",
            "std_msgs/msg/Header",
        ];
        assert_eq!(others, expected);
        assert_eq!(answer.type_sources.len(), 4);
        assert!(
            answer.type_sources[0]
                .raw_file_contents
                .contains("point_step")
        );
        let part = "std_srvs/srv/Trigger_Request";
        let answer = ask(part, hash_of(part).unwrap());
        assert_eq!(answer.type_sources[0].encoding, "implicit");
    }

    #[test]
    fn other_types_and_hashes_are_refused() {
        let long = "x".repeat(1 << 20);
        for (name, hash, reason) in [
            (
                "std_msgs/msg/None",
                "",
                "unknown type \"std_msgs/msg/None\"",
            ),
            (
                "std_msgs/msg/Empty",
                "RIHS01_00",
                "has the hash RIHS01_20b6",
            ),
            ("std_msgs/msg/Empty", "", "has the hash"),
            (&long, &long, "unknown type"),
        ] {
            let answer = ask(name, hash);
            assert!(!answer.successful && answer.failure_reason.len() < 500);
            assert!(
                answer.failure_reason.contains(reason),
                "{}",
                answer.failure_reason
            );
        }
    }
}
