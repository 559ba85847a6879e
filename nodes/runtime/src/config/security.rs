//! DDS Security in ROS 2: environment variables, and the enclave files of a keystore in the layout
//! of SROS2.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::names::{NameError, validate_namespace};

/// True if this build supports DDS Security.
pub const BUILT_IN: bool = cfg!(feature = "security");

const ENABLE: &str = "ROS_SECURITY_ENABLE";
const STRATEGY: &str = "ROS_SECURITY_STRATEGY";
const KEYSTORE: &str = "ROS_SECURITY_KEYSTORE";
const ENCLAVE: &str = "ROS_SECURITY_ENCLAVE_OVERRIDE";

/// Files of an enclave, in the order of [`Secrets::files`].
const FILES: [&str; 6] = [
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
];
/// Certificate revocation list; optional.
const REVOKED: &str = "crl.pem";

/// DDS Security settings of a participant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Security {
    /// `ROS_SECURITY_KEYSTORE`.
    pub keystore: Option<PathBuf>,
    /// `ROS_SECURITY_ENCLAVE_OVERRIDE`: overrides the enclave of the arguments.
    pub enclave: Option<String>,
    /// True if `ROS_SECURITY_STRATEGY` is `Enforce`: without valid files no participant is created.
    pub enforced: bool,
}

/// Enclave of a process.
pub(crate) struct Enclave {
    /// Announced name.
    pub name: String,
    /// Files of the enclave; `None` without security.
    pub secrets: Option<Secrets>,
}

/// Readable files of an enclave.
#[derive(Debug, PartialEq)]
pub(crate) struct Secrets {
    /// Identity CA, certificate, key, permissions CA, governance, permissions.
    pub files: [PathBuf; 6],
    /// Certificate revocation list.
    pub revoked: Option<PathBuf>,
}

/// Reason why a participant cannot be secured.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SecurityError {
    /// No keystore is set.
    #[error("{ENABLE} is true, but {KEYSTORE} names no keystore")]
    NoKeystore,
    /// Invalid enclave name.
    #[error("{ENCLAVE}: {0}")]
    Enclave(#[from] NameError),
    /// A file of the enclave is missing or unreadable.
    #[error("{ENABLE} is true, but the security file {path} cannot be read: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        error: io::Error,
    },
    /// Built without the feature.
    #[error("{ENABLE} is true, but this program was built without the feature `security`")]
    NotBuiltIn,
    /// Keys or permissions are invalid.
    #[error("DDS Security rejects the participant of {enclave}: {reason}")]
    Refused {
        /// Folder of the enclave.
        enclave: PathBuf,
        /// Error of the transport.
        reason: String,
    },
}

impl Security {
    /// Reads an environment; `None` if security is disabled. Empty variables count as unset.
    pub(crate) fn from_lookup(lookup: impl Fn(&str) -> Option<String>) -> Option<Self> {
        let get = |name| lookup(name).filter(|value| !value.is_empty());
        (get(ENABLE)? == "true").then(|| Self {
            keystore: get(KEYSTORE).map(PathBuf::from),
            enclave: get(ENCLAVE),
            enforced: get(STRATEGY).is_some_and(|strategy| strategy == "Enforce"),
        })
    }

    /// Files of an enclave. Missing ones are an error, or a warning if security is not enforced.
    pub(crate) fn secrets(&self, enclave: &str) -> Result<Option<Secrets>, SecurityError> {
        let found = match BUILT_IN {
            true => self.find(enclave),
            false => Err(SecurityError::NotBuiltIn),
        };
        match found {
            Ok(secrets) => Ok(Some(secrets)),
            Err(error) if self.enforced => Err(error),
            Err(error) => {
                log::warn!("continuing WITHOUT security, since {STRATEGY} is not Enforce: {error}");
                Ok(None)
            }
        }
    }

    fn find(&self, enclave: &str) -> Result<Secrets, SecurityError> {
        let keystore = self.keystore.as_deref().ok_or(SecurityError::NoKeystore)?;
        let enclave = self.enclave.as_deref().unwrap_or(enclave);
        // Words and slashes only: the path stays inside the keystore.
        validate_namespace(enclave)?;
        Secrets::find(
            &keystore
                .join("enclaves")
                .join(enclave.trim_start_matches('/')),
        )
    }
}

