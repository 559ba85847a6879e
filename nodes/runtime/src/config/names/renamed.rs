//! Renamed topics, and remap rules with a former name.

use std::collections::BTreeSet;
use std::sync::Mutex;

use lattice_msgs::RosMessage;
use lattice_msgs::lattice::{LatticeMap, LatticeMapUpdate};

use super::shown;
use crate::sync::lock;

/// Last part of a topic, the former one, and the type. Nav2 uses the former names for other types.
const RENAMED: [(&str, &str, &str); 2] = [
    ("voxel_map", "map", LatticeMap::TYPE),
    ("voxel_map_updates", "map_updates", LatticeMapUpdate::TYPE),
];

/// Rules with a former name, once logged.
static LOGGED: Mutex<BTreeSet<(String, String)>> = Mutex::new(BTreeSet::new());

/// Former full name of a topic, if it was renamed.
pub(super) fn former_name(full: &str) -> Option<String> {
    let (head, last) = full.rsplit_once('/')?;
    let (_, former, _) = RENAMED.iter().find(|(new, ..)| *new == last)?;
    Some(format!("{head}/{former}"))
}

/// Present name of a topic that a log has under its former name, chosen by its type.
pub fn renamed_topic(logged: &str, type_name: &str) -> Option<String> {
    let (head, last) = logged.rsplit_once('/')?;
    let mut renamed = RENAMED.iter();
    let (new, ..) = renamed.find(|(_, former, of)| *former == last && *of == type_name)?;
    Some(format!("{head}/{new}"))
}

/// Logs once that a rule with a former name applies to the new one.
pub(super) fn warn_of_rule(from: &str, to: &str) {
    if lock(&LOGGED).insert((from.to_owned(), to.to_owned())) {
        log::warn!("{}", rule_line(from, to));
    }
}

fn rule_line(from: &str, to: &str) -> String {
    let (head, last) = from.rsplit_once('/').map_or(("", from), |(head, last)| {
        (from.get(..=head.len()).unwrap_or(head), last)
    });
    let new = RENAMED.iter().find(|(_, former, _)| *former == last);
    let new = new.map_or(last, |(new, ..)| new);
    let (from, to) = (shown(from), shown(to));
    let new = shown(&format!("{head}{new}"));
    format!(
        "remap rule {from}:={to}: the topic {from} of the voxel map is now {new}, and the rule applies to it; \
         write -r {new}:={to}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_are_read_by_type() {
        for (logged, type_name, expected) in [
            ("/map", LatticeMap::TYPE, Some("/voxel_map")),
            ("/a/map", LatticeMap::TYPE, Some("/a/voxel_map")),
            (
                "/map_updates",
                LatticeMapUpdate::TYPE,
                Some("/voxel_map_updates"),
            ),
            ("/map", "nav_msgs/msg/OccupancyGrid", None),
            ("/map_updates", "map_msgs/msg/OccupancyGridUpdate", None),
            ("/voxel_map", LatticeMap::TYPE, None),
            ("/free", LatticeMap::TYPE, None),
        ] {
            let found = renamed_topic(logged, type_name);
            assert_eq!(found.as_deref(), expected, "{logged} of {type_name}");
        }
    }

    #[test]
    fn the_line_has_the_new_rule() {
        for (from, new) in [
            ("map", "voxel_map"),
            ("/a/map_updates", "/a/voxel_map_updates"),
        ] {
            let line = rule_line(from, "/b");
            let (begin, end) = (
                format!("remap rule {from}:=/b:"),
                format!("write -r {new}:=/b"),
            );
            assert!(line.starts_with(&begin) && line.ends_with(&end), "{line}");
        }
    }
}
