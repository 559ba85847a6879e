//! Addresses of the participants of a domain, heard in what they announce of themselves.
//!
//! RustDDS does not show them. Every participant that looks for others by multicast says where its user
//! traffic goes (SPDP, RTPS 2.5, 8.5.3 and 9.6.2.2).

use std::collections::VecDeque;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::sync::{Arc, Mutex};

use smol::Async;
use socket2::{Domain, Socket, Type};

use super::goodbye::{GROUP, LOCAL_PARTICIPANTS, multicast_port};
use super::wire::{ENTITY_SPDP_WRITER, Prefix, parameters, sender, submessages};
use crate::sync::lock;

/// Participants kept; the one heard longest ago goes first.
const MAX_PARTICIPANTS: usize = 256;

/// Addresses kept of each.
const MAX_ADDRESSES: usize = 8;

const MAX_DATAGRAM_BYTES: usize = 65_507;

const SUBMESSAGE_DATA: u8 = 0x15;
const FLAG_INLINE_QOS: u8 = 2;
const FLAG_DATA: u8 = 4;
const PID_DEFAULT_UNICAST_LOCATOR: u16 = 0x31;
/// UDP over IPv4.
const LOCATOR_KIND: i32 = 1;
const PL_CDR: u8 = 2;

/// Addresses that participants have announced.
pub(super) struct Addresses {
    domain: u16,
    localhost_only: bool,
    heard: Mutex<VecDeque<(Prefix, Vec<SocketAddrV4>)>>,
}

impl Addresses {
    pub(super) fn new(domain: u16, localhost_only: bool) -> Self {
        Self {
            domain,
            localhost_only,
            heard: Mutex::default(),
        }
    }

    /// Addresses for the user traffic of a participant. One that was not heard may be on this machine.
    pub(super) fn of(&self, participant: Prefix) -> Vec<SocketAddrV4> {
        let heard = lock(&self.heard);
        let found = heard.iter().find(|(prefix, _)| *prefix == participant);
        match found.filter(|_| !self.localhost_only) {
            Some((_, addresses)) => addresses.clone(),
            None => (0..LOCAL_PARTICIPANTS)
                .filter_map(|place| user_port(self.domain, place))
                .map(|port| SocketAddrV4::new(Ipv4Addr::LOCALHOST, port))
                .collect(),
        }
    }

    /// Hears announcements until the task is dropped.
    pub(super) async fn listen(self: Arc<Self>) {
        let socket = match self.socket().and_then(Async::new) {
            Ok(socket) => socket,
            Err(error) => return log::debug!("announcements are not heard: {error}"),
        };
        let mut datagram = vec![0; MAX_DATAGRAM_BYTES];
        while let Ok((length, _)) = socket.recv_from(&mut datagram).await {
            if let Some(told) = datagram.get(..length).and_then(announced) {
                self.keep(told);
            }
        }
    }

    fn socket(&self) -> std::io::Result<UdpSocket> {
        let port = multicast_port(self.domain).ok_or(std::io::ErrorKind::AddrNotAvailable)?;
        let socket = Socket::new(Domain::IPV4, Type::DGRAM, None)?;
        // As every participant of the machine does.
        socket.set_reuse_address(true)?;
        socket.bind(&SocketAddrV4::new(GROUP, port).into())?;
        let socket = UdpSocket::from(socket);
        // Joined on the first interface; RustDDS has joined on all, and a machine hears for all sockets.
        if let Err(error) = socket.join_multicast_v4(&GROUP, &Ipv4Addr::UNSPECIFIED) {
            log::debug!("multicast: {error}");
        }
        Ok(socket)
    }

    fn keep(&self, (participant, addresses): (Prefix, Vec<SocketAddrV4>)) {
        let mut heard = lock(&self.heard);
        heard.retain(|(prefix, _)| *prefix != participant);
        if heard.len() >= MAX_PARTICIPANTS {
            heard.pop_front();
        }
        heard.push_back((participant, addresses));
    }
}

/// Port for the user traffic of a participant of a machine, by its place there (RTPS 2.5, 9.6.2.3).
fn user_port(domain: u16, place: u16) -> Option<u16> {
    multicast_port(domain)?.checked_add(place.checked_mul(2)?.checked_add(11)?)
}

