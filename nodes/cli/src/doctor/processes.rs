//! Processes of this machine with sockets of DDS, by the ports of their domains (RTPS 9.6.1.1).

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::facts::Process;

/// Port of the first domain, ports of a domain, and the highest domain.
const PORT_BASE: u16 = 7400;
const DOMAIN_GAIN: u16 = 250;
const DOMAIN_MAX: u16 = 232;

/// Ephemeral ports of Linux: sockets of any program.
const EPHEMERAL: std::ops::RangeInclusive<u16> = 32_768..=60_999;

/// Longest environment that is read, bytes.
const MAX_ENVIRONMENT_BYTES: usize = 1 << 20;

/// Port of the multicast announcements of a domain.
pub fn multicast_port(domain: u16) -> Option<u16> {
    let offset = domain.checked_mul(DOMAIN_GAIN)?;
    PORT_BASE.checked_add(offset)
}

/// Domain of a port of DDS.
fn domain(port: u16) -> Option<u16> {
    let above = port.checked_sub(PORT_BASE)?;
    let (domain, offset) = (above / DOMAIN_GAIN, above % DOMAIN_GAIN);
    // Multicast ports are 0 and 1, those of participants begin at 10.
    let is_used = offset <= 1 || offset >= 10;
    (is_used && domain <= DOMAIN_MAX && !EPHEMERAL.contains(&port)).then_some(domain)
}

/// Domains of sockets by inode, of the text of `/proc/net/udp`.
fn sockets(text: &str) -> BTreeMap<u64, u16> {
    let socket = |line: &str| {
        let mut fields = line.split_whitespace();
        let port = fields.nth(1)?.split_once(':')?.1;
        let inode = fields.nth(7)?.parse().ok()?;
        let domain = domain(u16::from_str_radix(port, 16).ok()?)?;
        Some((inode, domain))
    };
    text.lines().filter_map(socket).collect()
}

/// Processes in DDS domains, without this one.
pub fn in_domains() -> Vec<Process> {
    let text = fs::read_to_string("/proc/net/udp").unwrap_or_default();
    let mut sockets = sockets(&text);
    let mut found = Vec::new();
    for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let pid = entry
            .file_name()
            .to_str()
            .and_then(|name| name.parse().ok());
        let Some(pid) = pid else {
            continue;
        };
        let mut domains = BTreeSet::new();
        let descriptors = fs::read_dir(entry.path().join("fd"));
        for descriptor in descriptors.into_iter().flatten().flatten() {
            let target = fs::read_link(descriptor.path()).unwrap_or_default();
            let inode = target.to_str().and_then(inode);
            // A socket that is inherited belongs to the first process.
            domains.extend(inode.and_then(|inode| sockets.remove(&inode)));
        }
        if pid != std::process::id() {
            found.extend(
                domains
                    .iter()
                    .map(|domain| process(&entry.path(), pid, *domain)),
            );
        }
    }
    let others: BTreeSet<u16> = sockets.into_values().collect();
    found.extend(others.into_iter().map(|domain| Process {
        name: "a process of another user".to_owned(),
        domain,
        ..Process::default()
    }));
    found
}

/// Inode of `socket:[123]`.
fn inode(target: &str) -> Option<u64> {
    let inode = target.strip_prefix("socket:[")?.strip_suffix(']')?;
    inode.parse().ok()
}

fn process(folder: &Path, pid: u32, domain: u16) -> Process {
    let environment = fs::read(folder.join("environ")).unwrap_or_default();
    let environment = environment
        .get(..MAX_ENVIRONMENT_BYTES)
        .unwrap_or(&environment);
    let variable = |name: &str| variable(environment, name);
    let name = fs::read_to_string(folder.join("comm")).unwrap_or_default();
    let localhost_only = variable("ROS_LOCALHOST_ONLY").filter(|value| value == "1");
    let localhost_only = localhost_only.map(|_| "LOCALHOST".to_owned());
    Process {
        pid: Some(pid),
        name: name.trim().to_owned(),
        domain,
        range: localhost_only.or_else(|| variable("ROS_AUTOMATIC_DISCOVERY_RANGE")),
        rmw_implementation: variable("RMW_IMPLEMENTATION"),
        folder: fs::read_link(folder.join("cwd")).ok(),
    }
}

/// Variable of an environment; an empty one counts as unset.
fn variable(environment: &[u8], name: &str) -> Option<String> {
    let mut all = environment.split(|byte| *byte == 0);
    let value = all.find_map(|of| of.strip_prefix(name.as_bytes())?.strip_prefix(b"="))?;
    (!value.is_empty()).then(|| String::from_utf8_lossy(value).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_of_domains() {
        let ports = [
            7399, 7400, 7401, 7402, 7410, 7649, 7650, 7660, 40_000, 65_411,
        ];
        let expected = [
            None,
            Some(0),
            Some(0),
            None,
            Some(0),
            Some(0),
            Some(1),
            Some(1),
            None,
            Some(232),
        ];
        assert_eq!(ports.map(domain), expected);
        assert_eq!(multicast_port(7), Some(9150));
    }

    #[test]
    fn sockets_are_read_from_the_table_of_the_kernel() {
        let text = "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref\n\
            1: 0100007F:1CF2 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000        0 4711 2 0 0\n\
            2: 00000000:0035 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000        0 4712 2 0 0\n\
            cut";
        assert_eq!(sockets(text), BTreeMap::from([(4711, 0)]));
        assert_eq!(inode("socket:[4711]"), Some(4711));
        assert_eq!(inode("/dev/null"), None);
    }

    #[test]
    fn variables_are_of_the_environment() {
        let environment = b"A=1\0ROS_DOMAIN_ID=7\0EMPTY=\0";
        assert_eq!(variable(environment, "ROS_DOMAIN_ID").as_deref(), Some("7"));
        assert_eq!(variable(environment, "EMPTY"), None);
        assert_eq!(variable(environment, "ROS"), None);
    }
}
