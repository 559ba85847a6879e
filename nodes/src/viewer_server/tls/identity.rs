//! Certificate and private key of a server, from PEM files.

use std::io::{self, Read};
use std::net::IpAddr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use ring::digest::{SHA256, digest};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use rustls::{ServerConfig, crypto, version};
use webpki::{ALL_VERIFICATION_ALGS, EndEntityCert, KeyUsage};

use crate::files::regular_file;

/// Limit of a PEM file.
const MAX_PEM_BYTES: u64 = 1 << 20;
const DAY_S: u64 = 86_400;

/// Reason for refusing a certificate or key.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// File that cannot be read.
    #[error("cannot read {}: {error} (`{parameter}`): expected a PEM file that this user may read", path.display())]
    Unreadable {
        /// Parameter with the path.
        parameter: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// Error of the file system.
        error: io::Error,
    },
    /// File without the expected PEM sections.
    #[error("{} has no {expected} in PEM: {problem} (`{parameter}`)", path.display())]
    NotPem {
        /// Parameter with the path.
        parameter: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// Kind of section.
        expected: &'static str,
        /// Error of the parser.
        problem: String,
    },
    /// Private key that other users may read.
    #[error("the private key {} is readable by others (mode {mode:o}): `chmod o-rwx` it, or make a new one if others had access (`tls_key`)", path.display())]
    Open {
        /// Path of the key.
        path: PathBuf,
        /// Mode of the file.
        mode: u32,
    },
    /// Key of another certificate.
    #[error("the private key {} is not that of the certificate {}: `tls_key` and `tls_certificate` must be a pair", key.display(), certificate.display())]
    Mismatch {
        /// Path of the certificate.
        certificate: PathBuf,
        /// Path of the key.
        key: PathBuf,
    },
    /// Certificate or key that TLS 1.3 cannot use.
    #[error("{} with the key {} cannot be used for TLS 1.3: {problem} (`tls_certificate`, `tls_key`): expected X.509 version 3 with an RSA, P-256, P-384 or Ed25519 key", certificate.display(), key.display())]
    Unusable {
        /// Path of the certificate.
        certificate: PathBuf,
        /// Path of the key.
        key: PathBuf,
        /// Error of the library.
        problem: String,
    },
    /// Certificate outside its validity period.
    #[error("the certificate {} {problem} (`tls_certificate`): renew it, or set the clock of this machine", path.display())]
    Dates {
        /// Path of the certificate.
        path: PathBuf,
        /// Age, in days.
        problem: String,
    },
    /// Self-made certificate that cannot be kept.
    #[error(
        "cannot keep a self-made certificate: {0}: set XDG_STATE_HOME to a folder of this user, or give `tls_certificate` and `tls_key`"
    )]
    NotKept(String),
}

/// Certificate and key, ready for a server.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Configuration of the server.
    pub config: Arc<ServerConfig>,
    /// SHA-256 of the certificate, in hexadecimal digits as browsers and OpenSSL show it.
    pub fingerprint: String,
    certificate: CertificateDer<'static>,
}

impl Identity {
    /// Reads certificate and key; the dates are not checked.
    pub fn read(certificate: &Path, key: &Path) -> Result<Self, TlsError> {
        let (chain_pem, _) = read(certificate, "tls_certificate")?;
        let (key_pem, mode) = read(key, "tls_key")?;
        if mode & 0o007 != 0 {
            let path = key.to_owned();
            return Err(TlsError::Open { path, mode });
        }
        let not_pem = |parameter, path: &Path, expected, problem: String| TlsError::NotPem {
            parameter,
            path: path.to_owned(),
            expected,
            problem,
        };
        let chain = CertificateDer::pem_slice_iter(&chain_pem).collect::<Result<Vec<_>, _>>();
        let not_chain = |problem| not_pem("tls_certificate", certificate, "CERTIFICATE", problem);
        let chain = chain.map_err(|error| not_chain(error.to_string()))?;
        let Some(first) = chain.first().cloned() else {
            return Err(not_chain("no such section".to_owned()));
        };
        let not_key = |problem| not_pem("tls_key", key, "PRIVATE KEY without a password", problem);
        let private = PrivateKeyDer::from_pem_slice(&key_pem);
        let private = private.map_err(|error| not_key(error.to_string()))?;
        let config = config(chain, private).map_err(|error| match error {
            rustls::Error::InconsistentKeys(_) => TlsError::Mismatch {
                certificate: certificate.to_owned(),
                key: key.to_owned(),
            },
            other => TlsError::Unusable {
                certificate: certificate.to_owned(),
                key: key.to_owned(),
                problem: other.to_string(),
            },
        })?;
        Ok(Self {
            config: Arc::new(config),
            fingerprint: fingerprint(&first),
            certificate: first,
        })
    }

