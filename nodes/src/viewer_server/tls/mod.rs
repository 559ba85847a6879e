//! Certificate of the server: the owner's, or a self-made one.

mod identity;
mod self_made;

use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

pub use identity::{Identity, TlsError};
pub use self_made::state_folder;

/// Encryption of the connections.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Tls {
    /// HTTP and ws.
    #[default]
    Off,
    /// HTTPS and wss with a self-made certificate.
    SelfMade,
    /// HTTPS and wss with a certificate of the owner.
    Files {
        /// Certificate chain, PEM.
        certificate: PathBuf,
        /// Private key, PEM.
        key: PathBuf,
    },
}

impl Tls {
    /// Certificate and key; `None` without encryption. A self-made certificate is kept in `folder` and names `addresses`, the first of
    /// which it must name.
    pub fn identity(
        &self,
        folder: impl FnOnce() -> Result<PathBuf, TlsError>,
        addresses: &[IpAddr],
    ) -> Result<Option<Identity>, TlsError> {
        let now = SystemTime::now();
        match self {
            Tls::Off => Ok(None),
            Tls::SelfMade => self_made::keep(&folder()?, addresses, now).map(Some),
            Tls::Files { certificate, key } => of_owner(certificate, key, now).map(Some),
        }
    }
}

fn of_owner(certificate: &Path, key: &Path, now: SystemTime) -> Result<Identity, TlsError> {
    let identity = Identity::read(certificate, key)?;
    identity.check_dates(certificate, now)?;
    Ok(identity)
}

#[cfg(test)]
mod tests;