impl Secrets {
    fn find(folder: &Path) -> Result<Self, SecurityError> {
        let folder = std::path::absolute(folder).map_err(|error| SecurityError::File {
            path: folder.to_owned(),
            error,
        })?;
        let files = FILES.map(|name| folder.join(name));
        for path in &files {
            readable(path)?;
        }
        let revoked = match readable(&folder.join(REVOKED)) {
            Ok(()) => Some(folder.join(REVOKED)),
            Err(SecurityError::File { error, .. }) if error.kind() == io::ErrorKind::NotFound => {
                None
            }
            Err(error) => return Err(error),
        };
        Ok(Self { files, revoked })
    }

    /// Folder of the files.
    pub(crate) fn folder(&self) -> &Path {
        self.files[0].parent().unwrap_or(Path::new(""))
    }
}

/// Checks that the path is a readable regular file.
fn readable(path: &Path) -> Result<(), SecurityError> {
    // Checked before opening: opening a pipe blocks.
    let opened = fs::metadata(path).and_then(|found| match found.is_file() {
        true => File::open(path).map(drop),
        false => Err(io::Error::other("not a regular file")),
    });
    opened.map_err(|error| SecurityError::File {
        path: path.to_owned(),
        error,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)]) -> Option<Security> {
        Security::from_lookup(|name| {
            let found = variables.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn only_true_switches_on_and_only_enforce_enforces() {
        for value in ["", "True", "TRUE", "1", "true ", "false"] {
            assert_eq!(read(&[(ENABLE, value), (STRATEGY, "Enforce")]), None);
        }
        assert_eq!(read(&[(STRATEGY, "Enforce"), (KEYSTORE, "/k")]), None);
        for (value, enforced) in [("Enforce", true), ("enforce", false), ("Permissive", false)] {
            let security = read(&[(ENABLE, "true"), (STRATEGY, value), (KEYSTORE, "")]).unwrap();
            assert_eq!((security.enforced, security.keystore), (enforced, None));
        }
    }

    fn wish(keystore: Option<&Path>, enclave: Option<&str>, enforced: bool) -> Security {
        Security {
            keystore: keystore.map(Path::to_owned),
            enclave: enclave.map(str::to_owned),
            enforced,
        }
    }

    #[test]
    fn who_cannot_secure_refuses_or_says_so() {
        let words = match BUILT_IN {
            true => "names no keystore",
            false => "built without the feature `security`",
        };
        let error = wish(None, None, true).secrets("/").unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
        let open = wish(None, None, false).secrets("/");
        assert_eq!(open.unwrap(), None);
    }

    #[test]
    fn every_file_must_be_there_and_no_name_leads_out_of_the_keystore() {
        let keystore = tempfile::tempdir().unwrap();
        let find = |enclave: &str, instead: Option<&str>| {
            wish(Some(keystore.path()), instead, true).find(enclave)
        };
        let folder = keystore.path().join("enclaves/robot/mapper");
        fs::create_dir_all(&folder).unwrap();
        for name in FILES {
            let error = find("/robot/mapper", None).unwrap_err().to_string();
            let path = folder.join(name).display().to_string();
            assert!(error.contains(&format!("{path} cannot be read")), "{error}");
            fs::write(folder.join(name), "").unwrap();
        }
        let secrets = find("/robot/mapper", None).unwrap();
        assert_eq!(
            (secrets.folder(), &secrets.revoked),
            (folder.as_path(), &None)
        );
        assert_eq!(
            find("/", Some("/robot/mapper")).unwrap(),
            secrets,
            "the override wins"
        );
        for name in ["..", "/..", "/../robot", "robot/mapper", "/robot/", "/a\0b"] {
            let error = find("/robot/mapper", Some(name)).unwrap_err().to_string();
            assert!(error.starts_with(ENCLAVE), "{error}");
        }
        // A list of what was revoked that cannot be read is none to pass over.
        fs::create_dir(folder.join(REVOKED)).unwrap();
        let error = find("/robot/mapper", None).unwrap_err().to_string();
        assert!(error.contains("crl.pem"), "{error}");
        let file = folder.join("cert.pem");
        for keystore in [
            file.as_path(),
            Path::new("missing"),
            Path::new("/a\0b"),
            Path::new(""),
        ] {
            let error = wish(Some(keystore), None, true).find("/").unwrap_err();
            assert!(
                matches!(&error, SecurityError::File { path, .. } if path.ends_with(FILES[0])),
                "{error}"
            );
        }
    }
}
