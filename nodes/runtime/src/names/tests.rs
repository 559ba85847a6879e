use super::*;
use proptest::prelude::*;

fn rules(texts: &[&str]) -> Vec<RemapRule> {
    texts.iter().map(|text| text.parse().unwrap()).collect()
}

#[test]
fn names_expand_as_in_rcl() {
    for (name, expected) in [
        ("/points", "/points"),
        ("points", "/robot/points"),
        ("a/b", "/robot/a/b"),
        ("~", "/robot/mapper"),
        ("~/map", "/robot/mapper/map"),
        ("{node}", "/robot/mapper"),
        ("{node}_map", "/robot/mapper_map"),
        ("{ns}/map", "/robot/map"),
        ("{namespace}/{node}/map", "/robot/mapper/map"),
        ("/{node}/map", "/mapper/map"),
        ("~/{node}", "/robot/mapper/mapper"),
        ("a__b", "/robot/a__b"),
        ("_a", "/robot/_a"),
    ] {
        assert_eq!(
            resolve_topic(name, "mapper", "/robot", &[]).as_deref(),
            Ok(expected),
            "{name}"
        );
    }
    assert_eq!(
        resolve_topic("points", "mapper", "/", &[]).as_deref(),
        Ok("/points")
    );
    assert_eq!(
        resolve_topic("~/map", "mapper", "/", &[]).as_deref(),
        Ok("/mapper/map")
    );
}

#[test]
fn invalid_names_are_refused() {
    for name in [
        "", "/", "a/", "//a", "a//b", "1a", "a/1b", "/1a", "a b", "a-b", "a~b", "~a", "~ab", "~~",
        "{", "}", "{}", "{a", "a}", "{{node}}", "{1a}", "{a/b}", "{nope}", "ä", "a.b", "/a/{ns}",
        "a\0",
    ] {
        assert!(
            resolve_topic(name, "mapper", "/robot", &[]).is_err(),
            "{name:?}"
        );
    }
    assert!(
        resolve_topic("{ns}/a", "mapper", "/", &[]).is_err(),
        "`//a` after expansion"
    );
    assert!(resolve_topic("a", "ma pper", "/", &[]).is_err());
    assert!(resolve_topic("a", "mapper", "robot", &[]).is_err());
}

#[test]
fn lengths_are_those_of_rmw() {
    let name = |bytes: usize| format!("/{}", "a".repeat(bytes - 1));
    assert!(validate_full_name(&name(TOPIC_LENGTH_MAX)).is_ok());
    assert_eq!(
        validate_full_name(&name(TOPIC_LENGTH_MAX + 1)).unwrap_err(),
        NameError::TooLong {
            what: "topic",
            name: name(248),
            length: 248,
            length_max: 247
        }
    );
    assert!(validate_namespace(&name(NAMESPACE_LENGTH_MAX + 1)).is_err());
    assert!(validate_node_name(&"a".repeat(NODE_NAME_LENGTH_MAX + 1)).is_err());
}

#[test]
fn first_matching_rule_wins_and_applies_once() {
    let rules = rules(&["foo:=bar", "foo:=late", "bar:=baz"]);
    assert_eq!(
        resolve_topic("foo", "mapper", "/", &rules).as_deref(),
        Ok("/bar")
    );
    assert_eq!(
        resolve_topic("bar", "mapper", "/", &rules).as_deref(),
        Ok("/baz")
    );
}

#[test]
fn both_sides_of_a_rule_are_expanded() {
    let rules = rules(&["foo:=~/bar", "/robot/x:=/y", "~/map:=map"]);
    assert_eq!(
        resolve_topic("foo", "mapper", "/robot", &rules).as_deref(),
        Ok("/robot/mapper/bar")
    );
    assert_eq!(
        resolve_topic("x", "mapper", "/robot", &rules).as_deref(),
        Ok("/y")
    );
    assert_eq!(
        resolve_topic("~/map", "mapper", "/robot", &rules).as_deref(),
        Ok("/robot/map")
    );
    assert_eq!(
        resolve_topic("/foo", "mapper", "/robot", &rules).as_deref(),
        Ok("/foo")
    );
}

#[test]
fn rules_know_nodes_topics_and_services() {
    let rules = rules(&[
        "other:a:=wrong",
        "rosservice://a:=service",
        "rostopic://a:=topic",
    ]);
    assert_eq!(
        resolve_topic("a", "mapper", "/", &rules).as_deref(),
        Ok("/topic")
    );
    assert_eq!(
        resolve_service("a", "mapper", "/", &rules).as_deref(),
        Ok("/service")
    );
    assert_eq!(
        resolve_topic("a", "other", "/", &rules).as_deref(),
        Ok("/wrong")
    );
}

#[test]
fn dds_names_carry_the_ros_prefixes() {
    assert_eq!(dds_topic("/robot/points"), "rt/robot/points");
    assert_eq!(dds_request("/mapper/reset"), "rq/mapper/resetRequest");
    assert_eq!(dds_reply("/mapper/reset"), "rr/mapper/resetReply");
}

proptest! {
    #[test]
    fn any_text_is_refused_or_becomes_a_full_name(name in "\\PC{0,20}|[a-z~/{}_0-9]{0,20}") {
        if let Ok(full) = resolve_topic(&name, "mapper", "/robot", &[]) {
            prop_assert!(validate_full_name(&full).is_ok());
            prop_assert_eq!(resolve_topic(&full, "mapper", "/robot", &[]), Ok(full));
        }
    }

    #[test]
    fn tokens_are_always_valid_names(name in "[A-Za-z_]{1,2}[A-Za-z0-9]{0,8}(/[a-z][a-z0-9]{0,8}){0,3}") {
        let full = resolve_topic(&name, "mapper", "/robot", &[]);
        prop_assert_eq!(full, Ok(format!("/robot/{name}")));
    }
}
