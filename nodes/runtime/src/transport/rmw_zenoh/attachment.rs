//! Attachments (33 bytes): sequence number, time and gid of the sender.

use std::time::{SystemTime, UNIX_EPOCH};

use zenoh::bytes::ZBytes;

use crate::transport::port::{EndpointId, SampleId};

/// Length: eight bytes each for number and time, the length of the gid, the gid.
const BYTES: usize = 33;

/// Length of a gid, as serialized by zenoh-ext.
const GID_LENGTH: u8 = 16;

/// Attachment of a sample sent now.
pub(super) fn attachment(sample: SampleId) -> ZBytes {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let now_ns = now.map_or(0, |now| i64::try_from(now.as_nanos()).unwrap_or(i64::MAX));
    write(sample, now_ns).to_vec().into()
}

fn write(sample: SampleId, time_ns: i64) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    let (number, rest) = bytes.split_at_mut(8);
    let (time, rest) = rest.split_at_mut(8);
    let (length, gid) = rest.split_at_mut(1);
    number.copy_from_slice(&sample.number.to_le_bytes());
    time.copy_from_slice(&time_ns.to_le_bytes());
    length.copy_from_slice(&[GID_LENGTH]);
    gid.copy_from_slice(&sample.writer.0);
    bytes
}

/// Sender and sequence number of a sample. The error describes a missing or invalid attachment.
pub(super) fn read(attachment: Option<&ZBytes>) -> Result<SampleId, String> {
    let attachment = attachment.ok_or("has no attachment of rmw_zenoh")?;
    // The length is checked before the fragments are merged.
    match attachment.len() == BYTES {
        true => parse(&attachment.to_bytes()),
        false => None,
    }
    .ok_or_else(|| {
        let bytes = attachment.len();
        format!("has an attachment of {bytes} bytes that is not one of rmw_zenoh")
    })
}

fn parse(bytes: &[u8]) -> Option<SampleId> {
    let (number, rest) = bytes.split_first_chunk()?;
    let (_time, rest) = rest.split_first_chunk::<8>()?;
    let gid = rest.strip_prefix(&[GID_LENGTH])?;
    Some(SampleId {
        writer: EndpointId(gid.try_into().ok()?),
        number: i64::from_le_bytes(*number),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: SampleId = SampleId {
        writer: EndpointId([0xab; 16]),
        number: 7,
    };

    #[test]
    fn the_layout_is_that_of_the_design_page() {
        let bytes = write(SAMPLE, 0x0102_0304_0506_0708);
        let expected = [
            &[7, 0, 0, 0, 0, 0, 0, 0][..],
            &[8, 7, 6, 5, 4, 3, 2, 1],
            &[16],
            &[0xab; 16],
        ];
        assert_eq!(bytes[..], expected.concat());
        assert_eq!(parse(&bytes), Some(SAMPLE));
        assert_eq!(read(Some(&attachment(SAMPLE))), Ok(SAMPLE));
    }

    #[test]
    fn attachments_of_others_are_refused() {
        let whole = write(SAMPLE, 1);
        for length in 0..whole.len() {
            assert_eq!(parse(&whole[..length]), None, "{length}");
        }
        let mut other = whole;
        other[16] = 15;
        let long = [&whole[..], &[0]].concat();
        for bytes in [&other[..], &long, &[0; 1 << 20]] {
            let refused = read(Some(&ZBytes::from(bytes)));
            assert!(refused.unwrap_err().contains("is not one of rmw_zenoh"));
        }
        assert!(read(None).is_err());
    }
}
