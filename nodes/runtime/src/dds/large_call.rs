//! First fragments of large requests and replies, sent beside RustDDS.
//!
//! A reply to a client over Fast DDS says in its inline QoS which request it answers, and a request to a
//! server there what to answer to. RustDDS 0.15 writes one byte too many before the inline QoS of a
//! fragment, and such a sample is never read. So it writes the sample without inline QoS, and fragments
//! that arrive before its own come from here: the first one to arrive is where Fast DDS takes the
//! identity from, and RustDDS repairs those that get lost.

use std::net::UdpSocket;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use super::addresses::Addresses;
use super::wire::{Message, Prefix, put_end, put_parameter};
use crate::port::{EndpointId, SampleId};

/// Longest body that RustDDS sends whole to every peer, bytes.
pub(super) const MAX_WHOLE_BYTES: usize = 1024;

/// Bytes of a fragment: what RustDDS makes them.
const FRAGMENT_BYTES: usize = 256;

/// Fragments of a datagram, which stays below 1500 bytes.
const FRAGMENTS: usize = 5;

/// Datagrams sent of a sample. The rest comes from RustDDS; what may go unfragmented there is shorter.
const MAX_DATAGRAMS: usize = 56;

const INFO_TS: u8 = 0x09;
const INFO_DST: u8 = 0x0e;
const DATA_FRAG: u8 = 0x16;
const LITTLE: u8 = 1;
const INLINE_QOS: u8 = 2;

/// The related sample, as OMG and as Fast DDS before 2.11 number it.
const PIDS_RELATED_SAMPLE: [u16; 2] = [0x0083, 0x800f];

/// A request or reply on its way.
pub(super) struct LargeCall<'a> {
    pub sample: SampleId,
    /// Begins with the prefix of the participant it is for.
    pub related: SampleId,
    /// Without its encapsulation header, which is that of little-endian CDR.
    pub body: &'a [u8],
}

/// Sends first fragments.
pub(super) struct LargeCalls {
    addresses: Arc<Addresses>,
    socket: Option<UdpSocket>,
}

