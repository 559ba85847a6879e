//! Validation of lengths inside a record before the `mcap` crate allocates memory for them.

use mcap::records::{Record, op};

/// Parses a record after validating its lengths; the error is a reason.
pub(super) fn parse_record(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    if fit(opcode, body).is_none() {
        let bytes = body.len();
        return Err(format!(
            "a length in the record of opcode {opcode} is beyond its {bytes} bytes"
        ));
    }
    mcap::parse_record(opcode, body).map_err(|error| error.to_string())
}

fn fit(opcode: u8, body: &[u8]) -> Option<()> {
    let mut rest = Rest(body);
    match opcode {
        op::HEADER => rest.texts(0, 2),
        op::SCHEMA => rest.texts(2, 2),
        op::CHANNEL => {
            rest.texts(4, 2)?;
            let mut map = Rest(rest.text()?);
            while !map.0.is_empty() {
                map.texts(0, 2)?;
            }
            Some(())
        }
        op::CHUNK => rest.texts(28, 1),
        op::CHUNK_INDEX => {
            rest.texts(32, 1)?;
            rest.texts(8, 1)
        }
        _ => Some(()),
    }
}

/// Unread part of a record.
struct Rest<'a>(&'a [u8]);

impl<'a> Rest<'a> {
    fn take(&mut self, bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(bytes)?;
        self.0 = rest;
        Some(taken)
    }

    /// Length-prefixed data.
    fn text(&mut self) -> Option<&'a [u8]> {
        let length = u32::from_le_bytes(self.take(4)?.try_into().ok()?);
        self.take(usize::try_from(length).ok()?)
    }

    /// `count` length-prefixed texts, after skipping `skip` bytes.
    fn texts(&mut self, skip: usize, count: usize) -> Option<()> {
        let _ = self.take(skip)?;
        for _ in 0..count {
            let _ = self.text()?;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_beyond_a_record_are_refused_before_there_is_room_for_them() {
        let text = |claimed: u32, text: &str| [&claimed.to_le_bytes(), text.as_bytes()].concat();
        let header = |claimed| [text(4, "ros2"), text(claimed, "x")].concat();
        assert!(parse_record(op::HEADER, &header(1)).is_ok());
        let schema = |claimed| [vec![1, 0], text(1, "a"), text(claimed, ""), vec![0; 4]].concat();
        assert!(parse_record(op::SCHEMA, &schema(0)).is_ok());
        let channel = |claimed| {
            let pair = [text(1, "k"), text(claimed, "v")].concat();
            let map = text(pair.len() as u32, "");
            [vec![1, 0, 1, 0], text(2, "/a"), text(3, "cdr"), map, pair].concat()
        };
        assert!(parse_record(op::CHANNEL, &channel(1)).is_ok());
        let chunk = |claimed| [vec![0; 28], text(claimed, ""), vec![0; 8]].concat();
        assert!(parse_record(op::CHUNK, &chunk(0)).is_ok());
        for claimed in [100, u32::MAX] {
            for (opcode, body) in [
                (op::HEADER, header(claimed)),
                (op::SCHEMA, schema(claimed)),
                (op::CHANNEL, channel(claimed)),
                (op::CHUNK, chunk(claimed)),
            ] {
                let error = parse_record(opcode, &body).unwrap_err();
                assert!(error.contains("beyond"), "{error}");
            }
        }
    }
}
