//! Messages of ROS 1 serialization as CDR of ROS 2, by their definition.

use super::definition::{Count, Definition, Field, Kind, MessageType, Place, number_bytes};
use crate::MAX_MESSAGE_BYTES;

/// Encapsulation header: CDR, little-endian.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];
/// Limit of the output: this, and so many times the input, bytes. Alignment at most triples it.
const MAX_EXTRA_BYTES: usize = 1 << 16;
const MAX_RATIO: usize = 4;
const NS_PER_S: i32 = 1_000_000_000;

/// Converter of the messages of one type.
///
/// It drops the header's `seq`; times and durations become those of builtin_interfaces.
#[derive(Clone, Debug)]
pub(crate) struct Transcoder {
    definition: Definition,
}

impl Transcoder {
    /// Converter for a ROS 1 type with its definition; the error is a reason.
    pub(crate) fn new(type_name: &str, definition: &str) -> Result<Transcoder, String> {
        let definition = Definition::parse(type_name, definition)?;
        Ok(Transcoder { definition })
    }

    /// Definition of the converted messages (ros2msg).
    pub(crate) fn definition(&self) -> String {
        self.definition.to_ros2()
    }

    /// CDR of a message with encapsulation header; the error is a reason.
    pub(crate) fn to_cdr(&self, message: &[u8]) -> Result<Vec<u8>, String> {
        let room = message.len().saturating_mul(MAX_RATIO);
        let room = room.saturating_add(MAX_EXTRA_BYTES);
        let limit = room.min(usize::try_from(MAX_MESSAGE_BYTES).unwrap_or(usize::MAX));
        let mut out = Vec::with_capacity(message.len().saturating_add(64));
        out.extend(ENCAPSULATION);
        let mut walk = Walk {
            types: &self.definition.types,
            rest: message,
            out,
            limit,
        };
        let read = |walk: &Walk<'_>| message.len() - walk.rest.len();
        match walk.message(0) {
            Some(()) if walk.rest.is_empty() => Ok(walk.out),
            Some(()) => Err(format!(
                "a message of {} bytes, of which its definition describes {}",
                message.len(),
                read(&walk)
            )),
            None if walk.out.len() > limit => Err(format!(
                "a message of {} bytes that grows beyond {limit} as CDR",
                message.len()
            )),
            None => Err(format!(
                "a message of {} bytes whose definition asks for more at byte {}",
                message.len(),
                read(&walk)
            )),
        }
    }
}

struct Walk<'a> {
    types: &'a [MessageType],
    /// Unread part of the message.
    rest: &'a [u8],
    out: Vec<u8>,
    limit: usize,
}

impl<'a> Walk<'a> {
    fn take(&mut self, bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(bytes)?;
        self.rest = rest;
        Some(taken)
    }

    fn take_u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    /// Pads the output to a multiple of `bytes` behind the encapsulation header.
    fn align(&mut self, bytes: usize) {
        let body = self.out.len().saturating_sub(ENCAPSULATION.len());
        let padded = body.next_multiple_of(bytes);
        self.out.resize(padded + ENCAPSULATION.len(), 0);
    }

    fn put(&mut self, aligned: usize, bytes: &[u8]) -> Option<()> {
        self.align(aligned);
        self.out.extend_from_slice(bytes);
        (self.out.len() <= self.limit).then_some(())
    }

    fn message(&mut self, at: usize) -> Option<()> {
        let message = self.types.get(at)?;
        let mut is_empty = true;
        for field in &message.fields {
            match field.place {
                Place::Both => self.field(field)?,
                Place::Added => self.zero(field)?,
                Place::Dropped => {
                    let length = self.out.len();
                    self.field(field)?;
                    self.out.truncate(length);
                    continue;
                }
            }
            is_empty = false;
        }
        match is_empty {
            // Structures of IDL have at least one member.
            true => self.put(1, &[0]),
            false => Some(()),
        }
    }

    fn field(&mut self, field: &Field) -> Option<()> {
        match field.count {
            Count::One => self.elements(field.kind, 1),
            Count::Fixed(count) => self.elements(field.kind, count),
            Count::Any => {
                let count = self.take_u32()?;
                self.put(4, &count.to_le_bytes())?;
                self.elements(field.kind, count)
            }
        }
    }

    /// Writes a field of ROS 2 alone: zeros and empty texts and arrays.
    fn zero(&mut self, field: &Field) -> Option<()> {
        match (field.count, field.kind) {
            (Count::Any, _) => self.put(4, &[0; 4]),
            (_, Kind::Number(number)) => {
                let bytes = number_bytes(number);
                self.put(bytes, [0; 8].get(..bytes)?)
            }
            (_, Kind::Text) => {
                self.put(4, &1_u32.to_le_bytes())?;
                self.put(1, &[0])
            }
            (_, Kind::Time | Kind::Duration) => self.put(4, &[0; 8]),
            (_, Kind::Message(at)) => {
                let message = self.types.get(at)?;
                let fields = message.fields.iter();
                let mut fields = fields.filter(|field| field.place != Place::Dropped);
                fields.try_for_each(|field| self.zero(field))
            }
        }
    }