impl LargeCalls {
    pub(super) fn new(addresses: Arc<Addresses>) -> Self {
        let socket = UdpSocket::bind("0.0.0.0:0").and_then(|socket| {
            // A datagram that finds no room is repaired.
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        if let Err(error) = &socket {
            log::warn!("large requests and replies do not reach peers over Fast DDS: {error}");
        }
        Self {
            addresses,
            socket: socket.ok(),
        }
    }

    pub(super) fn send(&self, call: &LargeCall<'_>) {
        let Some(socket) = &self.socket else { return };
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let datagrams = call.datagrams(since_1970.unwrap_or_default());
        for address in self.addresses.of(prefix(&call.related.writer)) {
            for datagram in &datagrams {
                if let Err(error) = socket.send_to(datagram, address) {
                    log::trace!("{address}: {error}");
                }
            }
        }
    }
}

impl LargeCall<'_> {
    fn datagrams(&self, since_1970: Duration) -> Vec<Vec<u8>> {
        let payload = [&[0, 1, 0, 0], self.body].concat();
        let pieces = payload
            .chunks(FRAGMENT_BYTES * FRAGMENTS)
            .take(MAX_DATAGRAMS);
        let qos = self.inline_qos();
        let whole = u32::try_from(payload.len()).unwrap_or(u32::MAX);
        let first = (1_u32..).step_by(FRAGMENTS);
        let datagram = |(first, piece): (u32, &[u8])| {
            let mut message = Message::of(&prefix(&self.sample.writer));
            message.push(INFO_DST, LITTLE, &prefix(&self.related.writer));
            message.push(INFO_TS, LITTLE, &time(since_1970));
            let body = [&self.head(first, piece.len(), whole), &*qos, piece].concat();
            message.push(DATA_FRAG, LITTLE | INLINE_QOS, &body);
            message.bytes
        };
        first.zip(pieces).map(datagram).collect()
    }

    /// Fields of a fragment submessage before its inline QoS.
    fn head(&self, first: u32, bytes: usize, whole: u32) -> Vec<u8> {
        let [.., a, b, c, d] = self.sample.writer.0;
        let fragments = u16::try_from(bytes.div_ceil(FRAGMENT_BYTES)).unwrap_or(0);
        let size = u16::try_from(FRAGMENT_BYTES).unwrap_or(0);
        // From the end of this number to the inline QoS; to any reader of the peer.
        let mut head = vec![0, 0, 28, 0, 0, 0, 0, 0, a, b, c, d];
        head.extend(sequence_number(self.sample.number));
        head.extend(first.to_le_bytes());
        head.extend(fragments.to_le_bytes());
        head.extend(size.to_le_bytes());
        head.extend(whole.to_le_bytes());
        head
    }

    fn inline_qos(&self) -> Vec<u8> {
        let number = sequence_number(self.related.number);
        let identity = [self.related.writer.0.as_slice(), &number].concat();
        let mut list = Vec::new();
        for id in PIDS_RELATED_SAMPLE {
            put_parameter(&mut list, id, &identity);
        }
        put_end(&mut list);
        list
    }
}

fn prefix(endpoint: &EndpointId) -> Prefix {
    let [prefix @ .., _, _, _, _] = endpoint.0;
    prefix
}

/// The upper half of the number comes first.
fn sequence_number(number: i64) -> [u8; 8] {
    let [a, b, c, d, e, f, g, h] = number.to_le_bytes();
    [e, f, g, h, a, b, c, d]
}

/// Seconds and their 2^-32.
fn time(since_1970: Duration) -> [u8; 8] {
    let seconds = u32::try_from(since_1970.as_secs()).unwrap_or(u32::MAX);
    let fraction = (u64::from(since_1970.subsec_nanos()) << 32) / 1_000_000_000;
    let fraction = u32::try_from(fraction).unwrap_or(u32::MAX);
    let ([a, b, c, d], [e, f, g, h]) = (seconds.to_le_bytes(), fraction.to_le_bytes());
    [a, b, c, d, e, f, g, h]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dds::wire::{parameters, sender, submessages};

    #[test]
    fn the_fragments_of_all_datagrams_are_the_sample() {
        let body: Vec<u8> = (0..3000_u32).map(|i| i as u8).collect();
        let id = |first, number| SampleId {
            writer: EndpointId([first, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9, 1, 2, 3, 4]),
            number,
        };
        let call = LargeCall {
            sample: id(5, (1 << 32) + 2),
            related: id(6, 77),
            body: &body,
        };
        let mut heard: Vec<u8> = Vec::new();
        for datagram in call.datagrams(Duration::from_millis(1500)) {
            assert!(datagram.len() < 1472);
            assert_eq!(sender(&datagram), Some(prefix(&call.sample.writer)));
            let [destination, stamp, fragment] = submessages(&datagram).collect::<Vec<_>>()[..]
            else {
                panic!("three submessages");
            };
            assert_eq!(destination.2, prefix(&call.related.writer));
            assert_eq!(stamp.2, [1, 0, 0, 0, 0, 0, 0, 0x80]);
            let (head, rest) = fragment.2.split_at(32);
            assert_eq!(head[8..20], [1, 2, 3, 4, 1, 0, 0, 0, 2, 0, 0, 0]);
            let number = |at: usize| u32::from_le_bytes(head[at..at + 4].try_into().unwrap());
            assert_eq!(number(20) as usize, 1 + heard.len() / FRAGMENT_BYTES);
            assert_eq!(number(28), 3004);
            let mut list = parameters(rest, true);
            let identities: Vec<_> = list.by_ref().collect();
            assert_eq!(identities.len(), 2);
            assert_eq!(identities[0].1[16..], [0, 0, 0, 0, 77, 0, 0, 0]);
            assert_eq!(
                list.rest().len().div_ceil(FRAGMENT_BYTES),
                head[24] as usize
            );
            heard.extend(list.rest());
        }
        assert_eq!(heard[4..], body);
    }
}
