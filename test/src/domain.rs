//! DDS domains for tests: one for each test, whatever else runs on the machine.

use std::fs::{File, OpenOptions};

use lattice_nodes::runtime::env::{DiscoveryRange, Transport};

/// Domains whose ports lie below those that Linux gives to outgoing connections, without 0.
const DOMAINS: std::ops::RangeInclusive<u16> = 1..=101;

/// A domain that no other test uses while this lives.
///
/// Without multicast RustDDS looks for the first twelve participants of a domain on loopback only.
pub struct TestDomain {
    id: u16,
    _lock: File,
}

impl TestDomain {
    /// Takes a free domain: the first whose lock file nobody holds. Panics if there is none.
    #[expect(clippy::expect_used, reason = "a test without a domain cannot go on")]
    pub fn take() -> Self {
        let directory = std::env::temp_dir().join("lattice_test_domains");
        std::fs::create_dir_all(&directory).expect("directory of lock files");
        // Tests of one process start at different places, so they rarely meet.
        let start = u16::try_from(std::process::id() % 101).unwrap_or(0);
        DOMAINS
            .map(|domain| (domain + start) % 101 + 1)
            .find_map(|id| {
                let path = directory.join(format!("{id}.lock"));
                let file = OpenOptions::new()
                    .create(true)
                    .append(true)
                    .open(path)
                    .ok()?;
                file.try_lock().ok()?;
                Some(Self { id, _lock: file })
            })
            .expect("a free DDS domain among 1..=101")
    }

    /// The domain id, also for a foreign peer.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// The domain on loopback only.
    pub fn transport(&self) -> Transport {
        Transport {
            domain_id: self.id,
            discovery: DiscoveryRange::Localhost,
            localhost_only: true,
            static_peers: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn domains_are_apart_while_they_live() {
        let (a, b) = (TestDomain::take(), TestDomain::take());
        assert_ne!(a.id(), b.id());
        assert!(DOMAINS.contains(&a.id()) && DOMAINS.contains(&b.id()));
    }
}
