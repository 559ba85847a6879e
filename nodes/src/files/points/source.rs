//! Input stream with its position.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{self, BufRead, Read};

use super::error::PointFileError;

/// Read buffer, bytes.
pub(super) const BUFFER: usize = 1 << 16;
/// Longest line, bytes.
const MAX_LINE: u64 = 1 << 20;

/// Bytes of a file in order, with the position for messages.
pub struct Source {
    reader: Box<dyn BufRead>,
    byte: u64,
    line: u64,
    buffer: Vec<u8>,
}

impl Source {
    /// Source at the beginning of its file.
    pub fn new(reader: Box<dyn BufRead>) -> Source {
        Source {
            reader,
            byte: 0,
            line: 0,
            buffer: Vec::new(),
        }
    }

    /// Bytes read so far.
    pub fn byte(&self) -> u64 {
        self.byte
    }

    /// Number of the last line read, from 1.
    pub fn line_number(&self) -> u64 {
        self.line
    }

    fn io(&self, source: io::Error) -> PointFileError {
        failed(self.byte, source)
    }

    /// Some of the next bytes; empty at the end of the file only.
    pub fn peek(&mut self) -> Result<&[u8], PointFileError> {
        let byte = self.byte;
        self.reader
            .fill_buf()
            .map_err(|source| failed(byte, source))
    }

    /// Next line without its end, `None` at the end of the file.
    pub fn line(&mut self) -> Result<Option<Cow<'_, str>>, PointFileError> {
        self.buffer.clear();
        let mut limited = (&mut self.reader).take(MAX_LINE);
        let read = limited
            .read_until(b'\n', &mut self.buffer)
            .map_err(|source| self.io(source))?;
        if read == 0 {
            return Ok(None);
        }
        self.byte += read as u64;
        self.line += 1;
        if self.buffer.pop_if(|last| *last == b'\n').is_none() && read as u64 == MAX_LINE {
            let reason = format!("line {} is longer than {MAX_LINE} bytes", self.line);
            return Err(self.io(io::Error::new(io::ErrorKind::InvalidData, reason)));
        }
        self.buffer.pop_if(|last| *last == b'\r');
        Ok(Some(String::from_utf8_lossy(&self.buffer)))
    }

    /// Next line; an error at the end of the file names `part`.
    pub fn expect_line(&mut self, part: impl Display) -> Result<Cow<'_, str>, PointFileError> {
        let byte = self.byte;
        self.line()?.ok_or_else(|| truncated(byte, part))
    }

    /// Fills `bytes`; an error at the end of the file names `part`.
    pub fn exact(&mut self, bytes: &mut [u8], part: impl Display) -> Result<(), PointFileError> {
        let mut rest = bytes;
        while !rest.is_empty() {
            match self.reader.read(rest) {
                Ok(0) => return Err(truncated(self.byte, part)),
                Ok(read) => {
                    self.byte += read as u64;
                    rest = rest.get_mut(read..).unwrap_or_default();
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(self.io(error)),
            }
        }
        Ok(())
    }

    /// Next `length` bytes; an error names `part`. Memory is bounded by the available data.
    pub fn take(&mut self, length: u64, part: impl Display) -> Result<Vec<u8>, PointFileError> {
        let mut bytes = Vec::new();
        let read = (&mut self.reader).take(length).read_to_end(&mut bytes);
        self.advance(read.map(|read| read as u64), length, part)?;
        Ok(bytes)
    }

    /// Skips `length` bytes of `part`.
    pub fn skip(&mut self, length: u64, part: impl Display) -> Result<(), PointFileError> {
        let read = io::copy(&mut (&mut self.reader).take(length), &mut io::sink());
        self.advance(read, length, part)
    }

    fn advance(
        &mut self,
        read: io::Result<u64>,
        length: u64,
        part: impl Display,
    ) -> Result<(), PointFileError> {
        let read = read.map_err(|source| self.io(source))?;
        self.byte += read;
        if read < length {
            return Err(truncated(self.byte, part));
        }
        Ok(())
    }
}

/// Read error; an unexpected end occurs in decoders only.
fn failed(byte: u64, source: io::Error) -> PointFileError {
    match source.kind() {
        io::ErrorKind::UnexpectedEof => truncated(byte, "its packed data"),
        _ => PointFileError::Io { byte, source },
    }
}

fn truncated(byte: u64, part: impl Display) -> PointFileError {
    let part = part.to_string();
    PointFileError::Truncated { byte, part }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(text: &'static [u8]) -> Source {
        Source::new(Box::new(text))
    }

    #[test]
    fn lines_end_in_any_usual_way() {
        let mut source = source(b"a\r\nb\n\nc");
        let mut lines = Vec::new();
        while let Some(line) = source.line().unwrap() {
            lines.push(line.into_owned());
        }
        assert_eq!(lines, ["a", "b", "", "c"]);
        assert_eq!((source.byte(), source.line_number()), (7, 4));
    }

    #[test]
    fn a_line_without_end_is_refused() {
        let long: &'static [u8] = vec![b'7'; MAX_LINE as usize + 1].leak();
        assert!(matches!(
            source(long).line(),
            Err(PointFileError::Io { byte: MAX_LINE, .. })
        ));
        assert!(source(&long[2..]).line().is_ok());
    }

    #[test]
    fn the_end_of_the_file_is_told_with_its_place() {
        let text = "the file is cut short: it ends at byte 3, in point 2";
        let ends = [
            source(b"abc").exact(&mut [0; 4], "point 2"),
            source(b"abc").skip(u64::MAX, "point 2"),
            source(b"abc").take(4, "point 2").map(|_| ()),
        ];
        for end in ends {
            assert_eq!(end.unwrap_err().to_string(), text);
        }
    }
}
