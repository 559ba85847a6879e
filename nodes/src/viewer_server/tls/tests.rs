//! Certificates of an owner and self-made ones.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::time::Duration;

use rcgen::{CertificateParams, KeyPair, date_time_ymd};
use rustix::fs::{CWD, FileType, mknodat};

use super::*;

const ADDRESS: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 7));

fn kept(folder: &Path, address: IpAddr, days: u64) -> Identity {
    let now = SystemTime::now() + Duration::from_secs(days * 86_400);
    self_made::keep(folder, &[address], now).unwrap()
}

fn mode(path: &Path) -> u32 {
    fs::metadata(path).unwrap().permissions().mode() & 0o777
}

fn set_mode(path: &Path, mode: u32) {
    fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
}

#[test]
fn a_self_made_certificate_is_the_same_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("state/lattice");
    let first = kept(&place, ADDRESS, 0);
    let file = place.join("viewer_tls.pem");
    assert_eq!((mode(&place), mode(&file)), (0o700, 0o600));
    assert_eq!(first.fingerprint.split(':').count(), 32);
    for name in [ADDRESS, [127, 0, 0, 1].into()] {
        assert!(first.names(name), "{name}");
    }
    assert!(!first.names([10, 0, 0, 8].into()));
    let pem = fs::read(&file).unwrap();
    for days in [0, 300, 630] {
        assert_eq!(kept(&place, ADDRESS, days).fingerprint, first.fingerprint);
    }
    assert_eq!(fs::read(&file).unwrap(), pem);
    // An address that it lacks, its end, and a clock before its begin.
    let moved = kept(&place, [10, 0, 0, 8].into(), 0);
    // Back at the address before it needs no other one.
    assert_eq!(kept(&place, ADDRESS, 0).fingerprint, moved.fingerprint);
    let renewed = kept(&place, [10, 0, 0, 8].into(), 650);
    assert!(renewed.names(ADDRESS));
    let early = kept(&place, [10, 0, 0, 8].into(), 0);
    let all = [&first, &moved, &renewed, &early].map(|identity| &identity.fingerprint);
    for (at, one) in all.iter().enumerate() {
        assert!(!all[..at].contains(one), "{all:?}");
    }
    assert_eq!(mode(&file), 0o600);
}

#[test]
fn a_certificate_is_kept_where_services_and_users_have_their_state() {
    let all = [
        ("STATE_DIRECTORY", "/var/lib/lattice:/var/lib/more"),
        ("XDG_STATE_HOME", "/state"),
        ("HOME", "/home/me"),
    ];
    let folder = |known: &[(&str, &str)]| {
        let value = |name: &str| known.iter().find(|(known, _)| *known == name);
        self_made::folder_of(|name| value(name).map(|(_, value)| value.into()))
    };
    let is = |path: &str| Some(PathBuf::from(path));
    assert_eq!(folder(&all), is("/var/lib/lattice"));
    assert_eq!(folder(&all[1..]), is("/state/lattice"));
    assert_eq!(folder(&all[2..]), is("/home/me/.local/state/lattice"));
    let relative = [("XDG_STATE_HOME", "state"), all[2]];
    assert_eq!(folder(&relative), is("/home/me/.local/state/lattice"));
    assert_eq!(folder(&[]), None);
}

#[test]
fn a_kept_certificate_that_is_damaged_or_was_open_to_others_is_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("viewer_tls.pem");
    let first = kept(folder.path(), ADDRESS, 0);
    set_mode(&file, 0o644);
    let second = kept(folder.path(), ADDRESS, 0);
    assert_ne!(second.fingerprint, first.fingerprint);
    assert_eq!(mode(&file), 0o600);
    let pem = fs::read(&file).unwrap();
    for length in [0, 40, pem.len() / 2] {
        fs::write(&file, &pem[..length]).unwrap();
        assert_ne!(
            kept(folder.path(), ADDRESS, 0).fingerprint,
            second.fingerprint
        );
    }
    assert_eq!(mode(&file), 0o600);
    // A folder that is none.
    let error = self_made::keep(&file, &[ADDRESS], SystemTime::now()).unwrap_err();
    let error = error.to_string();
    for part in ["viewer_tls.pem", "XDG_STATE_HOME", "tls_certificate"] {
        assert!(error.contains(part), "{error}");
    }
}

