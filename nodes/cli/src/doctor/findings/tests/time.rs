use super::*;

#[test]
fn clocks_differ() {
    let hour = |facts: &mut Facts| {
        facts.time.stamps = vec![stamps("/points", 3600.2)];
        // By the same clock.
        facts.time.frames = vec![frame("base_link", 3599.5)];
    };
    let words = ["/points (of /lidar) are 60 min ahead of the clock of this machine"];
    names(hour, Severity::Error, "clock", &words);
    let mut two = sound();
    two.time.stamps = vec![
        stamps("/a", 3600.2),
        stamps("/b", 3601.0),
        stamps("/c", -9.0),
    ];
    let problems: Vec<String> = findings(&two).into_iter().map(|of| of.problem).collect();
    assert_eq!(problems.len(), 2, "{problems:?}");
    assert!(problems[0].starts_with("stamps on /c"), "{problems:?}");
    assert!(problems[1].starts_with("stamps on /a, /b"), "{problems:?}");
    let played = |facts: &mut Facts| {
        facts.time.simulated_s = Some(-1e6);
        facts.time.stamps = vec![stamps("/points", 1e6), stamps("/rosout", 1e6)];
    };
    let words = ["/points (of /lidar) are 11 days ahead of /clock"];
    names(played, Severity::Error, "clock", &words);
}

#[test]
fn transforms_are_stale_or_have_two_parents() {
    let old = |facts: &mut Facts| facts.time.frames = vec![frame("base_link", -30.0)];
    let words = ["stale transforms on /tf (of /odometry): the newest of base_link is 30 s old"];
    names(old, Severity::Error, "tf", &words);
    let twice = |facts: &mut Facts| {
        facts.time.frames[0].parents.insert("map".to_owned());
    };
    names(
        twice,
        Severity::Error,
        "tf",
        &["base_link has 2 parents: map, odom"],
    );
}

#[test]
fn a_disk_is_full() {
    let full = |facts: &mut Facts| facts.map_dirs[0].free_bytes = Some(0);
    let words = ["map_dir /maps (/lattice_mapper) has 0.0 MB free"];
    names(full, Severity::Error, "disk", &words);
    let mut elsewhere = sound();
    elsewhere.map_dirs[0].free_bytes = None;
    assert_eq!(findings(&elsewhere), []);
}

#[test]
fn buffers_and_variables() {
    let short = |facts: &mut Facts| facts.machine.rmem_max = Some(212_992);
    names(short, Severity::Info, "buffers", &["212992 bytes"]);
    let warned = |facts: &mut Facts| facts.network.warnings = vec!["ROS_X is odd".to_owned()];
    names(warned, Severity::Warn, "environment", &["ROS_X is odd"]);
}
