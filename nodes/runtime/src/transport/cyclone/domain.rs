//! Cyclone domains of the process, one per number, each with one configuration.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::sync::Mutex;

use lattice_cyclone_sys::dds_create_domain;

use super::config::config;
use super::entity::Entity;
use super::log::{self, explained};
use crate::config::env::Network;
use crate::sync::lock;
use crate::transport::confine::to_loopback;

static DOMAINS: Mutex<BTreeMap<u16, Shared>> = Mutex::new(BTreeMap::new());

struct Shared {
    users: usize,
    _domain: Entity,
}

/// A reference to a domain; dropping the last one deletes it.
#[derive(Debug)]
pub(super) struct Domain(u16);

impl Domain {
    /// Opens or shares the domain of the network. The first caller's settings apply to all.
    pub(super) fn join(network: &Network) -> Result<Self, String> {
        log::take_over();
        let id = network.domain_id;
        let mut domains = lock(&DOMAINS);
        if let Some(shared) = domains.get_mut(&id) {
            shared.users += 1;
            return Ok(Self(id));
        }
        let uri = std::env::var("CYCLONEDDS_URI").ok();
        let config = CString::new(config(network, uri.as_deref()));
        let config = config.map_err(|_| "CYCLONEDDS_URI has a zero byte".to_owned())?;
        // SAFETY: a NUL-terminated string, read during the call.
        let make = || unsafe { dds_create_domain(u32::from(id), config.as_ptr()) };
        let domain = explained(|| match network.localhost_only {
            true => to_loopback(make),
            false => make(),
        })?;
        let shared = Shared {
            users: 1,
            _domain: domain,
        };
        let _ = domains.insert(id, shared);
        Ok(Self(id))
    }

    pub(super) fn id(&self) -> u32 {
        u32::from(self.0)
    }
}

impl Drop for Domain {
    fn drop(&mut self) {
        // Deleted under the lock: Cyclone refuses to create a domain while another thread deletes it.
        let mut domains = lock(&DOMAINS);
        let Some(shared) = domains.get_mut(&self.0) else {
            return;
        };
        shared.users -= 1;
        if shared.users == 0 {
            let _ = domains.remove(&self.0);
        }
    }
}
