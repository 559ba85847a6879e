//! Locks on DDS domains of this machine, which separate replays and tests.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::PermissionsExt;

/// Domains 1 to 101, whose ports lie below the ephemeral range of Linux.
const DOMAINS: u16 = 101;

/// Exclusive lock on a DDS domain of this machine, other than `ROS_DOMAIN_ID`.
pub struct LoopbackDomain {
    id: u16,
    _lock: File,
}

impl LoopbackDomain {
    /// Locks the first free domain of 1 to 101.
    pub fn take() -> io::Result<Self> {
        let directory = std::env::temp_dir().join("lattice_domains");
        std::fs::create_dir_all(&directory)?;
        // Other users lock domains there too.
        let shared = std::fs::Permissions::from_mode(0o1777);
        let _ = std::fs::set_permissions(&directory, shared);
        // Domain of the robot's own nodes.
        let own = std::env::var("ROS_DOMAIN_ID").ok();
        let own = own.and_then(|id| id.trim().parse::<u16>().ok());
        // Different start values make collisions of processes rare.
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
            .ok_or_else(|| io::Error::other("no free DDS domain in 1..=101"))
    }

    /// The domain id.
    pub fn id(&self) -> u16 {
        self.id
    }
}
