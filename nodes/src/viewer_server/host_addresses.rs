//! Addresses of this machine.

use std::fs;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, UdpSocket};

/// Addresses of documentation networks (RFC 5737, RFC 3849), which are behind the default route.
const ELSEWHERE: [&str; 2] = ["203.0.113.1:9", "[2001:db8::1]:9"];

/// Addresses at which a server with this listening address is reached, the one on the default route first.
pub fn reachable(listening: IpAddr) -> Vec<IpAddr> {
    if !listening.is_unspecified() {
        return vec![listening];
    }
    let table = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let lasting: Vec<IpAddr> = ipv6_of(&table("/proc/net/if_inet6"))
        .map(IpAddr::from)
        .collect();
    let mut found: Vec<IpAddr> = ELSEWHERE.iter().filter_map(|to| source_of(to)).collect();
    // The system prefers addresses that last a short time.
    found.retain(|source| source.is_ipv4() || lasting.contains(source));
    found.extend(ipv4_of(&table("/proc/net/fib_trie")).map(IpAddr::from));
    found.extend(lasting);
    let mut unique = Vec::new();
    for address in found {
        let is_served = address.is_ipv4() || listening.is_ipv6();
        if is_served && !address.is_loopback() && !unique.contains(&address) {
            unique.push(address);
        }
    }
    if unique.is_empty() {
        unique.push(Ipv4Addr::LOCALHOST.into());
    }
    unique
}

/// Source address of the route to another address; nothing is sent.
fn source_of(to: &str) -> Option<IpAddr> {
    let any = match to.starts_with('[') {
        true => IpAddr::from(Ipv6Addr::UNSPECIFIED),
        false => IpAddr::from(Ipv4Addr::UNSPECIFIED),
    };
    let socket = UdpSocket::bind((any, 0)).ok()?;
    socket.connect(to).ok()?;
    let address = socket.local_addr().ok()?.ip();
    (!address.is_unspecified()).then_some(address)
}

/// Addresses of the text of `/proc/net/fib_trie`: the line after an address has `/32 host LOCAL`.
fn ipv4_of(text: &str) -> impl Iterator<Item = Ipv4Addr> {
    let lines = text.lines().zip(text.lines().skip(1));
    lines.filter_map(|(line, next)| {
        let address = line.trim().strip_prefix("|-- ")?.parse().ok()?;
        (next.trim() == "/32 host LOCAL").then_some(address)
    })
}

/// Global addresses of the text of `/proc/net/if_inet6`, without those that last a short time (RFC 8981) or are not in use.
fn ipv6_of(text: &str) -> impl Iterator<Item = Ipv6Addr> {
    const TEMPORARY_DEPRECATED_OR_TENTATIVE: u8 = 0x01 | 0x20 | 0x40;
    text.lines().filter_map(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [address, _, _, "00", flags, _] = fields[..] else {
            return None;
        };
        let flags = u8::from_str_radix(flags, 16).ok()?;
        let bits = u128::from_str_radix(address, 16).ok()?;
        (flags & TEMPORARY_DEPRECATED_OR_TENTATIVE == 0).then(|| Ipv6Addr::from_bits(bits))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_those_of_the_tables_of_the_kernel() {
        let trie = "Main:\n  +-- 0.0.0.0/0 3 0 5\n     |-- 0.0.0.0\n        /0 universe UNICAST\n     |-- 192.0.2.2\n        \
            /32 host LOCAL\n     |-- 192.0.2.255\n        /32 link BROADCAST\nLocal:\n     |-- 127.0.0.1\n        /32 host LOCAL\n";
        let found: Vec<_> = ipv4_of(trie).collect();
        assert_eq!(found, [Ipv4Addr::new(192, 0, 2, 2), Ipv4Addr::LOCALHOST]);
        let text = "fd000000000000000000000000000002 02 40 00 80 eth0\nfd0000000000000000000000000000aa 02 40 00 01 eth0\n\
            fe8000000000000000fc00fffe000001 02 40 20 80 eth0\n00000000000000000000000000000001 01 80 10 80 lo\nnonsense\n";
        let found: Vec<_> = ipv6_of(text).collect();
        assert_eq!(found, ["fd00::2".parse::<Ipv6Addr>().unwrap()]);
    }

    #[test]
    fn a_server_on_all_addresses_is_reached_at_the_one_of_the_default_route_first() {
        let any = IpAddr::from(Ipv4Addr::UNSPECIFIED);
        let found = reachable(any);
        assert!(found.iter().all(IpAddr::is_ipv4) && !found.is_empty());
        if let Some(first) = source_of(ELSEWHERE[0]) {
            assert_eq!(found[0], first);
        }
        let one = IpAddr::from([10, 1, 2, 3]);
        assert_eq!(reachable(one), [one]);
    }
}
