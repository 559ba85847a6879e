//! All messages of this crate, by type.

use crate::interface::RosMessage;
use crate::{
    action, action_msgs, builtin_interfaces, calibration, diagnostic_msgs, geographic_msgs,
    geometry_msgs, headset, lattice, lifecycle_msgs, livox_interfaces, livox_ros_driver,
    livox_ros_driver2, map_msgs, nav_msgs, novatel_oem7_msgs, octomap_msgs, rcl_interfaces,
    rmw_dds_common, rosbag2_interfaces, rosgraph_msgs, sensor_msgs, std_msgs, std_srvs, tf2_msgs,
    type_description_interfaces, unique_identifier_msgs, vision_msgs, visualization_msgs,
};

/// Visitor of every message type; see [`visit_messages`].
pub trait MessageVisitor {
    /// Called once for each type.
    fn visit<M: RosMessage>(&mut self);
}

/// Passes every message, and every part of a service or an action, to the visitor.
pub fn visit_messages(visitor: &mut impl MessageVisitor) {
    action_msgs::visit_messages(visitor);
    action_msgs::visit_services(visitor);
    builtin_interfaces::visit_messages(visitor);
    calibration::visit_messages(visitor);
    calibration::visit_services(visitor);
    action::visit_parts(visitor);
    diagnostic_msgs::visit_messages(visitor);
    geographic_msgs::visit_messages(visitor);
    geometry_msgs::visit_messages(visitor);
    headset::visit_messages(visitor);
    lattice::visit_messages(visitor);
    lattice::visit_services(visitor);
    lifecycle_msgs::visit_messages(visitor);
    lifecycle_msgs::visit_services(visitor);
    livox_interfaces::visit_messages(visitor);
    livox_ros_driver::visit_messages(visitor);
    livox_ros_driver2::visit_messages(visitor);
    map_msgs::visit_messages(visitor);
    nav_msgs::visit_messages(visitor);
    novatel_oem7_msgs::visit_messages(visitor);
    octomap_msgs::visit_messages(visitor);
    octomap_msgs::visit_services(visitor);
    rcl_interfaces::visit_messages(visitor);
    rcl_interfaces::visit_services(visitor);
    rmw_dds_common::visit_messages(visitor);
    rosbag2_interfaces::visit_services(visitor);
    rosgraph_msgs::visit_messages(visitor);
    sensor_msgs::visit_messages(visitor);
    std_msgs::visit_messages(visitor);
    std_srvs::visit_services(visitor);
    tf2_msgs::visit_messages(visitor);
    type_description_interfaces::visit_messages(visitor);
    type_description_interfaces::visit_services(visitor);
    unique_identifier_msgs::visit_messages(visitor);
    vision_msgs::visit_messages(visitor);
    visualization_msgs::visit_messages(visitor);
}

/// Definition of a message of this crate with its dependencies (`ros2msg` text).
///
/// ```
/// let definition = lattice_msgs::definition_of("std_msgs/msg/String");
/// assert!(definition.is_some_and(|text| text.contains("string data")));
/// assert_eq!(lattice_msgs::definition_of("my_msgs/msg/Unknown"), None);
/// ```
pub fn definition_of(ros_type: &str) -> Option<String> {
    struct Find<'a>(&'a str, Option<String>);
    impl MessageVisitor for Find<'_> {
        fn visit<M: RosMessage>(&mut self) {
            if self.0 == M::TYPE {
                self.1 = Some(M::definition());
            }
        }
    }
    let mut find = Find(ros_type, None);
    visit_messages(&mut find);
    find.1
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[derive(Default)]
    struct Names(Vec<&'static str>);

    impl MessageVisitor for Names {
        fn visit<M: RosMessage>(&mut self) {
            self.0.push(M::TYPE);
        }
    }

    #[test]
    fn every_message_is_visited_only_once() {
        let mut names = Names::default();
        visit_messages(&mut names);
        let unique: BTreeSet<_> = names.0.iter().collect();
        assert_eq!(unique.len(), names.0.len());
    }

    #[test]
    fn every_definition_file_belongs_to_a_message() {
        let mut names = Names::default();
        visit_messages(&mut names);
        let root = env!("CARGO_MANIFEST_DIR");
        let mut folders: Vec<_> = ["msg", "srv", "action"]
            .map(|kind| (format!("{root}/{kind}"), "lattice_msgs".to_owned()))
            .into();
        for folder in std::fs::read_dir(format!("{root}/definitions")).unwrap() {
            let folder = folder.unwrap();
            let package = folder.file_name().into_string().unwrap();
            folders.push((folder.path().display().to_string(), package));
        }
        for (folder, package) in folders {
            for file in std::fs::read_dir(folder).unwrap() {
                let file = file.unwrap().file_name().into_string().unwrap();
                let type_name = match file.split_once('.').unwrap() {
                    (name, "msg") => format!("{package}/msg/{name}"),
                    (name, "action") => format!("{package}/action/{name}_Goal"),
                    (name, _) => format!("{package}/srv/{name}_Request"),
                };
                assert!(names.0.contains(&type_name.as_str()), "{type_name}");
            }
        }
    }
}
