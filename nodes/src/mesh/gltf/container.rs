//! The two file forms: text (`.gltf`), or text and binary data in chunks (`.glb`).

/// First bytes of a binary file.
const MAGIC: &[u8] = b"glTF";
/// Limit of the JSON text, bytes.
const MAX_TEXT_BYTES: usize = 256 << 20;

/// JSON text of a file, and its binary chunk.
#[derive(Debug, PartialEq)]
pub(super) struct Container<'a> {
    pub text: &'a [u8],
    pub binary: Option<&'a [u8]>,
}

/// Splits a file into its parts.
pub(super) fn open(bytes: &[u8]) -> Result<Container<'_>, String> {
    let container = match bytes.starts_with(MAGIC) {
        true => chunks(bytes)?,
        false => Container {
            text: bytes,
            binary: None,
        },
    };
    match container.text.len() {
        found if found > MAX_TEXT_BYTES => Err(format!(
            "{found} bytes of JSON, more than {MAX_TEXT_BYTES}: write it as .glb"
        )),
        _ => Ok(container),
    }
}

/// Header (magic, version, length) and chunks (length, kind, bytes), all numbers little-endian.
fn chunks(bytes: &[u8]) -> Result<Container<'_>, String> {
    let cut = || "the file is cut short".to_owned();
    let version = number(bytes, 4).ok_or_else(cut)?;
    if version != 2 {
        return Err(format!("version {version} of the container, not 2"));
    }
    let length = number(bytes, 8).ok_or_else(cut)? as usize;
    let mut rest = bytes.get(..length).and_then(|b| b.get(12..));
    let (mut text, mut binary) = (None, None);
    while let Some(left) = rest.filter(|left| !left.is_empty()) {
        let size = number(left, 0).ok_or_else(cut)? as usize;
        let kind = left.get(4..8).ok_or_else(cut)?;
        let (chunk, after) = left
            .get(8..)
            .and_then(|left| left.split_at_checked(size))
            .ok_or_else(cut)?;
        match kind {
            b"JSON" if text.is_none() => text = Some(chunk),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            // Chunks of other types are skipped, as specified.
            _ => {}
        }
        rest = Some(after);
    }
    rest.ok_or_else(cut)?;
    let text = text.ok_or("the file has no chunk of JSON")?;
    Ok(Container { text, binary })
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..)?.first_chunk()?;
    Some(u32::from_le_bytes(*four))
}
