//! How requests and replies lie on DDS: each rmw has its own way, told apart by who sent the request.
//!
//! rmw_fastrtps sends the bare message and names the request in the inline QoS (the "Enhanced" mapping
//! of DDS-RPC 1.0); rmw_cyclonedds puts a header of 16 bytes in front of it.

use lattice_msgs::RosMessage;
use lattice_msgs::cdr::{self, CdrError};

use crate::port::{Bytes, ENCAPSULATION_BYTES, Origin, SampleId};

/// First two bytes of the GUIDs of a vendor.
const CYCLONE_VENDOR: [u8; 2] = [0x01, 0x10];
const RUSTDDS_VENDOR: [u8; 2] = [0x01, 0x12];

/// Eight bytes of the client's GUID and eight of the request's number.
const CYCLONE_HEADER_BYTES: usize = 16;

/// Which request a reply belongs to, in the manner of the client.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ReplyTo {
    Enhanced(SampleId),
    Cyclone([u8; CYCLONE_HEADER_BYTES]),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mapping {
    Enhanced,
    Cyclone,
}

/// Reads a request, its encapsulation header first. The error is that of the likelier mapping.
pub(crate) fn read_request<Q: RosMessage>(
    bytes: &[u8],
    origin: &Origin,
) -> Result<(Q, ReplyTo), CdrError> {
    let (first, second) = match likely_mapping(origin) {
        Mapping::Enhanced => (Mapping::Enhanced, Mapping::Cyclone),
        Mapping::Cyclone => (Mapping::Cyclone, Mapping::Enhanced),
    };
    read_as(bytes, origin, first).or_else(|error| read_as(bytes, origin, second).map_err(|_| error))
}

/// The body of a reply, and what the inline QoS has to say.
pub(crate) fn write_reply<R: RosMessage>(
    reply: &R,
    to: &ReplyTo,
) -> Result<(Bytes, Option<SampleId>), CdrError> {
    let message = cdr::to_vec(reply)?;
    let body = message.get(ENCAPSULATION_BYTES..).unwrap_or_default();
    Ok(match to {
        ReplyTo::Enhanced(request) => (Bytes::copy_from_slice(body), Some(*request)),
        // The header is 16 bytes, so the alignment of what follows stays.
        ReplyTo::Cyclone(header) => ([header.as_slice(), body].concat().into(), None),
    })
}

fn likely_mapping(origin: &Origin) -> Mapping {
    match origin.sample.writer.vendor() {
        CYCLONE_VENDOR => Mapping::Cyclone,
        // ros2-client speaks both; only with the header does it name the request in a client.
        RUSTDDS_VENDOR if origin.related.is_some() => Mapping::Cyclone,
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
            let mut header = *header;
            if encapsulation.get(1) == Some(&0) {
                // Big endian; our reply is not.
                for word in header.chunks_exact_mut(8) {
                    word.reverse();
                }
            }
            Ok((request, ReplyTo::Cyclone(header)))
        }
    }
}

/// The request as the client knows it: its reply reader if it names that, else its writer.
fn identity(origin: &Origin) -> SampleId {
    match origin.related {
        // FastDDS names the reader but leaves the number to the sample.
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
    use crate::port::EndpointId;

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
            read_request::<SetBoolRequest>(&bytes, &origin([0x01, 0x0f], Some(related))).unwrap();
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
            read_request::<SetBoolRequest>(&little, &origin(CYCLONE_VENDOR, None)).unwrap();
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
        let (_, to) = read_request::<SetBoolRequest>(&big, &origin(CYCLONE_VENDOR, None)).unwrap();
        let swapped = [7, 6, 5, 4, 3, 2, 1, 0, 15, 14, 13, 12, 11, 10, 9, 8];
        assert_eq!(to, ReplyTo::Cyclone(swapped));
    }

    #[test]
    fn the_other_mapping_is_tried_and_rubbish_is_an_error() {
        let header = [3; 16];
        let cyclone = [&[0, 1, 0, 0][..], &header, &[1]].concat();
        let unknown_vendor = origin([0x77, 0x77], None);
        let (_, to) = read_request::<SetBoolRequest>(&cyclone, &unknown_vendor).unwrap();
        assert_eq!(to, ReplyTo::Cyclone(header));
        for bytes in [
            &[][..],
            &[0, 1, 0, 0],
            &[0, 1, 0, 0, 5, 5, 5, 5, 5, 5, 5, 5, 5],
        ] {
            assert!(read_request::<SetBoolRequest>(bytes, &unknown_vendor).is_err());
        }
    }
}