    /// Checks the validity period.
    ///
    /// # Errors
    /// [`TlsError::Dates`], with `path` as the path of the certificate.
    pub fn check_dates(&self, path: &Path, now: SystemTime) -> Result<(), TlsError> {
        let since = now.duration_since(UNIX_EPOCH).unwrap_or_default();
        let Some(problem) = self.dates(UnixTime::since_unix_epoch(since)) else {
            return Ok(());
        };
        let path = path.to_owned();
        Err(TlsError::Dates { path, problem })
    }

    /// Problem with the validity period. Of the checks of a chain the dates of the certificate are the first, so that without trust
    /// anchors other errors are those of a valid period.
    fn dates(&self, now: UnixTime) -> Option<String> {
        let parsed = EndEntityCert::try_from(&self.certificate).ok()?;
        let (usage, algorithms) = (KeyUsage::server_auth(), ALL_VERIFICATION_ALGS);
        let checked = parsed.verify_for_usage(algorithms, &[], &[], now, usage, None, None);
        let days = |a: UnixTime, b: UnixTime| a.as_secs().abs_diff(b.as_secs()) / DAY_S;
        match checked.err()? {
            webpki::Error::CertExpired { time, not_after } => {
                Some(format!("expired {} days ago", days(time, not_after)))
            }
            webpki::Error::CertNotValidYet { time, not_before } => Some(format!(
                "is not valid for another {} days",
                days(time, not_before)
            )),
            _ => None,
        }
    }

    /// True if the certificate names an address.
    pub fn names(&self, address: IpAddr) -> bool {
        let parsed = EndEntityCert::try_from(&self.certificate);
        let name = ServerName::IpAddress(address.into());
        parsed.is_ok_and(|parsed| parsed.verify_is_valid_for_subject_name(&name).is_ok())
    }

    /// True if it is valid for this long.
    pub fn lasts(&self, now: SystemTime, more: Duration) -> bool {
        let path = Path::new("");
        self.check_dates(path, now).is_ok() && self.check_dates(path, now + more).is_ok()
    }
}

/// Bytes and mode of a regular file of limited size.
pub(super) fn read(path: &Path, parameter: &'static str) -> Result<(Vec<u8>, u32), TlsError> {
    let unreadable = |error| TlsError::Unreadable {
        parameter,
        path: path.to_owned(),
        error,
    };
    let file = regular_file::open(path).map_err(unreadable)?;
    let found = file.metadata().map_err(unreadable)?;
    if found.len() > MAX_PEM_BYTES {
        let problem = format!("{} bytes, at most {MAX_PEM_BYTES} are read", found.len());
        return Err(unreadable(io::Error::other(problem)));
    }
    let mut bytes = Vec::new();
    file.take(MAX_PEM_BYTES)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    Ok((bytes, found.permissions().mode() & 0o7777))
}

/// Configuration for TLS 1.3 alone, which all browsers with WebXR have.
fn config(
    chain: Vec<CertificateDer<'static>>,
    key: PrivateKeyDer<'static>,
) -> Result<ServerConfig, rustls::Error> {
    let provider = Arc::new(crypto::ring::default_provider());
    let builder = ServerConfig::builder_with_provider(provider);
    let builder = builder.with_protocol_versions(&[&version::TLS13])?;
    let mut config = builder.with_no_client_auth().with_single_cert(chain, key)?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(config)
}

fn fingerprint(certificate: &CertificateDer<'_>) -> String {
    let digest = digest(&SHA256, certificate);
    let digits: Vec<_> = digest
        .as_ref()
        .iter()
        .map(|byte| format!("{byte:02X}"))
        .collect();
    digits.join(":")
}
