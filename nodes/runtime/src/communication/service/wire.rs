//! Wire format of requests and replies. On DDS each rmw has its own, selected by the vendor id of the peer.
//!
//! rmw_fastrtps sends the bare message and identifies the request in the inline QoS (the "Enhanced" mapping
//! of DDS-RPC 1.0); rmw_cyclonedds prepends a header of 16 bytes. On Zenoh the message is bare.

use lattice_msgs::RosMessage;
use lattice_msgs::cdr::{self, CdrError};

use crate::transport::port::{
    Bytes, ENCAPSULATION_BYTES, EndpointId, Origin, SampleId, ServiceForm,
};

/// Vendor ids: first two bytes of GUIDs.
const CYCLONE_VENDOR: [u8; 2] = [0x01, 0x10];
const RUSTDDS_VENDOR: [u8; 2] = [0x01, 0x12];
const FASTDDS_VENDOR: [u8; 2] = [0x01, 0x0f];

/// Bit in the first byte of the GUID of a secured participant. Such a GUID is derived from its certificate and
/// has no vendor id.
const SECURED: u8 = 0x80;

/// Header length: eight bytes of the client's GUID and eight of the request's number.
const CYCLONE_HEADER_BYTES: usize = 16;

/// First bytes of the header of our requests.
const OURS: [u8; 4] = *b"latt";

/// Entity kind (last GUID byte) of a writer without keys.
const ENTITY_KIND_WRITER: u8 = 3;

/// Request identity in the format of rmw_cyclonedds, also used by our own.
pub(crate) type Header = [u8; CYCLONE_HEADER_BYTES];

/// Request identity in a reply, in the format of the client's rmw.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ReplyTo {
    Enhanced(SampleId),
    Cyclone(Header),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mapping {
    Enhanced,
    Cyclone,
}

/// Parses a request, encapsulation header first. The error is that of the more likely mapping.
pub(crate) fn read_request<Q: RosMessage>(
    form: ServiceForm,
    bytes: &[u8],
    origin: &Origin,
) -> Result<(Q, ReplyTo), CdrError> {
    if form == ServiceForm::Queries {
        return read_as(bytes, origin, Mapping::Enhanced);
    }
    let (first, second) = match likely_mapping(bytes, origin) {
        Mapping::Enhanced => (Mapping::Enhanced, Mapping::Cyclone),
        Mapping::Cyclone => (Mapping::Cyclone, Mapping::Enhanced),
    };
    let read = read_as(bytes, origin, first);
    read.or_else(|error| read_as(bytes, origin, second).map_err(|_| error))
}

/// Body of a reply, and the request identity for its inline QoS.
pub(crate) fn write_reply<R: RosMessage>(
    reply: &R,
    to: &ReplyTo,
) -> Result<(Bytes, Option<SampleId>), CdrError> {
    let message = cdr::to_vec(reply)?;
    let body = message.get(ENCAPSULATION_BYTES..).unwrap_or_default();
    Ok(match to {
        ReplyTo::Enhanced(request) => (Bytes::copy_from_slice(body), Some(*request)),
        // The header has 16 bytes, so the alignment is preserved.
        ReplyTo::Cyclone(header) => ([header.as_slice(), body].concat().into(), None),
    })
}

/// Identity of one of our requests in the format of rmw_cyclonedds: [`OURS`], part of its writer, its number.
fn header(writer: &EndpointId, number: i64) -> Header {
    let id = u128::from_le_bytes(writer.0);
    let folded = (id as u64) ^ ((id >> 64) as u64);
    let folded = (folded as u32) ^ ((folded >> 32) as u32);
    let mut header = Header::default();
    let (first, second) = header.split_at_mut(8);
    let (ours, of_writer) = first.split_at_mut(4);
    ours.copy_from_slice(&OURS);
    of_writer.copy_from_slice(&folded.to_le_bytes());
    second.copy_from_slice(&number.to_le_bytes());
    header
}

