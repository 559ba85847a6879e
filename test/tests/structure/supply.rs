//! Crates of others: their licences and sources are those that `deny.toml` allows, where there is no
//! `cargo deny`.

use std::fs;
use std::process::Command;

use serde_json::Value;

use super::crates::cargo;
use super::root;

/// Texts of a list in `deny.toml`.
fn list(key: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join("deny.toml")).unwrap();
    let (_, rest) = text.split_once(&format!("\n{key} = [")).unwrap();
    let (list, _) = rest.split_once(']').unwrap();
    list.split('"')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}

/// True if an SPDX expression can be met by licences that are allowed: one of each alternative.
fn is_met(expression: &str, allowed: &[String]) -> bool {
    let plain = expression.replace(['(', ')'], "").replace('/', " OR ");
    let is_allowed = |licence: &str| allowed.iter().any(|name| name == licence.trim());
    let mut parts = plain.split(" AND ");
    parts.all(|part| part.split(" OR ").any(is_allowed))
}

#[test]
fn crates_of_others_have_licences_and_sources_that_are_allowed() {
    let (licences, sources, banned) = (list("allow"), list("allow-registry"), list("deny"));
    let metadata = cargo(&["metadata", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    let mut others = 0;
    for package in metadata["packages"].as_array().unwrap() {
        let name = package["name"].as_str().unwrap();
        assert!(
            !banned.iter().any(|banned| banned == name),
            "{name} is banned"
        );
        let licence = package["license"].as_str().unwrap_or_default();
        assert!(is_met(licence, &licences), "{name}: {licence:?}");
        // Ours have none.
        if let Some(source) = package["source"].as_str() {
            let registry = source.strip_prefix("registry+").unwrap_or(source);
            assert!(
                sources.iter().any(|allowed| allowed == registry),
                "{name}: {source}"
            );
            others += 1;
        }
    }
    assert!(others > 100, "{others} crates of others");
}

#[test]
fn advisories_are_set_aside_only_for_crates_that_are_there() {
    let text = fs::read_to_string(root().join("deny.toml")).unwrap();
    let (_, ignored) = text.split_once("\nignore = [").unwrap();
    let lock = fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let page = fs::read_to_string(root().join("docs/security.md")).unwrap();
    let mut count = 0;
    for line in ignored.lines().filter(|line| line.contains("id = ")) {
        let quoted: Vec<_> = line.split('"').skip(1).step_by(2).collect();
        let [id, reason] = quoted[..] else {
            panic!("{line} has no reason");
        };
        let name = reason.split([' ', ',']).next().unwrap();
        let is_there = lock.contains(&format!("\nname = \"{name}\"\n"));
        assert!(is_there, "{id}: {name} is no longer used");
        assert!(page.contains(id), "docs/security.md does not name {id}");
        count += 1;
    }
    assert!(count > 0);
}

#[test]
fn licences_are_read_as_alternatives() {
    let allowed = ["MIT", "Zlib"].map(str::to_owned);
    for (expression, met) in [
        ("MIT/Apache-2.0", true),
        ("GPL-3.0 OR (MIT)", true),
        ("(MIT OR GPL-3.0) AND Zlib", true),
        ("MIT AND GPL-3.0", false),
        ("Apache-2.0 WITH LLVM-exception", false),
        ("", false),
    ] {
        assert_eq!(is_met(expression, &allowed), met, "{expression}");
    }
}

/// Runs `.ci/advisories` with a stand-in for cargo, which fails where its arguments are like `fails`.
#[cfg(unix)]
fn advisories(fails: &str, has_database: bool) -> (bool, String) {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let cargo = folder.path().join("cargo");
    fs::write(
        &cargo,
        format!("#!/bin/sh\ncase \"$*\" in {fails}) exit 1;; esac\n"),
    )
    .unwrap();
    fs::set_permissions(&cargo, fs::Permissions::from_mode(0o755)).unwrap();
    if has_database {
        fs::create_dir_all(folder.path().join("advisory-dbs/db")).unwrap();
    }
    let path = std::env::var("PATH").unwrap();
    let output = Command::new(root().join(".ci/advisories"))
        .env("PATH", format!("{}:{path}", folder.path().display()))
        .env("CARGO_HOME", folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    (output.status.success(), said)
}

#[cfg(unix)]
#[test]
fn advisories_are_checked_where_there_is_a_database_and_offline_nothing_fails() {
    for (fails, has_database, passes, words) in [
        ("*--version", false, true, "no cargo deny"),
        ("*fetch\\ db", false, true, "no database"),
        ("*fetch\\ db", true, true, "last database"),
        ("*fetch\\ db|*check*", true, false, "last database"),
        ("*check*", false, false, "of today"),
        ("nothing", false, true, "of today"),
    ] {
        let (passed, said) = advisories(fails, has_database);
        assert!(passed == passes && said.contains(words), "{fails}: {said}");
    }
}
