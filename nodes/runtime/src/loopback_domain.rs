//! Locks on DDS domains of this machine, which keep replays and tests apart.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::PermissionsExt;

/// Domains whose ports lie below those that Linux gives to outgoing connections, without 0.
const DOMAINS: u16 = 101;

/// A domain that no other replay or test on this machine uses while this lives, and that `ROS_DOMAIN_ID` does not name.
pub struct LoopbackDomain {
    id: u16,
    _lock: File,
}

impl LoopbackDomain {
    /// Takes the first domain of 1 to 101 whose lock file nobody holds.
    pub fn take() -> io::Result<Self> {
        let directory = std::env::temp_dir().join("lattice_domains");
        std::fs::create_dir_all(&directory)?;
        // Other users lock domains there too.
        let shared = std::fs::Permissions::from_mode(0o1777);
        let _ = std::fs::set_permissions(&directory, shared);
        // That of the robot's own nodes.
        let own = std::env::var("ROS_DOMAIN_ID").ok();
        let own = own.and_then(|id| id.trim().parse::<u16>().ok());
        // Processes start at different places, so they rarely meet.
        let start = u16::try_from(std::process::id() % u32::from(DOMAINS)).unwrap_or(0);
        (0..DOMAINS)
            .map(|domain| (domain + start) % DOMAINS + 1)
            .filter(|id| Some(*id) != own)
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
            .ok_or_else(|| io::Error::other("no free DDS domain among 1 to 101"))
    }

    /// The domain id.
    pub fn id(&self) -> u16 {
        self.id
    }
}
