//! Self-made certificate, kept with its key so that a browser's exception stays valid after a restart.

use std::collections::HashSet;
use std::ffi::OsString;
use std::fs::{self, DirBuilder};
use std::io::Write;
use std::net::IpAddr;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rcgen::{
    CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, KeyPair, KeyUsagePurpose,
    date_time_ymd,
};

use super::identity::{Identity, TlsError, read};
use crate::files::atomic_write::AtomicFile;

/// File with key and certificate.
const FILE: &str = "viewer_tls.pem";
const DAY: Duration = Duration::from_secs(86_400);
/// Begin of the line with the names of the certificate.
const NAMES: &str = "names: ";
/// Limit of names, this machine's first.
const MAX_NAMES: usize = 64;
/// Validity period: browsers of Apple accept no longer one.
const VALID: Duration = Duration::from_secs(820 * DAY.as_secs());
/// Remaining validity at which a start makes a new certificate, so that a server may run this long.
const RENEWED: Duration = Duration::from_secs(180 * DAY.as_secs());

/// Folder for the state of this user or service.
pub fn state_folder() -> Result<PathBuf, TlsError> {
    let missing = || TlsError::NotKept("no folder for it, HOME is not set".to_owned());
    folder_of(|name| std::env::var_os(name)).ok_or_else(missing)
}

/// `STATE_DIRECTORY` of a systemd service, else `XDG_STATE_HOME/lattice`, else `~/.local/state/lattice`.
pub(super) fn folder_of(lookup: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    // A relative path is to be ignored, by the specification of these folders.
    let set = |name: &str| {
        let first = std::env::split_paths(&lookup(name)?).next()?;
        first.is_absolute().then_some(first)
    };
    let state = || set("XDG_STATE_HOME").or_else(|| Some(set("HOME")?.join(".local/state")));
    set("STATE_DIRECTORY").or_else(|| Some(state()?.join("lattice")))
}

/// Certificate kept in a folder. A new one is made if there is none, if it does not name the first address, or if it ends soon. It also
/// has the names of the one before: a robot that moves between two networks needs no third.
pub fn keep(folder: &Path, addresses: &[IpAddr], now: SystemTime) -> Result<Identity, TlsError> {
    let path = folder.join(FILE);
    let mut names = own_names(addresses);
    if path.exists() {
        let lost = match Identity::read(&path, &path) {
            Ok(kept) => {
                let is_named = addresses.first().is_none_or(|first| kept.names(*first));
                let lost = match (is_named, kept.lasts(now, RENEWED)) {
                    (true, true) => return Ok(kept),
                    (true, false) => {
                        "is not valid by the clock of this machine, or ends within 180 days"
                    }
                    (false, _) => "does not name the address of this machine",
                };
                names.extend(kept_names(&path)?);
                lost.to_owned()
            }
            Err(error) => format!("cannot be used: {error}"),
        };
        let path = path.display();
        log::warn!("the certificate {path} {lost}; browsers will ask about a new one");
    }
    let mut known = HashSet::new();
    names.retain(|name| known.insert(name.clone()));
    names.truncate(MAX_NAMES);
    let not_kept =
        |error: &dyn std::fmt::Display| TlsError::NotKept(format!("{}: {error}", path.display()));
    let pem = make(names, now).map_err(|error| not_kept(&error))?;
    let mut builder = DirBuilder::new();
    let written = builder
        .recursive(true)
        .mode(0o700)
        .create(folder)
        .and_then(|()| AtomicFile::create_private(&path))
        .and_then(|mut file| {
            file.write_all(pem.as_bytes())?;
            file.finish()
        });
    written.map_err(|error| not_kept(&error))?;
    Identity::read(&path, &path)
}

/// Names of this machine, as host and by its addresses.
fn own_names(addresses: &[IpAddr]) -> Vec<String> {
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let host = Some(host.trim())
        .filter(|host| is_name(host))
        .unwrap_or("robot");
    let mut names = vec![host.to_owned()];
    if !host.contains('.') {
        names.push(format!("{host}.local"));
    }
    names.extend(["localhost", "127.0.0.1", "::1"].map(str::to_owned));
    names.extend(addresses.iter().map(IpAddr::to_string));
    names
}

/// True for the characters and the length of host names and addresses.
fn is_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-.:".contains(c);
    (1..200).contains(&name.len()) && name.chars().all(plain)
}

/// Names of a kept certificate, by the line before its PEM sections.
fn kept_names(path: &Path) -> Result<Vec<String>, TlsError> {
    let (bytes, _) = read(path, "tls_certificate")?;
    let text = String::from_utf8_lossy(&bytes);
    let line = text
        .lines()
        .next()
        .and_then(|line| line.strip_prefix(NAMES));
    let names = line.unwrap_or_default().split(' ');
    Ok(names
        .filter(|name| is_name(name))
        .map(str::to_owned)
        .collect())
}

/// Line with the names, key and certificate in PEM.
fn make(names: Vec<String>, now: SystemTime) -> Result<String, rcgen::Error> {
    let line = format!("{NAMES}{}\n", names.join(" "));
    let host = names.first().map_or("", String::as_str);
    let common = format!("Lattice viewer on {}", host.get(..40).unwrap_or(host));
    let mut params = CertificateParams::new(names)?;
    params.distinguished_name.push(DnType::CommonName, common);
    params.is_ca = IsCa::ExplicitNoCa;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    let begin = now.duration_since(UNIX_EPOCH).unwrap_or_default();
    params.not_before = date_time_ymd(1970, 1, 1) + begin.saturating_sub(DAY);
    params.not_after = params.not_before + VALID;
    let key = KeyPair::generate()?;
    let certificate = params.self_signed(&key)?;
    Ok(line + &key.serialize_pem() + &certificate.pem())
}