/// Identity of a request to a Fast DDS server: it belongs to the server's participant, so that the reply to a
/// large request is accepted. The server replies without a match, since no reader has this identity.
fn identity_there(server: &EndpointId, number: i64) -> Header {
    let [prefix @ .., _, _, _, _] = server.0;
    let [a, b, c, ..] = number.to_le_bytes();
    let mut identity = Header::default();
    let (first, entity) = identity.split_at_mut(12);
    first.copy_from_slice(&prefix);
    entity.copy_from_slice(&[a, b, c, ENTITY_KIND_WRITER]);
    identity
}

/// Outgoing request in the format of its server.
pub(crate) struct OutgoingRequest {
    /// Identity of the request in its reply.
    pub identity: Header,
    pub body: Bytes,
    /// Identity for its inline QoS.
    pub related: Option<SampleId>,
}

/// Encodes a request to a server. `None`: it is not little-endian CDR.
pub(crate) fn write_request(
    form: ServiceForm,
    message: &[u8],
    writer: &EndpointId,
    server: &EndpointId,
    number: i64,
) -> Option<OutgoingRequest> {
    let (encapsulation, body) = message.split_first_chunk::<ENCAPSULATION_BYTES>()?;
    if !encapsulation.starts_with(&[0, 1]) {
        return None;
    }
    if form == ServiceForm::Queries {
        // The server returns it unchanged.
        let identity = header(writer, number);
        let writer = EndpointId(identity);
        return Some(OutgoingRequest {
            identity,
            body: Bytes::copy_from_slice(body),
            related: Some(SampleId { writer, number }),
        });
    }
    if server.vendor() == FASTDDS_VENDOR {
        let identity = identity_there(server, number);
        let writer = EndpointId(identity);
        return Some(OutgoingRequest {
            identity,
            body: Bytes::copy_from_slice(body),
            related: Some(SampleId { writer, number: 0 }),
        });
    }
    let identity = header(writer, number);
    Some(OutgoingRequest {
        identity,
        body: [identity.as_slice(), body].concat().into(),
        related: None,
    })
}

/// Request identity and CDR body of a reply. `None`: it identifies no request.
pub(crate) fn read_answer(bytes: &[u8], origin: &Origin) -> Option<(Header, Vec<u8>)> {
    match origin.related {
        Some(request) => Some((request.writer.0, bytes.to_vec())),
        None => read_headed(bytes),
    }
}

/// Header and CDR body of a reply. `None`: the header is missing.
fn read_headed(bytes: &[u8]) -> Option<(Header, Vec<u8>)> {
    let (encapsulation, rest) = bytes.split_first_chunk::<ENCAPSULATION_BYTES>()?;
    let (header, body) = rest.split_first_chunk::<CYCLONE_HEADER_BYTES>()?;
    let header = in_our_order(*header, encapsulation);
    Some((header, [encapsulation.as_slice(), body].concat()))
}

/// Header converted to little-endian order.
fn in_our_order(mut header: Header, encapsulation: &[u8]) -> Header {
    if encapsulation.get(1) == Some(&0) {
        for word in header.chunks_exact_mut(8) {
            word.reverse();
        }
    }
    header
}

fn likely_mapping(bytes: &[u8], origin: &Origin) -> Mapping {
    let is_ours = (bytes.get(ENCAPSULATION_BYTES..)).is_some_and(|body| body.starts_with(&OURS));
    match origin.sample.writer.vendor() {
        CYCLONE_VENDOR => Mapping::Cyclone,
        RUSTDDS_VENDOR if is_ours => Mapping::Cyclone,
        // ros2-client uses both mappings; a related identity is only present with the header.
        RUSTDDS_VENDOR if origin.related.is_some() => Mapping::Cyclone,
        // Fast DDS clients always give a related identity.
        [SECURED..=0xff, _] if origin.related.is_none() => Mapping::Cyclone,
        _ => Mapping::Enhanced,
    }
}

