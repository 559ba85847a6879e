use super::validate::NAMESPACE_LENGTH_MAX;
use super::validate::NODE_NAME_LENGTH_MAX;
use super::validate::TOPIC_LENGTH_MAX;
use super::*;

use proptest::prelude::*;

/// The full name of a topic of `mapper` after rules separated by blanks.
fn topic(name: &str, namespace: &str, rules: &str) -> Result<String, NameError> {
    resolved(NameKind::Topic, name, namespace, rules)
}

fn resolved(kind: NameKind, name: &str, namespace: &str, rules: &str) -> Result<String, NameError> {
    let rules = rules.split_whitespace().map(|rule| rule.parse().unwrap());
    resolve(kind, name, "mapper", namespace, &rules.collect::<Vec<_>>())
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
        let found = topic(name, "/robot", "");
        assert_eq!(found.as_deref(), Ok(expected), "{name}");
    }
    assert_eq!(topic("points", "/", "").as_deref(), Ok("/points"));
    assert_eq!(topic("~/map", "/", "").as_deref(), Ok("/mapper/map"));
}

#[test]
fn invalid_names_are_refused() {
    for name in [
        "", "/", "a/", "//a", "a//b", "1a", "a/1b", "/1a", "a b", "a-b", "a~b", "~a", "~ab", "~~",
        "{", "}", "{}", "{a", "a}", "{{node}}", "{1a}", "{a/b}", "{nope}", "ä", "a.b", "/a/{ns}",
        "a\0",
    ] {
        assert!(topic(name, "/robot", "").is_err(), "{name:?}");
    }
    assert!(topic("{ns}/a", "/", "").is_err(), "`//a` after expansion");
    assert!(topic("a", "robot", "").is_err());
    assert!(resolve(NameKind::Topic, "a", "ma pper", "/", &[]).is_err());
}

#[test]
fn lengths_are_those_of_rmw() {
    let name = |bytes: usize| format!("/{}", "a".repeat(bytes - 1));
    assert!(validate_full_name(&name(TOPIC_LENGTH_MAX)).is_ok());
    let error = validate_full_name(&name(TOPIC_LENGTH_MAX + 1)).unwrap_err();
    assert!(error.to_string().contains("has 248 bytes, more than 247"));
    assert!(validate_namespace(&name(NAMESPACE_LENGTH_MAX + 1)).is_err());
    assert!(validate_node_name(&"a".repeat(NODE_NAME_LENGTH_MAX + 1)).is_err());
}

#[test]
fn the_first_rule_that_matches_counts_and_both_sides_are_expanded() {
    let chain = "foo:=bar foo:=late bar:=baz";
    let expanded = "foo:=~/bar /robot/x:=/y ~/map:=map";
    let kinds = "other:a:=wrong rosservice://a:=service rostopic://a:=topic";
    for (rules, namespace, name, expected) in [
        (chain, "/", "foo", "/bar"),
        (chain, "/", "bar", "/baz"),
        (expanded, "/robot", "foo", "/robot/mapper/bar"),
        (expanded, "/robot", "x", "/y"),
        (expanded, "/robot", "~/map", "/robot/map"),
        (expanded, "/robot", "/foo", "/foo"),
        (kinds, "/", "a", "/topic"),
    ] {
        let found = topic(name, namespace, rules);
        assert_eq!(found.as_deref(), Ok(expected), "{name} by {rules}");
    }
    let service = resolved(NameKind::Service, "a", "/", kinds);
    assert_eq!(service.as_deref(), Ok("/service"));
    let rule = ["other:a:=right".parse().unwrap()];
    let other = resolve(NameKind::Topic, "a", "other", "/", &rule);
    assert_eq!(other.as_deref(), Ok("/right"));
}

#[test]
fn a_rule_with_a_former_name_applies_to_the_new_one() {
    for (rules, name, expected) in [
        ("map:=/old", "voxel_map", "/old"),
        ("map:=/old voxel_map:=/new", "voxel_map", "/new"),
        ("/robot/map:=/old", "voxel_map", "/old"),
        ("map:=/old", "voxel_map_updates", "/robot/voxel_map_updates"),
        (
            "map_updates:=updates",
            "voxel_map_updates",
            "/robot/updates",
        ),
        ("mapper:map:=a map:=b", "voxel_map", "/robot/a"),
        ("other:map:=a", "voxel_map", "/robot/voxel_map"),
        ("rosservice://map:=a", "voxel_map", "/robot/voxel_map"),
        ("map:=/old", "map", "/old"),
        ("map:=/old", "map_centers", "/robot/map_centers"),
    ] {
        let found = topic(name, "/robot", rules);
        assert_eq!(found.as_deref(), Ok(expected), "{name} by {rules}");
    }
    let service = resolved(NameKind::Service, "voxel_map", "/", "map:=/old");
    assert_eq!(service.as_deref(), Ok("/voxel_map"));
}

#[test]
fn long_and_odd_arguments_stay_readable() {
    assert_eq!(shown("a\nb"), "a\\nb");
    assert_eq!(shown(&"x".repeat(1000)).chars().count(), 161);
}

proptest! {
    #[test]
    fn any_text_is_refused_or_becomes_a_full_name(name in "\\PC{0,20}|[a-z~/{}_0-9]{0,20}") {
        if let Ok(full) = topic(&name, "/robot", "") {
            prop_assert!(validate_full_name(&full).is_ok());
            prop_assert_eq!(topic(&full, "/robot", ""), Ok(full));
        }
    }

    #[test]
    fn tokens_are_always_valid_names(name in "[A-Za-z_]{1,2}[A-Za-z0-9]{0,8}(/[a-z][a-z0-9]{0,8}){0,3}") {
        prop_assert_eq!(topic(&name, "/robot", ""), Ok(format!("/robot/{name}")));
    }
}
