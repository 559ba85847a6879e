//! The `.msg` and `.srv` texts say the same as the Rust structs.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;

use crate::shape::filled;
use lattice_msgs::type_description_interfaces::GetTypeDescriptionRequest;
use lattice_msgs::{MessageVisitor, RosMessage, geometry_msgs, sensor_msgs, visit_messages};

/// A line of a definition: a constant, or a field that may have a default.
struct Line<'a> {
    kind: &'a str,
    name: &'a str,
    default: Option<&'a str>,
    constant: Option<&'a str>,
}

fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let bodies = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default().trim());
    bodies.filter(|body| !body.is_empty()).map(|body| {
        let (kind, rest) = body.split_once(' ').unwrap();
        let (field, constant) = match rest.split_once('=') {
            Some((field, value)) => (field, Some(value.trim())),
            None => (rest, None),
        };
        let mut words = field.split_whitespace();
        let (name, default) = (words.next().unwrap(), words.next());
        assert_eq!(words.next(), None, "{body}");
        Line {
            kind,
            name,
            default,
            constant,
        }
    })
}

/// Full name of a message that a field refers to; `None` for what is no message.
fn full_name(kind: &str, package: &str) -> Option<String> {
    let name = kind.split('[').next().unwrap();
    match name.split_once('/') {
        Some((package, name)) => Some(format!("{package}/msg/{name}")),
        None if name.starts_with(char::is_uppercase) => Some(format!("{package}/msg/{name}")),
        None => None,
    }
}

/// Type of such a field in Rust.
fn as_rust_shows(kind: &str) -> String {
    let mut name = kind.rsplit('/').next().unwrap().replace("byte", "uint8");
    name = name.replace("char", "uint8");
    if name.starts_with(char::is_uppercase) {
        name = name.replace('_', "");
    }
    match name.split_once("<=") {
        Some((element, _)) if name.ends_with(']') => element.replace('[', "[]"),
        Some((element, _)) => element.to_owned(),
        None => name,
    }
}

struct FieldsAgree(usize);

impl MessageVisitor for FieldsAgree {
    fn visit<M: RosMessage>(&mut self) {
        let (_, struct_name, in_rust) = filled::<M>(1);
        let (package, name) = M::TYPE.split_once('/').unwrap();
        let name = name.rsplit('/').next().unwrap().replace('_', "");
        assert_eq!(struct_name, name);

        let fields = || lines(M::SCHEMA.text).filter(|line| line.constant.is_none());
        let in_text = fields().map(|field| (field.name, as_rust_shows(field.kind)));
        let mut in_text: Vec<_> = in_text.collect();
        if in_text.is_empty() {
            in_text.push(("structure_needs_at_least_one_member", "uint8".to_owned()));
        }
        assert_eq!(in_rust, in_text, "{}", M::TYPE);

        // Fields name a part of an action as if it were a message.
        let dependencies = M::SCHEMA.dependencies.iter();
        let mut stated: Vec<_> = dependencies
            .map(|d| d.type_name.replace("/action/", "/msg/"))
            .collect();
        stated.sort_unstable();
        let used: BTreeSet<_> = fields()
            .filter_map(|f| full_name(f.kind, package))
            .collect();
        assert_eq!(stated, Vec::from_iter(used), "dependencies of {}", M::TYPE);
        self.0 += 1;
    }
}

#[test]
fn fields_agree_in_name_type_and_order() {
    let mut fields = FieldsAgree(0);
    visit_messages(&mut fields);
    assert!(fields.0 > 60, "{} messages", fields.0);
}

#[derive(Default)]
struct Defaults(Vec<[&'static str; 3]>);

impl MessageVisitor for Defaults {
    fn visit<M: RosMessage>(&mut self) {
        let defaults = lines(M::SCHEMA.text).filter_map(|l| Some([M::TYPE, l.name, l.default?]));
        self.0
            .extend(defaults.filter(|[_, _, value]| !["0", "false"].contains(value)));
    }
}

#[test]
fn defaults_agree() {
    let mut defaults = Defaults::default();
    visit_messages(&mut defaults);
    assert_eq!(
        defaults.0,
        [
            ["geometry_msgs/msg/Quaternion", "w", "1"],
            ["sensor_msgs/msg/NavSatStatus", "status", "-2"],
            [
                "type_description_interfaces/srv/GetTypeDescription_Request",
                "include_type_sources",
                "true"
            ],
        ]
    );
    assert_eq!(geometry_msgs::Quaternion::default().w, 1.0);
    assert_eq!(sensor_msgs::NavSatStatus::default().status, -2);
    assert!(GetTypeDescriptionRequest::default().include_type_sources);
}