fn read_as<Q: RosMessage>(
    bytes: &[u8],
    origin: &Origin,
    mapping: Mapping,
) -> Result<(Q, ReplyTo), CdrError> {
    match mapping {
        Mapping::Enhanced => Ok((cdr::from_slice(bytes)?, ReplyTo::Enhanced(identity(origin)))),
        Mapping::Cyclone => {
            let no_header = || CdrError::NoHeader {
                length: bytes.len(),
            };
            let (encapsulation, rest) = bytes
                .split_first_chunk::<ENCAPSULATION_BYTES>()
                .ok_or_else(no_header)?;
            let (header, body) = rest
                .split_first_chunk::<CYCLONE_HEADER_BYTES>()
                .ok_or_else(no_header)?;
            let request = cdr::from_slice(&[encapsulation.as_slice(), body].concat())?;
            let header = in_our_order(*header, encapsulation);
            Ok((request, ReplyTo::Cyclone(header)))
        }
    }
}

/// Request identity from the client's view: its reply reader if given, else its writer.
fn identity(origin: &Origin) -> SampleId {
    match origin.related {
        // Fast DDS gives the reader and leaves the number to the sample.
        Some(related) if related.number <= 0 => SampleId {
            writer: related.writer,
            ..origin.sample
        },
        Some(related) => related,
        None => origin.sample,
    }
}

#[cfg(test)]
mod tests {
    use lattice_msgs::std_srvs::{SetBoolRequest, TriggerResponse};

    use super::*;
    use crate::transport::port::ServiceForm::{Queries, Topics};

    fn origin(vendor: [u8; 2], related: Option<SampleId>) -> Origin {
        let mut guid = [7; 16];
        guid[..2].copy_from_slice(&vendor);
        Origin {
            sample: SampleId {
                writer: EndpointId(guid),
                number: 5,
            },
            related,
        }
    }

    #[test]
    fn fastdds_names_its_reader_and_we_answer_to_it() {
        let reader = EndpointId([9; 16]);
        let related = SampleId {
            writer: reader,
            number: 0,
        };
        let bytes = cdr::to_vec(&SetBoolRequest { data: true }).unwrap();
        let (request, to) =
            read_request::<SetBoolRequest>(Topics, &bytes, &origin([0x01, 0x0f], Some(related)))
                .unwrap();
        assert!(request.data);
        let expected = SampleId {
            writer: reader,
            number: 5,
        };
        assert_eq!(to, ReplyTo::Enhanced(expected));
        let (_, inline) = write_reply(&TriggerResponse::default(), &to).unwrap();
        assert_eq!(inline, Some(expected));
    }

    #[test]
    fn cyclone_gets_its_header_back_in_our_byte_order() {
        let header: [u8; 16] = std::array::from_fn(|i| i as u8);
        let little = [&[0, 1, 0, 0][..], &header, &[1]].concat();
        let (request, to) =
            read_request::<SetBoolRequest>(Topics, &little, &origin(CYCLONE_VENDOR, None)).unwrap();
        assert!(request.data);
        assert_eq!(to, ReplyTo::Cyclone(header));
        let reply = TriggerResponse {
            success: true,
            message: "ok".to_owned(),
        };
        let (body, inline) = write_reply(&reply, &to).unwrap();
        assert_eq!((&body[..16], inline), (&header[..], None));
        assert_eq!(body[16..], cdr::to_vec(&reply).unwrap()[4..]);

        let big = [&[0, 0, 0, 0][..], &header, &[1]].concat();
        let (_, to) =
            read_request::<SetBoolRequest>(Topics, &big, &origin(CYCLONE_VENDOR, None)).unwrap();
        let swapped = [7, 6, 5, 4, 3, 2, 1, 0, 15, 14, 13, 12, 11, 10, 9, 8];
        assert_eq!(to, ReplyTo::Cyclone(swapped));
    }

