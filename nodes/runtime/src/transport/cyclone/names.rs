//! DDS names of ROS topics and services, mangled as in all rmw implementations.

use super::endpoint::Side;
use crate::transport::remote::GraphRole;

/// Role and full ROS name of an endpoint; `None` for clients, replies and topics outside ROS.
pub(super) fn role(side: Side, dds_name: &str) -> Option<(GraphRole, &str)> {
    let (prefix, name) = dds_name.split_at_checked(2)?;
    if !name.starts_with('/') {
        return None;
    }
    match (side, prefix) {
        (Side::Writer, "rt") => Some((GraphRole::Publisher, name)),
        (Side::Reader, "rt") => Some((GraphRole::Subscriber, name)),
        (Side::Reader, "rq") => Some((GraphRole::Server, name.strip_suffix("Request")?)),
        _ => None,
    }
}

/// DDS topic of a ROS topic: `/points` is `rt/points`.
pub(super) fn topic(full_name: &str) -> String {
    format!("rt{full_name}")
}

/// DDS topic of a service's requests: `/reset` is `rq/resetRequest`.
pub(super) fn request(full_name: &str) -> String {
    format!("rq{full_name}Request")
}

/// DDS topic of a service's replies: `/reset` is `rr/resetReply`.
pub(super) fn reply(full_name: &str) -> String {
    format!("rr{full_name}Reply")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dds_names_carry_the_ros_prefixes() {
        assert_eq!(topic("/robot/points"), "rt/robot/points");
        assert_eq!(request("/mapper/reset"), "rq/mapper/resetRequest");
        assert_eq!(reply("/mapper/reset"), "rr/mapper/resetReply");
    }

    #[test]
    fn roles_are_those_of_topics_and_servers() {
        use Side::{Reader, Writer};
        let server = Some((GraphRole::Server, "/a/call"));
        assert_eq!(role(Reader, "rq/a/callRequest"), server);
        for (kind, name) in [
            (Writer, "rq/a/callRequest"),
            (Reader, "rr/a/callReply"),
            (Reader, "rq/a/call"),
            (Writer, "ros_discovery_info"),
            (Writer, "r\u{e4}/a"),
        ] {
            assert_eq!(role(kind, name), None, "{name}");
        }
    }
}
