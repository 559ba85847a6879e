//! Leave taken in the name of a participant that can no longer do so itself.
//!
//! Peers that are not told hold a participant for alive until its lease of 50 s ends: reliable writers
//! wait for it, and it stays listed. The message is the SPDP disposal of RTPS 2.5, 8.5.3 and 9.6.4.9.

use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};

use super::wire::{ENTITY_SPDP_WRITER, Message, put_end, put_parameter};
use crate::port::EndpointId;

/// Group of discovery.
pub(super) const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);

/// Participants of this machine that are told, as far as Cyclone and FastDDS look for them.
pub(super) const LOCAL_PARTICIPANTS: u16 = 33;

/// After all that a participant numbers itself.
const SEQUENCE_NUMBER: [u32; 2] = [1, 0];

const PID_PARTICIPANT_GUID: u16 = 0x50;
const PID_KEY_HASH: u16 = 0x70;
const PID_STATUS_INFO: u16 = 0x71;
const SUBMESSAGE_DATA: u8 = 0x15;
/// Little endian, inline QoS, and the payload is a key.
const FLAGS: u8 = 0x01 | 0x02 | 0x08;
/// Disposed and unregistered.
const STATUS: [u8; 4] = [0, 0, 0, 3];

/// Tells this machine and, unless confined to it, the network that a participant has gone.
pub(super) fn say(domain: u16, localhost_only: bool, participant: EndpointId) {
    let message = message(participant);
    let Ok(socket) = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)) else {
        return;
    };
    let local = (0..LOCAL_PARTICIPANTS).filter_map(|place| unicast_port(domain, place));
    let local = local.map(|port| SocketAddrV4::new(Ipv4Addr::LOCALHOST, port));
    let network = multicast_port(domain).filter(|_| !localhost_only);
    let network = network.map(|port| SocketAddrV4::new(GROUP, port));
    for address in local.chain(network) {
        if let Err(error) = socket.send_to(&message, address) {
            log::debug!("{address}: {error}");
        }
    }
}

/// Port of the announcements that all participants of a domain hear.
pub(super) fn multicast_port(domain: u16) -> Option<u16> {
    domain.checked_mul(250)?.checked_add(7400)
}

/// Port of the announcements to one participant of a machine, by its place there.
fn unicast_port(domain: u16, place: u16) -> Option<u16> {
    multicast_port(domain)?.checked_add(place.checked_mul(2)?.checked_add(10)?)
}

fn message(participant: EndpointId) -> Vec<u8> {
    let guid = &participant.0;
    let [prefix @ .., _, _, _, _] = *guid;
    let mut data = vec![0, 0];
    // From the end of this number to the inline QoS.
    data.extend(16_u16.to_le_bytes());
    data.extend([0; 4]);
    data.extend(ENTITY_SPDP_WRITER);
    data.extend(SEQUENCE_NUMBER.into_iter().flat_map(u32::to_le_bytes));
    put_parameter(&mut data, PID_STATUS_INFO, &STATUS);
    put_parameter(&mut data, PID_KEY_HASH, guid);
    put_end(&mut data);
    // A parameter list in little endian.
    data.extend([0, 3, 0, 0]);
    put_parameter(&mut data, PID_PARTICIPANT_GUID, guid);
    put_end(&mut data);
    let mut message = Message::of(&prefix);
    message.push(SUBMESSAGE_DATA, FLAGS, &data);
    message.bytes
}
