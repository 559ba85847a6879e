//! Definitions as text of ROS 2.

use std::fmt::Write as _;

use super::definition::{Count, Definition, Kind, PRIMITIVES, Place};

const SEPARATOR: &str =
    "================================================================================";

impl Definition {
    /// The definition as text of ROS 2 (ros2msg).
    pub(super) fn to_ros2(&self) -> String {
        let mut text = String::new();
        let mut times = [false; 2];
        for (at, message) in self.types.iter().enumerate() {
            if at > 0 {
                let _ = writeln!(text, "{SEPARATOR}\nMSG: {}", message.name);
            }
            for constant in &message.constants {
                let _ = writeln!(text, "{constant}");
            }
            for field in message
                .fields
                .iter()
                .filter(|field| field.place != Place::Dropped)
            {
                let kind = match field.kind {
                    Kind::Number(at) => PRIMITIVES.get(at).map_or("uint8", |p| p.2),
                    Kind::Text => "string",
                    Kind::Time => "builtin_interfaces/Time",
                    Kind::Duration => "builtin_interfaces/Duration",
                    Kind::Message(at) => self.types.get(at).map_or("", |t| t.name.as_str()),
                };
                times = [
                    times[0] || field.kind == Kind::Time,
                    times[1] || field.kind == Kind::Duration,
                ];
                let count = match field.count {
                    Count::One => String::new(),
                    Count::Fixed(count) => format!("[{count}]"),
                    Count::Any => "[]".to_owned(),
                };
                let _ = writeln!(text, "{kind}{count} {}", field.name.to_lowercase());
            }
        }
        for (name, used) in ["Time", "Duration"].into_iter().zip(times) {
            if used {
                let fields = "int32 sec\nuint32 nanosec";
                let _ = writeln!(
                    text,
                    "{SEPARATOR}\nMSG: builtin_interfaces/{name}\n{fields}"
                );
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::super::definition::ros2_name;
    use super::*;

    const ODOMETRY: &str = "# Twist\nHeader header\nstring child_frame_id\nPose pose # of it\nfloat64[36] K\n\
        uint8 A = 3 # three\nstring B=x # y\nduration[] ages\n\
        ================================================================================\n\
        MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n\
        ================================================================================\n\
        MSG: nav_msgs/Pose\nfloat64 x\n";

    #[test]
    fn definitions_become_those_of_ros2() {
        let parsed = Definition::parse("nav_msgs/Odometry", ODOMETRY).unwrap();
        let line = SEPARATOR;
        let expected = format!(
            "uint8 A=3\nstring B=\"x # y\"\nstd_msgs/Header header\nstring child_frame_id\nnav_msgs/Pose pose\n\
             float64[36] k\nbuiltin_interfaces/Duration[] ages\n{line}\nMSG: std_msgs/Header\n\
             builtin_interfaces/Time stamp\nstring frame_id\n{line}\nMSG: nav_msgs/Pose\nfloat64 x\n{line}\n\
             MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n{line}\n\
             MSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n"
        );
        assert_eq!(parsed.to_ros2(), expected);
        assert_eq!(ros2_name("tf/tfMessage"), "tf2_msgs/msg/TFMessage");
        assert_eq!(ros2_name("nav_msgs/Odometry"), "nav_msgs/msg/Odometry");
    }

    #[test]
    fn fields_of_ros2_are_added() {
        let text = "string message_name\nuint8 idle_time\n";
        let parsed = Definition::parse("novatel_oem7_msgs/Oem7Header", text).unwrap();
        let fields = "string message_name\nuint32 receiver_status\nfloat32 idle_time\n";
        assert!(parsed.to_ros2().starts_with(fields), "{}", parsed.to_ros2());
        let text = "Marker[] markers\nMSG: visualization_msgs/Marker\nbyte[] colors\nstring text\n\
                    string mesh_resource\nbool mesh_use_embedded_materials\n";
        let parsed = Definition::parse("visualization_msgs/MarkerArray", text).unwrap();
        let fields = "byte[] colors\nstring texture_resource\nsensor_msgs/CompressedImage texture\n\
                      visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n\
                      visualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n";
        assert!(parsed.to_ros2().contains(fields), "{}", parsed.to_ros2());
    }
}
