//! Clocks and transforms.

use std::collections::BTreeSet;

use lattice_runtime::GraphRole::Publisher;

use super::super::facts::{Facts, Frame, Stamps};
use super::Severity::Error;
use super::{Finding, list};

/// Largest difference of two clocks, and age of a transform, s.
const MAX_OFFSET_S: f64 = 2.0;

/// Topics of nodes themselves, which a player of a log does not play.
const OF_NODES: [&str; 2] = ["/rosout", "/diagnostics"];

pub fn findings(facts: &Facts) -> Vec<Finding> {
    let mut found = Vec::new();
    found.extend(clocks(facts));
    found.extend(stale(facts));
    found.extend(facts.time.frames.iter().filter_map(parents));
    found
}

/// Stamps that are far from the clock, a finding for each clock.
fn clocks(facts: &Facts) -> Vec<Finding> {
    let time = &facts.time;
    let (reference, remedy) = match time.simulated_s {
        None => (
            "the clock of this machine",
            "synchronise the clocks of the machines (chrony, PTP); for a played log: publish /clock and set use_sim_time",
        ),
        Some(_) => (
            "/clock",
            "set use_sim_time of their nodes, or end the player that publishes /clock",
        ),
    };
    // Nodes may log in system time beside a played log.
    let is_exempt =
        |of: &Stamps| time.simulated_s.is_some() && OF_NODES.contains(&of.topic.as_str());
    let is_off = |of: &&Stamps| of.offset_s.abs() > MAX_OFFSET_S && !is_exempt(of);
    let mut off: Vec<&Stamps> = time.stamps.iter().filter(is_off).collect();
    off.sort_by(|a, b| a.offset_s.total_cmp(&b.offset_s));
    let is_same = |a: &&Stamps, b: &&Stamps| b.offset_s - a.offset_s < MAX_OFFSET_S;
    let finding = |of: &[&Stamps]| {
        let seconds = of.first().map_or(0, |of| of.offset_s.round() as i64);
        let topics: BTreeSet<&str> = of.iter().map(|of| of.topic.as_str()).collect();
        let nodes = publishers(facts, |topic| topics.contains(topic));
        Finding::new(
            Error,
            "clock",
            format!(
                "stamps on {} (of {}) are {} {} {reference}",
                list(topics),
                list(nodes),
                duration(seconds),
                if seconds < 0 { "behind" } else { "ahead of" },
            ),
            remedy,
        )
    };
    off.chunk_by(is_same).map(finding).collect()
}

/// Nodes that publish these topics.
fn publishers(facts: &Facts, is_wanted: impl Fn(&str) -> bool) -> BTreeSet<&str> {
    let all = facts.endpoints.iter();
    let of_topics = all.filter(|of| of.role == Publisher && is_wanted(&of.topic));
    of_topics.map(|of| of.node.as_str()).collect()
}

/// Transforms with old stamps, unless the clock of their publisher explains them.
fn stale(facts: &Facts) -> Option<Finding> {
    let by_clock = |offset: f64| {
        let mut stamps = facts.time.stamps.iter();
        stamps.any(|of| (of.offset_s - offset).abs() < MAX_OFFSET_S)
    };
    let old = facts.time.frames.iter().filter_map(|frame| {
        let offset = frame
            .offset_s
            .filter(|offset| offset.abs() > MAX_OFFSET_S)?;
        (!by_clock(offset)).then_some((frame.child.as_str(), offset))
    });
    let old: Vec<(&str, f64)> = old.collect();
    let largest = old.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let (is_old, seconds) = (largest.1 < 0.0, largest.1.round() as i64);
    let nodes = publishers(facts, |topic| topic == "/tf");
    Some(Finding::new(
        Error,
        "tf",
        format!(
            "stale transforms on /tf (of {}): the newest of {} is {} {}",
            list(nodes),
            list(old.iter().map(|(child, _)| *child)),
            duration(seconds),
            if is_old { "old" } else { "in the future" },
        ),
        "restart their publisher, and compare its use_sim_time and its input with the others",
    ))
}

/// A frame with two parents.
fn parents(frame: &Frame) -> Option<Finding> {
    (frame.parents.len() > 1).then(|| {
        Finding::new(
            Error,
            "tf",
            format!(
                "the frame {} has {} parents: {}",
                frame.child,
                frame.parents.len(),
                list(frame.parents.iter().map(String::as_str))
            ),
            "let one publisher give it: of Lattice nodes set publish_tf to false, or odom_frame of enu_transformer to the root of the other tree",
        )
    })
}

/// Seconds in words, without a sign.
fn duration(seconds: i64) -> String {
    match seconds.unsigned_abs() {
        s if s < 120 => format!("{s} s"),
        s if s < 7200 => format!("{} min", s / 60),
        s if s < 172_800 => format!("{} h", s / 3600),
        s => format!("{} days", s / 86_400),
    }
}
