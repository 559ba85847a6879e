//! Interface of a message besides its fields: type name, schema text, dependencies.

use std::fmt::Debug;

use serde::{Serialize, de::DeserializeOwned};

/// Line between the schemas in a concatenated definition.
const SEPARATOR: &str =
    "================================================================================";

/// Schema of one message: its own text, and the schemas of its dependencies.
#[derive(Debug)]
pub struct Schema {
    /// Type name, such as `sensor_msgs/msg/PointCloud2`.
    pub type_name: &'static str,
    /// Text of the `.msg` file, or of one part of the `.srv` or `.action` file.
    pub text: &'static str,
    /// Messages that the fields refer to.
    pub dependencies: &'static [&'static Schema],
}

impl Schema {
    /// Text with the texts of all dependencies, each once (encoding `ros2msg` of MCAP).
    pub fn definition(&'static self) -> String {
        let mut seen = vec![self];
        let mut text = self.text.to_owned();
        let mut next = 0;
        while let Some(schema) = seen.get(next).copied() {
            for &dependency in schema.dependencies {
                if !seen.iter().any(|s| s.type_name == dependency.type_name) {
                    seen.push(dependency);
                    // Named as in the fields, without the middle part.
                    let mut parts = dependency.type_name.split('/');
                    let (package, name) = (parts.next(), parts.next_back());
                    let name = [package, name].map(Option::unwrap_or_default).join("/");
                    text += &format!("{SEPARATOR}\nMSG: {name}\n{}", dependency.text);
                }
            }
            next += 1;
        }
        text
    }
}

/// A message, or one part of a service or an action.
///
/// ```
/// use lattice_msgs::{RosMessage, Schema, type_hash};
/// use serde::{Deserialize, Serialize};
///
/// /// A message of one's own, with its fields in the order of the text.
/// #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
/// struct Battery {
///     volts: f32,
///     cells: Vec<f32>,
/// }
///
/// impl RosMessage for Battery {
///     const SCHEMA: &'static Schema = &Schema {
///         type_name: "my_msgs/msg/Battery",
///         text: "float32 volts\nfloat32[] cells\n",
///         dependencies: &[],
///     };
/// }
///
/// assert!(type_hash(Battery::TYPE, &Battery::definition()).is_some());
/// ```
pub trait RosMessage:
    Clone + Debug + Default + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// Schema of this message.
    const SCHEMA: &'static Schema;

    /// Type name, such as `sensor_msgs/msg/PointCloud2`.
    const TYPE: &'static str = Self::SCHEMA.type_name;

    /// Schema text with all dependencies, as bags store it (MCAP schema encoding `ros2msg`).
    fn definition() -> String {
        Self::SCHEMA.definition()
    }
}

/// Visitor of every message type; see [`visit_messages`](crate::visit_messages).
pub trait MessageVisitor {
    /// Called once for each type.
    fn visit<M: RosMessage>(&mut self);
}

/// A service.
pub trait RosService {
    /// Type name, such as `std_srvs/srv/Trigger`.
    const TYPE: &'static str;
    /// Message of the client.
    type Request: RosMessage;
    /// Answer of the server.
    type Response: RosMessage;
}

/// Name of a ROS type on DDS: `sensor_msgs/msg/PointCloud2` is `sensor_msgs::msg::dds_::PointCloud2_`.
///
/// `None` unless the name has the three parts of a full type name.
///
/// ```
/// let name = lattice_msgs::dds_type_name("std_msgs/msg/String");
/// assert_eq!(name.as_deref(), Some("std_msgs::msg::dds_::String_"));
/// ```
pub fn dds_type_name(type_name: &str) -> Option<String> {
    let mut parts = type_name.split('/');
    let (package, kind, name) = (parts.next()?, parts.next()?, parts.next()?);
    let whole = parts.next().is_none() && !package.is_empty() && !name.is_empty();
    (whole && matches!(kind, "msg" | "srv" | "action"))
        .then(|| format!("{package}::{kind}::dds_::{name}_"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor_msgs::PointCloud2;
    use crate::std_srvs::{TriggerRequest, TriggerResponse};
    use crate::visualization_msgs::MarkerArray;

    #[test]
    fn definition_holds_each_dependency_once() {
        let text = PointCloud2::definition();
        let parts: Vec<&str> = text.split(&format!("{SEPARATOR}\n")).collect();
        let names: Vec<_> = parts
            .iter()
            .skip(1)
            .filter_map(|p| p.lines().next())
            .collect();
        assert_eq!(
            names,
            [
                "MSG: std_msgs/Header",
                "MSG: sensor_msgs/PointField",
                "MSG: builtin_interfaces/Time"
            ]
        );
        assert_eq!(parts[0], PointCloud2::SCHEMA.text);
        assert_eq!(
            MarkerArray::definition()
                .matches("MSG: std_msgs/Header\n")
                .count(),
            1
        );
    }

    #[test]
    fn halves_of_a_service_are_apart() {
        assert_eq!(TriggerRequest::TYPE, "std_srvs/srv/Trigger_Request");
        assert!(!TriggerRequest::SCHEMA.text.contains("success"));
        assert!(TriggerResponse::SCHEMA.text.starts_with("bool success"));
    }

    #[test]
    fn dds_names() {
        let dds = dds_type_name(PointCloud2::TYPE);
        assert_eq!(dds.as_deref(), Some("sensor_msgs::msg::dds_::PointCloud2_"));
        let dds = dds_type_name("std_srvs/srv/Trigger_Request");
        assert_eq!(
            dds.as_deref(),
            Some("std_srvs::srv::dds_::Trigger_Request_")
        );
        for wrong in [
            "",
            "PointCloud2",
            "sensor_msgs/PointCloud2",
            "a/b/C",
            "a/msg/C/D",
            "/msg/C",
            "a/msg/",
        ] {
            assert_eq!(dds_type_name(wrong), None, "{wrong}");
        }
    }
}
