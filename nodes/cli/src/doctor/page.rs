//! Findings and facts as text and as JSON.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use lattice_runtime::GraphRole::{Publisher, Subscriber};
use serde_json::json;

use super::facts::{Endpoint, Facts, Process};
use super::findings::Finding;

/// Rows of nodes and topics.
const MAX_ROWS: usize = 20;

/// `{"findings": [...], "facts": {...}}`.
pub fn json(findings: &[Finding], facts: &Facts) -> serde_json::Result<String> {
    serde_json::to_string_pretty(&json!({ "findings": findings, "facts": facts }))
}

/// Findings, then facts.
pub fn text(findings: &[Finding], facts: &Facts) -> String {
    let mut page = String::new();
    for Finding {
        severity,
        check,
        problem,
        remedy,
    } in findings
    {
        let _ = writeln!(
            page,
            "{} {check}: {problem}\n  remedy: {remedy}",
            severity.name()
        );
    }
    if findings.is_empty() {
        page.push_str("nothing found\n");
    }
    page.push('\n');
    for (name, value) in rows(facts) {
        let _ = writeln!(page, "{name:<16} {value}");
    }
    page
}

fn rows(facts: &Facts) -> Vec<(&'static str, String)> {
    let (network, machine) = (&facts.network, &facts.machine);
    let variable = network.rmw_implementation.as_deref().unwrap_or("unset");
    let mut rows = vec![
        ("version", format!("lattice {}", facts.version)),
        (
            "transport",
            format!("{} (RMW_IMPLEMENTATION {variable})", network.transport),
        ),
        ("domain", network.domain.to_string()),
        ("discovery range", network.range.name().to_owned()),
    ];
    if !network.static_peers.is_empty() {
        rows.push(("static peers", network.static_peers.join(", ")));
    }
    for interface in &machine.interfaces {
        let multicast = match interface.has_multicast {
            true => "multicast",
            false => "no multicast",
        };
        rows.push(("interface", format!("{} ({multicast})", interface.name)));
    }
    let buffer = machine.rmem_max.map_or_else(
        || "unknown".to_owned(),
        |bytes| format!("net.core.rmem_max {bytes} bytes"),
    );
    rows.push(("receive buffer", buffer));
    let process = |process: &Process| {
        let range = process.range.as_deref().unwrap_or("SUBNET");
        let (title, domain) = (process.title(), process.domain);
        format!("{title}, domain {domain}, range {range}")
    };
    let processes = machine.processes.iter().map(process);
    rows.extend(capped("process", processes.collect()));
    let clock = facts.time.simulated_s.map_or_else(
        || "no /clock".to_owned(),
        |seconds| format!("/clock is {seconds:+.3} s from the clock of this machine"),
    );
    rows.push(("clock", clock));
    let stamps = facts.time.stamps.iter();
    let stamps = stamps.map(|of| format!("{} {:+.3} s", of.topic, of.offset_s));
    rows.extend(capped("stamps", stamps.collect()));
    for of in &facts.map_dirs {
        let free = of.free_bytes.map_or_else(
            || "not on this machine".to_owned(),
            |bytes| format!("{:.1} GB free", bytes as f64 * 1e-9),
        );
        let text = format!("{} of {}: {free}", of.path.display(), of.node);
        rows.push(("map_dir", text));
    }
    rows.extend(capped("node", nodes(&facts.endpoints)));
    rows.extend(capped("type", hashes(&facts.endpoints)));
    rows.extend(capped("no partner", unconnected(&facts.endpoints)));
    rows
}

/// The first rows, and the number of the others.
fn capped(name: &'static str, rows: Vec<String>) -> Vec<(&'static str, String)> {
    let more = rows.len().saturating_sub(MAX_ROWS);
    let mut shown: Vec<_> = rows.into_iter().take(MAX_ROWS).collect();
    if more > 0 {
        shown.push(format!("and {more} more (--json)"));
    }
    shown.into_iter().map(|row| (name, row)).collect()
}

/// Nodes with the vendor of their participant.
fn nodes(endpoints: &[Endpoint]) -> Vec<String> {
    let row = |of: &Endpoint| {
        let prefix = of.participant.as_deref().and_then(|id| id.get(..4));
        match prefix {
            Some("0110") => format!("{} (Cyclone DDS)", of.node),
            Some("010f") => format!("{} (Fast DDS)", of.node),
            Some("0101") => format!("{} (Connext DDS)", of.node),
            Some(other) => format!("{} (DDS vendor {other})", of.node),
            None => of.node.clone(),
        }
    };
    let rows: BTreeSet<String> = endpoints.iter().map(row).collect();
    rows.into_iter().collect()
}

/// Message types of Lattice with their hashes.
fn hashes(endpoints: &[Endpoint]) -> Vec<String> {
    let row = |of: &Endpoint| {
        let name = of.type_name.as_deref()?;
        let hash = of.type_hash.as_deref().unwrap_or("without a hash");
        name.starts_with("lattice_msgs/")
            .then(|| format!("{name} {hash}"))
    };
    let rows: BTreeSet<String> = endpoints.iter().filter_map(row).collect();
    rows.into_iter().collect()
}

/// Topics of the infrastructure, which need no partner.
const OF_EVERY_NODE: [&str; 3] = ["/diagnostics", "/parameter_events", "/rosout"];

/// Topics with publishers or subscriptions alone.
fn unconnected(endpoints: &[Endpoint]) -> Vec<String> {
    let mut topics: BTreeMap<&str, Vec<&Endpoint>> = BTreeMap::new();
    let is_shown =
        |of: &&Endpoint| of.type_name.is_some() && !OF_EVERY_NODE.contains(&of.topic.as_str());
    for of in endpoints.iter().filter(is_shown) {
        topics.entry(&of.topic).or_default().push(of);
    }
    let lacks = |of: &[&Endpoint], role| of.iter().all(|of| of.role != role);
    let row = |(topic, of): (&str, Vec<&Endpoint>)| {
        if lacks(&of, Subscriber) {
            Some(format!("{topic}: no subscription"))
        } else if lacks(&of, Publisher) {
            Some(format!("{topic}: no publisher"))
        } else {
            None
        }
    };
    topics.into_iter().filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::facts::Stamps;

    #[test]
    fn findings_come_before_facts_and_long_lists_end() {
        let mut facts = Facts::default();
        let stamps = |i| Stamps {
            topic: format!("/points{i}"),
            offset_s: -0.5,
        };
        facts.time.stamps = (0..30).map(stamps).collect();
        let page = text(&[], &facts);
        assert!(page.starts_with("nothing found\n\nversion "), "{page}");
        assert!(
            page.contains("stamps           /points0 -0.500 s\n"),
            "{page}"
        );
        assert!(
            page.contains("stamps           and 10 more (--json)\n"),
            "{page}"
        );
        let all: serde_json::Value = serde_json::from_str(&json(&[], &facts).unwrap()).unwrap();
        let stamps = all["facts"]["time"]["stamps"].as_array();
        assert_eq!(stamps.map(Vec::len), Some(30));
    }
}