/// Files of an owner: a certificate of these years, and a key.
fn files(folder: &Path, years: [i32; 2]) -> (PathBuf, PathBuf) {
    let key = KeyPair::generate().unwrap();
    let mut params = CertificateParams::new(["robot.example".to_owned()]).unwrap();
    params.not_before = date_time_ymd(years[0], 1, 1);
    params.not_after = date_time_ymd(years[1], 1, 1);
    let certificate = params.self_signed(&key).unwrap();
    let path = |name: &str| folder.join(format!("{}.{name}.pem", years[1]));
    fs::write(path("certificate"), certificate.pem()).unwrap();
    fs::write(path("key"), key.serialize_pem()).unwrap();
    set_mode(&path("key"), 0o640);
    (path("certificate"), path("key"))
}

fn refusal(certificate: &Path, key: &Path) -> String {
    let tls = Tls::Files {
        certificate: certificate.to_owned(),
        key: key.to_owned(),
    };
    let unused = || unreachable!("nothing is kept");
    tls.identity(unused, &[]).unwrap_err().to_string()
}

fn says(text: &str, parts: &[&str]) {
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}

#[test]
fn files_of_an_owner_are_refused_with_cause_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let (certificate, key) = files(folder.path(), [2020, 4000]);
    let good = of_owner(&certificate, &key, SystemTime::now()).unwrap();
    assert_eq!(good.fingerprint.len(), 95);
    let missing = folder.path().join("missing.pem");
    says(
        &refusal(&missing, &key),
        &["missing.pem", "tls_certificate", "No such file"],
    );
    says(&refusal(&certificate, &missing), &["tls_key", "PEM"]);
    says(&refusal(folder.path(), &key), &["not a regular file"]);
    says(&refusal(&key, &key), &["no CERTIFICATE", "tls_certificate"]);
    says(&refusal(&certificate, &certificate), &["tls_key"]);
    let locked = folder.path().join("locked.pem");
    let pem = fs::read_to_string(&key).unwrap();
    fs::write(&locked, pem.replace("PRIVATE", "ENCRYPTED PRIVATE")).unwrap();
    set_mode(&locked, 0o600);
    let parts = ["no PRIVATE KEY without a password", "tls_key"];
    says(&refusal(&certificate, &locked), &parts);
    let pipe = folder.path().join("pipe");
    mknodat(CWD, &pipe, FileType::Fifo, 0o600.into(), 0).unwrap();
    says(&refusal(&certificate, &pipe), &["not a regular file"]);
    let (expired, its_key) = files(folder.path(), [2020, 2021]);
    says(
        &refusal(&expired, &its_key),
        &["expired", "days ago", "renew"],
    );
    let (later, its_key) = files(folder.path(), [3000, 3001]);
    says(
        &refusal(&later, &its_key),
        &["not valid for another", "clock"],
    );
    says(
        &refusal(&certificate, &its_key),
        &["is not that of the certificate", "pair"],
    );
    set_mode(&key, 0o644);
    says(
        &refusal(&certificate, &key),
        &["readable by others", "644", "chmod o-rwx", "tls_key"],
    );
    set_mode(&key, 0o600);
    let damaged = fs::read_to_string(&certificate).unwrap();
    fs::write(&certificate, damaged.replace("MII", "AAA")).unwrap();
    says(&refusal(&certificate, &key), &["cannot be used", "X.509"]);
    fs::write(&certificate, vec![b'-'; 2 << 20]).unwrap();
    says(
        &refusal(&certificate, &key),
        &["2097152 bytes, at most 1048576"],
    );
}
