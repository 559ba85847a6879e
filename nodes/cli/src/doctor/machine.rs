//! Interfaces, multicast, socket buffers and disks of this machine.

use std::fs;
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;
use std::time::Duration;

use super::facts::Interface;

/// Multicast address of discovery (RTPS).
pub const DISCOVERY_ADDRESS: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);

/// Time for a datagram of this process to itself.
const LOOP_TIME: Duration = Duration::from_millis(500);

/// Flags of an interface (`linux/if.h`).
const UP: u32 = 0x1;
const LOOPBACK: u32 = 0x8;
const MULTICAST: u32 = 0x1000;

/// Interfaces that are up.
pub fn interfaces() -> Vec<Interface> {
    let Ok(all) = fs::read_dir("/sys/class/net") else {
        return Vec::new();
    };
    // `/sys` may be of another network namespace.
    let here = fs::read_to_string("/proc/net/dev").unwrap_or_default();
    let here = here.lines().filter_map(|line| line.split_once(':'));
    let here: Vec<&str> = here.map(|(name, _)| name.trim()).collect();
    let interface = |entry: fs::DirEntry| {
        let flags = fs::read_to_string(entry.path().join("flags")).ok()?;
        let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).ok()?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_here = here.contains(&name.as_str());
        (is_here && flags & UP != 0).then_some(Interface {
            name,
            is_loopback: flags & LOOPBACK != 0,
            has_multicast: flags & MULTICAST != 0,
        })
    };
    let mut found: Vec<_> = all.flatten().filter_map(interface).collect();
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

/// Error of a multicast datagram of this process to itself, on the interface of the default route.
pub fn multicast_error() -> Option<String> {
    let received = || -> std::io::Result<()> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        socket.join_multicast_v4(&DISCOVERY_ADDRESS, &Ipv4Addr::UNSPECIFIED)?;
        socket.set_read_timeout(Some(LOOP_TIME))?;
        let port = socket.local_addr()?.port();
        socket.send_to(b"lattice", (DISCOVERY_ADDRESS, port))?;
        socket.recv(&mut [0; 8])?;
        Ok(())
    };
    received().err().map(|error| error.to_string())
}

/// `net.core.rmem_max`, bytes.
pub fn rmem_max() -> Option<u64> {
    let text = fs::read_to_string("/proc/sys/net/core/rmem_max").ok()?;
    text.trim().parse().ok()
}

/// Free bytes of the disk of a folder; `None`: no such folder on this machine.
pub fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_interfaces_and_disks() {
        let all = interfaces();
        assert!(
            all.iter().any(|of| of.name == "lo" && of.is_loopback),
            "{all:?}"
        );
        assert!(free_bytes(Path::new("/")).is_some());
        assert_eq!(free_bytes(Path::new("/not/here")), None);
    }
}
