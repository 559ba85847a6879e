//! DDS domains for tests: one for each test, apart from all else on the machine.

use lattice_runtime::LoopbackDomain;
use lattice_runtime::env::Network;

/// Variable that leaves it to multicast to find peers where it is set: for a network namespace of its own.
const MULTICAST: &str = "LATTICE_TEST_MULTICAST";

/// True unless the tests run in a network of their own that has multicast.
pub fn localhost_only() -> bool {
    std::env::var_os(MULTICAST).is_none()
}

/// A domain that no other test uses while this lives.
pub struct TestDomain(LoopbackDomain);

impl TestDomain {
    /// Takes a free domain. Panics if there is none.
    pub fn take() -> Self {
        Self(LoopbackDomain::take().unwrap())
    }

    /// The domain id, also for a foreign peer.
    pub fn id(&self) -> u16 {
        self.0.id()
    }

    /// The domain, on loopback unless set otherwise, over the transport that `RMW_IMPLEMENTATION`
    /// names.
    pub fn transport(&self) -> Network {
        Network {
            domain_id: self.id(),
            localhost_only: localhost_only(),
            ..Network::from_env().unwrap()
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
        assert!((1..=101).contains(&a.id()) && (1..=101).contains(&b.id()));
    }
}