/// A participant and its addresses, if the datagram announces them.
fn announced(datagram: &[u8]) -> Option<(Prefix, Vec<SocketAddrV4>)> {
    let prefix = sender(datagram)?;
    let (flags, body) = submessages(datagram)
        .find(|(kind, _, body)| {
            *kind == SUBMESSAGE_DATA && body.get(8..12) == Some(&ENTITY_SPDP_WRITER)
        })
        .map(|(_, flags, body)| (flags, body))?;
    if flags & FLAG_DATA == 0 {
        return None;
    }
    let is_little = flags & 1 == 1;
    // What follows the numbers of the writer: from behind this length.
    let to_qos = body
        .get(2..4)?
        .try_into()
        .ok()
        .map(|bytes| match is_little {
            true => u16::from_le_bytes(bytes),
            false => u16::from_be_bytes(bytes),
        })?;
    let mut data = body.get(4_usize.checked_add(to_qos.into())?..)?;
    if flags & FLAG_INLINE_QOS != 0 {
        let mut list = parameters(data, is_little);
        list.by_ref().for_each(drop);
        data = list.rest();
    }
    let (header, list) = data.split_at_checked(4)?;
    let is_little = match header {
        [0, kind, ..] if kind & !1 == PL_CDR => kind & 1 == 1,
        _ => return None,
    };
    let addresses: Vec<SocketAddrV4> = parameters(list, is_little)
        .filter(|(id, _)| *id == PID_DEFAULT_UNICAST_LOCATOR)
        .filter_map(|(_, value)| address(value, is_little))
        .take(MAX_ADDRESSES)
        .collect();
    (!addresses.is_empty()).then_some((prefix, addresses))
}

/// The address of a locator that is one of IPv4 and goes to one machine.
fn address(locator: &[u8], is_little: bool) -> Option<SocketAddrV4> {
    let number = |from: usize| {
        let bytes = locator.get(from..from.checked_add(4)?)?.try_into().ok()?;
        Some(match is_little {
            true => i32::from_le_bytes(bytes),
            false => i32::from_be_bytes(bytes),
        })
    };
    let octets: [u8; 4] = locator.get(20..24)?.try_into().ok()?;
    let port = u16::try_from(number(4)?).ok().filter(|port| *port > 0)?;
    let ip = Ipv4Addr::from(octets);
    let is_one = !ip.is_multicast() && !ip.is_broadcast() && !ip.is_unspecified();
    (number(0)? == LOCATOR_KIND && is_one).then_some(SocketAddrV4::new(ip, port))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::dds::wire::{Message, put_parameter};

    fn announcement(locators: &[[u8; 24]]) -> Vec<u8> {
        let mut data = vec![0, 0, 16, 0, 0, 0, 0, 0];
        data.extend(ENTITY_SPDP_WRITER);
        data.extend([0, 0, 0, 0, 1, 0, 0, 0]);
        put_parameter(&mut data, 0x71, &[0, 0, 0, 0]);
        put_parameter(&mut data, 1, &[]);
        data.extend([0, 3, 0, 0]);
        for locator in locators {
            put_parameter(&mut data, PID_DEFAULT_UNICAST_LOCATOR, locator);
        }
        put_parameter(&mut data, 1, &[]);
        let mut message = Message::of(&[7; 12]);
        message.push(SUBMESSAGE_DATA, 1 | FLAG_INLINE_QOS | FLAG_DATA, &data);
        message.bytes
    }

    fn locator(kind: u8, port: u16, ip: [u8; 4]) -> [u8; 24] {
        let mut locator = [0; 24];
        locator[0] = kind;
        locator[4..6].copy_from_slice(&port.to_le_bytes());
        locator[20..].copy_from_slice(&ip);
        locator
    }

    #[test]
    fn addresses_of_one_machine_over_udp_are_kept() {
        let locators = [
            locator(1, 7411, [10, 0, 0, 5]),
            locator(16, 7411, [0; 4]),
            locator(1, 7401, [239, 255, 0, 1]),
            locator(1, 0, [10, 0, 0, 6]),
        ];
        let wanted = vec![SocketAddrV4::new([10, 0, 0, 5].into(), 7411)];
        let told = announced(&announcement(&locators));
        assert_eq!(told, Some(([7; 12], wanted.clone())));
        let addresses = Addresses::new(3, false);
        addresses.keep(told.unwrap());
        assert_eq!(addresses.of([7; 12]), wanted);
        // One that nobody heard is looked for on this machine.
        let here = addresses.of([8; 12]);
        assert_eq!(here[0].to_string(), "127.0.0.1:8161");
        assert_eq!(announced(&announcement(&locators[1..])), None);
    }

    proptest! {
        #[test]
        fn any_datagram_is_read_or_refused(mut cut in 0_usize..200, at in 0_usize..200, byte: u8) {
            let mut datagram = announcement(&[locator(1, 7411, [10, 0, 0, 5]); 20]);
            cut = cut.min(datagram.len());
            datagram.truncate(cut.max(at + 1));
            if let Some(changed) = datagram.get_mut(at) {
                *changed = byte;
            }
            let told = announced(&datagram);
            prop_assert!(told.is_none_or(|(_, addresses)| addresses.len() <= MAX_ADDRESSES));
        }
    }
}
