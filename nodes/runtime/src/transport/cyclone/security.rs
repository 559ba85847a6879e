//! DDS Security of a participant: properties with the files of Cyclone's plugins.

use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;

use crate::config::security::Secrets;

/// Statically linked plugins, by the names under which Cyclone looks them up.
const PLUGINS: [(&str, &str); 9] = [
    ("dds.sec.auth.library.path", "dds_security_auth"),
    ("dds.sec.auth.library.init", "init_authentication"),
    ("dds.sec.auth.library.finalize", "finalize_authentication"),
    ("dds.sec.access.library.path", "dds_security_ac"),
    ("dds.sec.access.library.init", "init_access_control"),
    ("dds.sec.access.library.finalize", "finalize_access_control"),
    ("dds.sec.crypto.library.path", "dds_security_crypto"),
    ("dds.sec.crypto.library.init", "init_crypto"),
    ("dds.sec.crypto.library.finalize", "finalize_crypto"),
];

/// Property names of [`Secrets::files`], in the same order.
const FILES: [&str; 6] = [
    "dds.sec.auth.identity_ca",
    "dds.sec.auth.identity_certificate",
    "dds.sec.auth.private_key",
    "dds.sec.access.permissions_ca",
    "dds.sec.access.governance",
    "dds.sec.access.permissions",
];
const REVOKED: &str = "org.eclipse.cyclonedds.sec.auth.crl";

/// Security properties of a participant.
pub(super) fn properties(secrets: &Secrets) -> Result<Vec<(CString, CString)>, String> {
    let property = |name: &str, value: &[u8]| match (CString::new(name), CString::new(value)) {
        (Ok(name), Ok(value)) => Ok((name, value)),
        _ => Err(format!("{name} has a zero byte")),
    };
    let plugins = PLUGINS.map(|(name, value)| property(name, value.as_bytes()));
    let revoked = secrets.revoked.iter().map(|path| (REVOKED, path));
    let files = FILES.into_iter().zip(&secrets.files).chain(revoked);
    let files =
        files.map(|(name, path)| property(name, &[b"file:", path.as_os_str().as_bytes()].concat()));
    plugins.into_iter().chain(files).collect()
}
