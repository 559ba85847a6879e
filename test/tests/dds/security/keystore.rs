//! Keystores in the layout of SROS2, made with the command `openssl`.

use std::fs;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use lattice_runtime::security::Security;
use tempfile::TempDir;

const GOVERNANCE: &str = include_str!("../../../../docs/security/governance.xml");
const NEW_KEY: &str = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes";
const DAYS: &str = "-days 30";

/// Topics of every node.
pub const OF_A_NODE: [&str; 6] = [
    "ros_discovery_info",
    "rt/rosout",
    "rt/diagnostics",
    "rt/parameter_events",
    "rq/*Request",
    "rr/*Reply",
];

/// Begin and end of permissions that hold, and of some that did.
pub const NOW: [&str; 2] = ["2020-01-01T00:00:00", "2120-01-01T00:00:00"];
pub const PAST: [&str; 2] = ["2020-01-01T00:00:00", "2021-01-01T00:00:00"];

/// A keystore with its authorities; dropped, it is gone.
pub struct Keystore(TempDir);

/// True if there is an `openssl` on the PATH; else a line says so.
pub fn openssl_is_there() -> bool {
    let found = Command::new("openssl").arg("version").output().is_ok();
    if !found {
        let _ = writeln!(std::io::stderr(), "SKIPPED: no openssl on the PATH");
    }
    found
}

impl Keystore {
    pub fn make() -> Self {
        let this = Self(tempfile::tempdir().unwrap());
        for folder in ["private", "public", "enclaves"] {
            fs::create_dir(this.path(folder)).unwrap();
        }
        for name in ["identity", "permissions"] {
            let files = format!("-keyout private/{name}.key.pem -out public/{name}_ca.cert.pem");
            this.openssl(&format!(
                "req -x509 {NEW_KEY} {files} {DAYS} -subj /CN={name}"
            ));
        }
        this.sign(GOVERNANCE, "enclaves/governance.p7s");
        this
    }

    /// Adds an enclave `/name` that may publish and subscribe to topics, in the words of DDS.
    pub fn add(&self, name: &str, topics: &[&str], [from, to]: [&str; 2]) {
        let criteria = |kind: &str| {
            let topics: String = topics
                .iter()
                .map(|t| format!("<topic>{t}</topic>"))
                .collect();
            format!("<{kind}><topics>{topics}</topics></{kind}>")
        };
        let rules = ["publish", "subscribe"].map(criteria).concat();
        let permissions = format!(
            "<dds><permissions><grant name=\"/{name}\"><subject_name>CN=/{name}</subject_name>\
             <validity><not_before>{from}</not_before><not_after>{to}</not_after></validity>\
             <allow_rule><domains><id_range><min>0</min><max>230</max></id_range></domains>{rules}</allow_rule>\
             <default>DENY</default></grant></permissions></dds>"
        );
        self.add_with(name, &permissions);
    }

    /// Adds an enclave `/name` with these permissions.
    pub fn add_with(&self, name: &str, permissions: &str) {
        let folder = format!("enclaves/{name}");
        fs::create_dir_all(self.path(&folder)).unwrap();
        self.certify(name, self);
        for name in ["identity_ca.cert.pem", "permissions_ca.cert.pem"] {
            let link = self.path(&folder).join(name);
            symlink(Path::new("../../public").join(name), link).unwrap();
        }
        symlink(
            "../governance.p7s",
            self.path(&folder).join("governance.p7s"),
        )
        .unwrap();
        self.sign(permissions, &format!("{folder}/permissions.p7s"));
    }

    /// Gives an enclave a new key and a certificate of an authority, which may be another's.
    pub fn certify(&self, name: &str, authority: &Keystore) {
        let folder = format!("enclaves/{name}");
        self.openssl(&format!(
            "req {NEW_KEY} -keyout {folder}/key.pem -out private/request.pem -subj /CN=\\/{name}"
        ));
        let (ca, key) = (
            authority.path("public/identity_ca.cert.pem"),
            authority.path("private/identity.key.pem"),
        );
        self.openssl(&format!(
            "x509 -req -in private/request.pem -CA {} -CAkey {} -CAcreateserial {DAYS} \
             -out {folder}/cert.pem",
            ca.display(),
            key.display()
        ));
    }

    /// Gives an enclave a list by which its own certificate is revoked.
    pub fn revoke(&self, name: &str) {
        let config = "[ca]\ndefault_ca = d\n[d]\ndatabase = private/index.txt\n\
                      crlnumber = private/number\ndefault_md = sha256\ndefault_crl_days = 30\n";
        for (file, text) in [("ca.cnf", config), ("index.txt", ""), ("number", "01\n")] {
            fs::write(self.path("private").join(file), text).unwrap();
        }
        let ca = "ca -config private/ca.cnf -keyfile private/identity.key.pem \
                  -cert public/identity_ca.cert.pem";
        let folder = format!("enclaves/{name}");
        self.openssl(&format!("{ca} -revoke {folder}/cert.pem"));
        self.openssl(&format!("{ca} -gencrl -out {folder}/crl.pem"));
    }

    fn sign(&self, text: &str, to: &str) {
        fs::write(self.path("private/text.xml"), text).unwrap();
        self.openssl(&format!(
            "smime -sign -text -in private/text.xml -out {to} -signer public/permissions_ca.cert.pem \
             -inkey private/permissions.key.pem"
        ));
    }

    pub fn path(&self, inside: &str) -> PathBuf {
        self.0.path().join(inside)
    }

    /// The wish for security with this keystore and no less.
    pub fn enforced(&self) -> Security {
        Security {
            keystore: Some(self.0.path().to_owned()),
            enclave: None,
            enforced: true,
        }
    }

    fn openssl(&self, line: &str) {
        let output = Command::new("openssl")
            .args(line.split_whitespace())
            .current_dir(self.0.path())
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "openssl {line}: {errors}");
    }
}
