//! Files that are written atomically, and digests that name them.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::part::VERSION;
use crate::{AnyError, Result};

/// Size and digest of a file.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct FileId {
    /// Size.
    pub bytes: u64,
    /// SHA-256, in hexadecimal digits.
    pub sha256: String,
}

impl FileId {
    /// Reads a file for its size and digest.
    pub fn of(path: &Path) -> io::Result<FileId> {
        let mut file = File::open(path)?;
        let (mut digest, mut bytes) = (Sha256::new(), 0);
        let mut buffer = vec![0; 1 << 18];
        loop {
            let read = file.read(&mut buffer)?;
            let Some(read) = buffer.get(..read).filter(|read| !read.is_empty()) else {
                break;
            };
            digest.update(read);
            bytes += read.len() as u64;
        }
        let sha256 = hex(&digest.finalize());
        Ok(FileId { bytes, sha256 })
    }

    /// Fails, with its path, unless a file has this size and digest.
    pub fn verify(&self, path: &Path) -> Result {
        let found = FileId::of(path).map_err(|error| at(path, error))?;
        if found == *self {
            return Ok(());
        }
        Err(at(
            path,
            format!(
                "damaged: {} bytes with SHA-256 {:.16}...; its manifest has {} bytes and {:.16}...",
                found.bytes, found.sha256, self.bytes, self.sha256
            ),
        ))
    }
}

/// An error with the path of its file.
pub fn at(path: &Path, error: impl std::fmt::Display) -> AnyError {
    format!("{}: {error}", path.display()).into()
}

/// SHA-256 of some texts with their lengths, in hexadecimal digits.
pub fn digest_of<'a>(texts: impl IntoIterator<Item = &'a str>) -> String {
    let mut digest = Sha256::new();
    for text in texts {
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text);
    }
    hex(&digest.finalize())
}

/// SHA-256 of a text, in hexadecimal digits.
pub fn sha256_of(text: &str) -> String {
    hex(&Sha256::digest(text.as_bytes()))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes a temporary file in the same folder, syncs it and renames it.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut File) -> Result) -> Result {
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut file = tempfile::Builder::new()
        .prefix(".new-")
        .tempfile_in(folder)
        .map_err(|error| at(path, error))?;
    fill(file.as_file_mut()).map_err(|error| at(path, error))?;
    file.as_file().sync_all().map_err(|error| at(path, error))?;
    let file = file.persist(path).map_err(|error| at(path, error.error))?;
    open_to_all(&file).map_err(|error| at(path, error))
}

/// Sets the permissions of a new file, which differ from those of a temporary one.
fn open_to_all(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

/// The text of a manifest whose member `digest` is the SHA-256 of the same text with an empty one.
pub fn sealed(text: &str) -> String {
    let empty = "\"digest\": \"\"";
    let digest = sha256_of(text);
    text.replacen(empty, &format!("\"digest\": \"{digest}\""), 1)
}

/// The text of a manifest with an empty `digest`.
pub fn unsealed(text: &str, digest: &str) -> String {
    let filled = format!("\"digest\": \"{digest}\"");
    text.replacen(&filled, "\"digest\": \"\"", 1)
}

/// Writes a manifest, whose `digest` is empty, as JSON and seals it.
pub fn write_manifest(path: &Path, value: &impl Serialize) -> Result {
    let text = serde_json::to_string_pretty(value)?;
    write_whole(path, |file| Ok(file.write_all(sealed(&text).as_bytes())?))
}

/// Reads a manifest. Fails, with its path, for another version of the tables and for a text that differs from its
/// digest. `digest_of` returns its member `digest`.
pub fn read_manifest<T: serde::de::DeserializeOwned>(
    path: &Path,
    digest_of: impl Fn(&T) -> &str,
) -> Result<T> {
    #[derive(Deserialize)]
    struct Versioned {
        version: u32,
    }
    let text = read_text(path)?;
    let Versioned { version } = serde_json::from_slice(&text).map_err(|error| at(path, error))?;
    if version != VERSION {
        let reason = format!(
            "version {version} of the tables, not {VERSION}: make them again from logs or maps"
        );
        return Err(at(path, reason));
    }
    let value: T = serde_json::from_slice(&text).map_err(|error| at(path, error))?;
    let text = String::from_utf8(text).map_err(|error| at(path, error))?;
    let digest = digest_of(&value);
    if digest.len() == 64 && sealed(&unsealed(&text, digest)) == text {
        return Ok(value);
    }
    Err(at(
        path,
        format!("damaged: its text differs from its digest {digest:.16}..."),
    ))
}

/// Writes a value as JSON.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result {
    let text = serde_json::to_vec_pretty(value)?;
    write_whole(path, |file| Ok(file.write_all(&text)?))
}

/// Reads a value from JSON of up to 64 MB.
pub fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_slice(&read_text(path)?).map_err(|error| at(path, error))
}

fn read_text(path: &Path) -> Result<Vec<u8>> {
    const LONGEST: u64 = 64 << 20;
    let file = File::open(path).map_err(|error| at(path, error))?;
    let mut text = Vec::new();
    file.take(LONGEST)
        .read_to_end(&mut text)
        .map_err(|error| at(path, error))?;
    Ok(text)
}
