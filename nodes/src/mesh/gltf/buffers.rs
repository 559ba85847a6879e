//! Buffers: in the file, in data URIs, or in separate files.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::document::{Buffer, BufferView, Document};

/// Limit of bytes of all external buffers.
const MAX_BYTES: u64 = 1 << 30;

/// Buffers, each read at its first use.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    binary: Option<&'a [u8]>,
    folder: Option<&'a Path>,
    read: Vec<Option<Cow<'a, [u8]>>>,
    bytes: u64,
}

impl<'a> Buffers<'a> {
    /// Buffers of a document with its binary chunk; files are read from the folder only.
    pub fn new(
        document: &'a Document,
        binary: Option<&'a [u8]>,
        folder: Option<&'a Path>,
    ) -> Buffers<'a> {
        let read = document.buffers.0.iter().map(|_| None).collect();
        Buffers {
            document,
            binary,
            folder,
            read,
            bytes: 0,
        }
    }

    /// Bytes of a view, and its stride if given.
    pub fn view(&mut self, number: usize) -> Result<(&[u8], Option<u64>), String> {
        let views = &self.document.buffer_views.0;
        let &BufferView {
            buffer,
            byte_offset,
            byte_length,
            byte_stride,
        } = views
            .get(number)
            .ok_or_else(|| format!("there is no buffer view {number}"))?;
        let bytes = self.buffer(buffer)?;
        let end = byte_offset.checked_add(byte_length);
        let range = usize::try_from(byte_offset).ok().zip(end);
        let view = range.and_then(|(from, to)| bytes.get(from..usize::try_from(to).ok()?));
        match view {
            Some(view) => Ok((view, byte_stride)),
            None => Err(format!(
                "buffer view {number} is {byte_length} bytes from {byte_offset}, but buffer {buffer} has {}",
                bytes.len()
            )),
        }
    }

    fn buffer(&mut self, number: usize) -> Result<&[u8], String> {
        let buffers = &self.document.buffers.0;
        let (Some(buffer), Some(place)) = (buffers.get(number), self.read.get_mut(number)) else {
            return Err(format!("there is no buffer {number}"));
        };
        if place.is_none() {
            let found = content(buffer, number, self.binary, self.folder, self.bytes);
            let found = found.map_err(|reason| format!("buffer {number}: {reason}"))?;
            if let Cow::Owned(bytes) = &found {
                self.bytes = self.bytes.saturating_add(bytes.len() as u64);
            }
            *place = Some(found);
        }
        Ok(place.as_deref().unwrap_or_default())
    }
}

/// Bytes of a buffer, with exactly the stated length.
fn content<'a>(
    buffer: &Buffer,
    number: usize,
    binary: Option<&'a [u8]>,
    folder: Option<&Path>,
    before: u64,
) -> Result<Cow<'a, [u8]>, String> {
    let length = buffer.byte_length;
    if before.saturating_add(length) > MAX_BYTES {
        return Err(format!(
            "`byteLength` is {length}: all buffers together exceed {MAX_BYTES} bytes"
        ));
    }
    let mut bytes: Cow<'a, [u8]> = match buffer.uri.as_deref() {
        None if number == 0 => binary
            .ok_or("it has no `uri`, and the file has no binary chunk (GLB)")?
            .into(),
        None => return Err("it has no `uri`; only buffer 0 may be the binary chunk".to_owned()),
        Some(uri) => match uri.strip_prefix("data:") {
            Some(data) => embedded(data)?.into(),
            None => beside(uri, folder, length)?.into(),
        },
    };
    let wanted = usize::try_from(length).ok();
    let found = bytes.len();
    let Some(wanted) = wanted.filter(|wanted| *wanted <= found) else {
        return Err(format!(
            "`byteLength` is {length}, but only {found} bytes are present"
        ));
    };
    match &mut bytes {
        Cow::Borrowed(bytes) => *bytes = bytes.get(..wanted).unwrap_or_default(),
        Cow::Owned(bytes) => bytes.truncate(wanted),
    }
    Ok(bytes)
}

/// Bytes of a data URI after `data:`.
fn embedded(data: &str) -> Result<Vec<u8>, String> {
    let (media, text) = data.split_once(',').ok_or("its data URI has no comma")?;
    if !media.ends_with(";base64") {
        return Err("its data URI is not base64".to_owned());
    }
    let decoded = STANDARD.decode(text);
    decoded.map_err(|error| format!("its data URI is not base64: {error}"))
}

/// First bytes of a file in the folder or below it.
fn beside(uri: &str, folder: Option<&Path>, length: u64) -> Result<Vec<u8>, String> {
    let folder =
        folder.ok_or("separate buffer files are not supported here; use GLB or data URIs")?;
    let path = inside(uri).ok_or_else(|| {
        let uri: String = uri.chars().take(80).collect();
        format!("'{uri}' leads out of the folder of the file: put its buffers there or below")
    })?;
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    // A link may lead outside, too.
    let folder = folder.canonicalize().map_err(failed)?;
    let full = folder.join(&path).canonicalize().map_err(failed)?;
    if !full.starts_with(&folder) {
        return Err(format!(
            "{} leads out of the folder of the file: put its buffers there or below",
            path.display()
        ));
    }
    if !full.metadata().map_err(failed)?.is_file() {
        return Err(format!("{} is not a file", path.display()));
    }
    let mut bytes = Vec::new();
    let file = File::open(&full).map_err(failed)?;
    file.take(length).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// Relative path without `..`; percent codes are decoded.
fn inside(uri: &str) -> Option<PathBuf> {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        rest = tail;
        if *first != b'%' {
            bytes.push(*first);
            continue;
        }
        let (code, after) = rest.split_at_checked(2)?;
        let code = std::str::from_utf8(code).ok()?;
        // A sign would be parsed as part of the number.
        let code = Some(code).filter(|code| code.bytes().all(|b| b.is_ascii_hexdigit()))?;
        bytes.push(u8::from_str_radix(code, 16).ok()?);
        rest = after;
    }
    let text = String::from_utf8(bytes).ok()?;
    if text.is_empty() || text.contains(['\\', ':', '\0']) {
        return None;
    }
    let path = PathBuf::from(text);
    let down = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    path.components().all(down).then_some(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_go_down_alone() {
        for (uri, path) in [
            ("room.bin", Some("room.bin")),
            ("a/b%20c.bin", Some("a/b c.bin")),
            ("", None),
            ("/etc/passwd", None),
            ("../room.bin", None),
            ("a/../../b", None),
            ("%2e%2e/room.bin", None),
            ("./room.bin", Some("./room.bin")),
            ("file:///etc/passwd", None),
            ("a\\b", None),
            ("a%0", None),
            ("a%+1", None),
            ("a%00", None),
            ("%ff", None),
        ] {
            assert_eq!(inside(uri), path.map(PathBuf::from), "{uri}");
        }
    }
}
