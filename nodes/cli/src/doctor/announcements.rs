//! Participants of other machines that announce themselves in other domains.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};

use rustix::net::sockopt::set_socket_reuseaddr;
use rustix::net::{AddressFamily, SocketType, bind, socket};

use super::machine::DISCOVERY_ADDRESS;
use super::processes::multicast_port;

/// Highest domain.
const DOMAIN_MAX: u16 = 232;

/// Datagrams that are read of each domain.
const MAX_DATAGRAMS: usize = 256;

/// First bytes of every message of RTPS.
const MAGIC: &[u8] = b"RTPS";

/// Sockets on the multicast ports of all domains but one.
pub struct Announcements(Vec<(u16, UdpSocket)>);

impl Announcements {
    /// Listens; domains whose port is not available are omitted.
    pub fn listen(own_domain: u16) -> Self {
        let others = (0..=DOMAIN_MAX).filter(|domain| *domain != own_domain);
        let opened =
            others.filter_map(|domain| Some((domain, open(multicast_port(domain)?).ok()?)));
        Self(opened.collect())
    }

    /// Senders since the start, by domain.
    pub fn senders(&self) -> BTreeMap<u16, BTreeSet<String>> {
        let mut senders: BTreeMap<u16, BTreeSet<String>> = BTreeMap::new();
        for (domain, socket) in &self.0 {
            let mut head = [0; 4];
            for _ in 0..MAX_DATAGRAMS {
                let Ok((_, sender)) = socket.recv_from(&mut head) else {
                    break;
                };
                if head == MAGIC {
                    let sender = sender.ip().to_string();
                    senders.entry(*domain).or_default().insert(sender);
                }
            }
        }
        senders
    }
}

/// Opens a socket that shares its port with the participants of this machine.
fn open(port: u16) -> io::Result<UdpSocket> {
    let made = socket(AddressFamily::INET, SocketType::DGRAM, None)?;
    set_socket_reuseaddr(&made, true)?;
    // The group alone: no datagram of another socket arrives here.
    bind(&made, &SocketAddrV4::new(DISCOVERY_ADDRESS, port))?;
    let made = UdpSocket::from(made);
    made.join_multicast_v4(&DISCOVERY_ADDRESS, &Ipv4Addr::UNSPECIFIED)?;
    made.set_nonblocking(true)?;
    Ok(made)
}