    #[test]
    fn our_servers_read_our_requests_and_our_clients_their_answers() {
        let request = cdr::to_vec(&SetBoolRequest { data: true }).unwrap();
        let origin = origin(RUSTDDS_VENDOR, None);
        let writer = origin.sample.writer;
        let asked = write_request(Topics, &request, &writer, &writer, 3).unwrap();
        let sent = [&[0, 1, 0, 0], &asked.body[..]].concat();
        let (read, to) = read_request::<SetBoolRequest>(Topics, &sent, &origin).unwrap();
        assert!(read.data && asked.related.is_none());
        let (answer, _) = write_reply(&TriggerResponse::default(), &to).unwrap();
        let answer = [&[0, 1, 0, 0], &answer[..]].concat();
        let expected = cdr::to_vec(&TriggerResponse::default()).unwrap();
        let read = read_answer(&answer, &origin);
        assert_eq!(read, Some((asked.identity, expected)));
        assert!(write_request(Topics, &[0, 0, 0, 0, 1], &writer, &writer, 3).is_none());
    }

    #[test]
    fn servers_over_fastdds_get_the_bare_request_and_what_to_answer_to() {
        let request = cdr::to_vec(&SetBoolRequest { data: true }).unwrap();
        let ours = origin(RUSTDDS_VENDOR, None).sample.writer;
        let server = origin(FASTDDS_VENDOR, None).sample.writer;
        let asked = write_request(Topics, &request, &ours, &server, 0x0403_0201).unwrap();
        assert_eq!(asked.body[..], request[4..]);
        let named = asked.related.unwrap().writer;
        assert_eq!(named.0[..12], server.0[..12]);
        assert_eq!(named.0[12..], [1, 2, 3, 3]);
        let answer = origin(FASTDDS_VENDOR, asked.related);
        let read = read_answer(&request, &answer);
        assert_eq!(read, Some((asked.identity, request)));
    }

    #[test]
    fn requests_of_secured_clients_have_a_header_unless_they_name_what_to_answer_to() {
        let secured = [0x9c, 0x0f];
        let headed = [&[0, 1, 0, 0][..], &[3; 16], &[1]].concat();
        let read = read_request::<SetBoolRequest>(Topics, &headed, &origin(secured, None));
        assert_eq!(read.unwrap().1, ReplyTo::Cyclone([3; 16]));
        let (writer, number) = (EndpointId([9; 16]), 4);
        let related = SampleId { writer, number };
        let bare = [0, 1, 0, 0, 1];
        let read = read_request::<SetBoolRequest>(Topics, &bare, &origin(secured, Some(related)));
        assert_eq!(read.unwrap().1, ReplyTo::Enhanced(related));
    }

    #[test]
    fn the_other_mapping_is_tried_and_rubbish_is_an_error() {
        let header = [3; 16];
        let cyclone = [&[0, 1, 0, 0][..], &header, &[1]].concat();
        let unknown_vendor = origin([0x77, 0x77], None);
        let (_, to) = read_request::<SetBoolRequest>(Topics, &cyclone, &unknown_vendor).unwrap();
        assert_eq!(to, ReplyTo::Cyclone(header));
        for bytes in [
            &[][..],
            &[0, 1, 0, 0],
            &[0, 1, 0, 0, 5, 5, 5, 5, 5, 5, 5, 5, 5],
        ] {
            assert!(read_request::<SetBoolRequest>(Topics, bytes, &unknown_vendor).is_err());
        }
    }

    #[test]
    fn queries_are_bare_whatever_their_first_bytes() {
        let request = cdr::to_vec(&SetBoolRequest { data: true }).unwrap();
        let origin = origin(CYCLONE_VENDOR, None);
        let writer = origin.sample.writer;
        let asked = write_request(Queries, &request, &writer, &writer, 3).unwrap();
        assert_eq!(asked.body[..], request[4..]);
        let (read, to) = read_request::<SetBoolRequest>(Queries, &request, &origin).unwrap();
        assert!(read.data);
        assert_eq!(to, ReplyTo::Enhanced(origin.sample));
        let answer = Origin {
            related: asked.related,
            ..origin
        };
        let read = read_answer(&request, &answer);
        assert_eq!(read, Some((asked.identity, request)));
    }
}