    fn elements(&mut self, kind: Kind, count: u32) -> Option<()> {
        match kind {
            Kind::Number(number) => {
                let bytes = number_bytes(number);
                let count = usize::try_from(count).ok()?;
                let values = self.take(bytes.checked_mul(count)?)?;
                match values.is_empty() {
                    true => Some(()),
                    false => self.put(bytes, values),
                }
            }
            _ => (0..count).try_for_each(|_| self.element(kind)),
        }
    }

    fn element(&mut self, kind: Kind) -> Option<()> {
        match kind {
            Kind::Number(_) => self.elements(kind, 1),
            Kind::Text => {
                let length = self.take_u32()?;
                let text = self.take(usize::try_from(length).ok()?)?;
                self.put(4, &length.checked_add(1)?.to_le_bytes())?;
                self.put(1, text)?;
                self.put(1, &[0])
            }
            Kind::Time => {
                let time = self.take(8)?;
                self.put(4, time)
            }
            Kind::Duration => {
                let (sec, nsec) = (self.take_u32()? as i32, self.take_u32()? as i32);
                // Nanoseconds of ROS 2 have no sign.
                let sec = sec.saturating_add(nsec.div_euclid(NS_PER_S));
                self.put(4, &sec.to_le_bytes())?;
                self.put(4, &nsec.rem_euclid(NS_PER_S).to_le_bytes())
            }
            Kind::Message(at) => self.message(at),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn transcoded(definition: &str, message: &[u8]) -> Result<Vec<u8>, String> {
        let transcoder = Transcoder::new("a/B", definition).unwrap();
        transcoder.to_cdr(message)
    }

    #[test]
    fn headers_lose_seq_and_fields_are_aligned() {
        let text = "Header header\nuint8 a\nfloat64 b\nstring[] names\nduration d\nuint16[2] c\nEmpty e\nMSG: a/Empty\n";
        let mut message = Vec::new();
        message.extend(7_u32.to_le_bytes());
        message.extend([1_u32, 2, 3].map(u32::to_le_bytes).concat());
        message.extend(b"map\x05");
        message.extend(1.5_f64.to_le_bytes());
        message.extend([1_u32, 1].map(u32::to_le_bytes).concat());
        message.extend(b"x");
        message.extend([2_i32, -5].map(i32::to_le_bytes).concat());
        message.extend([1, 0, 2, 0]);
        let mut expected = vec![0, 1, 0, 0];
        expected.extend([1_u32, 2, 4].map(u32::to_le_bytes).concat());
        expected.extend(b"map\0\x05\0\0\0\0\0\0\0");
        expected.extend(1.5_f64.to_le_bytes());
        expected.extend([1_u32, 2].map(u32::to_le_bytes).concat());
        expected.extend(b"x\0\0\0");
        expected.extend([1_i32, 999_999_995].map(i32::to_le_bytes).concat());
        expected.extend([1, 0, 2, 0, 0]);
        assert_eq!(transcoded(text, &message).unwrap(), expected);
        for end in 0..message.len() {
            assert!(transcoded(text, &message[..end]).is_err());
        }
        message.push(0);
        let error = transcoded(text, &message).unwrap_err();
        assert!(error.contains("describes"), "{error}");
    }

    #[test]
    fn fields_of_ros2_are_zero() {
        let transcoder = Transcoder::new(
            "novatel_oem7_msgs/Oem7Header",
            "uint16 message_id\nuint8 idle_time\n",
        );
        let cdr = transcoder.unwrap().to_cdr(&[1, 2, 3]).unwrap();
        assert_eq!(cdr, [0, 1, 0, 0, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn elements_without_bytes_are_bounded() {
        let text = "E[] many\nMSG: a/E\n";
        let count = |count: u32| transcoded(text, &count.to_le_bytes());
        assert_eq!(count(3).unwrap().len(), 4 + 4 + 3);
        assert!(count(u32::MAX).unwrap_err().contains("grows beyond"));
        let fixed = "E[4000000000] many\nMSG: a/E\nF[4000000000] f\nMSG: a/F\n";
        assert!(transcoded(fixed, &[]).unwrap_err().contains("grows beyond"));
        let numbers = "float64[] x\n";
        let error = transcoded(numbers, &u32::MAX.to_le_bytes()).unwrap_err();
        assert!(error.contains("asks for more"), "{error}");
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_message_or_an_error(
            message in prop::collection::vec(any::<u8>(), 0..200),
            lines in prop::collection::vec(
                prop::sample::select(vec![
                    "uint8 a", "float64[] b", "string c", "string[] d", "time e", "duration[2] f", "E[] g",
                    "Header h", "D[] i", "int16[3] j",
                ]),
                0..8,
            ),
        ) {
            let text = format!("{}\nMSG: a/E\nMSG: a/D\nuint8 x\nuint64 y\n", lines.join("\n"));
            if let Ok(cdr) = transcoded(&text, &message) {
                prop_assert!(cdr.len() <= message.len() * MAX_RATIO + MAX_EXTRA_BYTES);
            }
        }
    }
}
