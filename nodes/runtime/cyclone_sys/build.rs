//! Compiles the files of Cyclone DDS listed in `sources.sha256`, with the patches below, and the files in `c/`.

use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// Digests of the compiled and included files, in the format of `sha256sum`.
const SOURCES: &str = include_str!("sources.sha256");

/// Patch of one file: unique pieces of its text, and their replacements.
struct Change {
    file: &'static str,
    pieces: &'static [(&'static str, &'static str)],
}

const CHANGES: [Change; 8] = [
    // Adds the request identity to the inline QoS of a reply, where Fast DDS clients expect it.
    Change {
        file: "core/ddsi/src/ddsi_transmit.c",
        pieces: &[
            (
                "  if (ddsi_xmsg_addpar_sentinel_ifparam (*pmsg) > 0)",
                "  lattice_blob_add_inline_qos (*pmsg, serdata);\n  if (ddsi_xmsg_addpar_sentinel_ifparam (*pmsg) > 0)",
            ),
            (
                "    rc = ddsi_xmsg_addpar_sentinel_ifparam (*pmsg);",
                "    lattice_blob_add_inline_qos (*pmsg, serdata);\n    rc = ddsi_xmsg_addpar_sentinel_ifparam (*pmsg);",
            ),
            // Fast DDS reads the inline QoS from the first received fragment. If the first fragment is lost, another one must
            // have it: the client would otherwise drop a reply that it has acknowledged.
            (
                "  ddsi_xmsg_serdata (*pmsg, serdata, fragstart, fraglen, wr);\n",
                "  if (fragnum > 0)\n  {\n    lattice_blob_add_inline_qos (*pmsg, serdata);\n    if (ddsi_xmsg_addpar_sentinel_ifparam (*pmsg) > 0)\n    {\n      ddcmn = ddsi_xmsg_submsg_from_marker (*pmsg, sm_marker);\n      ddcmn->smhdr.flags |= DDSI_DATAFRAG_FLAG_INLINE_QOS;\n    }\n  }\n  ddsi_xmsg_serdata (*pmsg, serdata, fragstart, fraglen, wr);\n",
            ),
        ],
    },
    // A request received before discovery is complete is not history, for any vendor of its writer.
    Change {
        file: "core/ddsi/src/ddsi_endpoint_match.c",
        pieces: &[(
            "    else if (ddsi_vendor_is_eclipse (pwr->c.vendor))\n",
            "    else if (ddsi_vendor_is_eclipse (pwr->c.vendor) || lattice_is_of_service (pwr->c.xqos))\n",
        )],
    },
    // Fast DDS replies at once to an ACKNACK only if it requests number 0, and only once per count.
    // A lost request or reply is repeated after 0.1 s instead of 1 s.
    Change {
        file: "core/ddsi/src/ddsi_acknack.c",
        pieces: &[
            (
                "  an->readerSNState.bitmap_base = ddsi_to_seqno (1);",
                "  an->readerSNState.bitmap_base = ddsi_to_seqno (lattice_first_asked_for (pwr->c.vendor.id));",
            ),
            (
                "  *countp = 0;\n",
                "  *countp = lattice_first_asked_for (pwr->c.vendor.id) == 0 ? rwn->count++ : 0;\n",
            ),
            (
                "  if (age <= DDS_SECS (10))\n    return DDS_SECS (1);\n",
                "  if (age <= DDS_SECS (1))\n    return DDS_MSECS (100);\n  else if (age <= DDS_SECS (10))\n    return DDS_SECS (1);\n",
            ),
        ],
    },
    // Bounds the memory for forged participants.
    Change {
        file: "core/ddsi/src/ddsi_discovery_spdp.c",
        pieces: &[(
            "  const bool is_secure = ((datap->builtin_endpoint_set & ",
            "  if (!lattice_make_room (gv, timestamp.v))\n    return HSR_NOT_INTERESTING;\n\n  const bool is_secure = ((datap->builtin_endpoint_set & ",
        )],
    },
    // Counts the samples left unacknowledged by a reader that leaves.
    Change {
        file: "core/ddsi/src/ddsi_proxy_endpoint.c",
        pieces: &[(
            "        m_wr->seq = DDSI_MAX_SEQ_NUMBER;\n        ddsrt_avl_augment_update",
            "        lattice_reader_left (wr, m_wr->seq);\n        m_wr->seq = DDSI_MAX_SEQ_NUMBER;\n        ddsrt_avl_augment_update",
        )],
    },
    // The runtime takes samples on arrival and counts overwritten ones; Cyclone must not overwrite any.
    Change {
        file: "core/ddsc/src/dds_rhc_default.c",
        pieces: &[(
            "  rhc->history_depth = (qos->history.kind == DDS_HISTORY_KEEP_LAST) ?",
            "  rhc->history_depth = (qos->history.kind == DDS_HISTORY_KEEP_LAST && !lattice_is_blob_type (rhc->type)) ?",
        )],
    },
    // A player keeps unacknowledged samples up to a byte limit, regardless of the recorded depth.
    Change {
        file: "core/ddsc/src/dds_whc.c",
        pieces: &[(
            "  wrinfo->hdepth = (qos->history.kind == DDS_HISTORY_KEEP_ALL) ?",
            "  wrinfo->hdepth = (qos->history.kind == DDS_HISTORY_KEEP_ALL || lattice_keeps_unacknowledged ()) ?",
        )],
    },
    // Use after free, fixed in 11.0.1 in the same way.
    Change {
        file: "core/ddsi/src/ddsi_wraddrset.c",
        pieces: &[
            (
                "    costmap_free (wm);\n    cover_free (covered);\n",
                "    costmap_free (wm);\n",
            ),
            (
                "    ddsrt_free (chosen);\n  }\n",
                "    ddsrt_free (chosen);\n    cover_free (covered);\n  }\n",
            ),
        ],
    },
];

/// Include folders, and those for DDS Security.
const INCLUDES: [&str; 9] = [
    "core/cdr/include",
    "core/ddsi/include",
    "core/ddsi/src",
    "core/ddsc/include",
    "core/ddsc/src",
    "ddsrt/include",
    "ddsrt/src",
    "security/api/include",
    "security/core/include",
];
const SECURITY_INCLUDES: [&str; 5] = [
    "security/openssl/include",
    "security/builtin_plugins/include",
    "security/builtin_plugins/access_control/src",
    "security/builtin_plugins/authentication/src",
    "security/builtin_plugins/cryptographic/src",
];

/// Statically linked security plugins, and the functions looked up in them by name.
const PLUGINS: [(&str, &str); 4] = [
    (
        "PLUGINS",
        "dds_security_ac,dds_security_auth,dds_security_crypto",
    ),
    (
        "PLUGIN_SYMBOLS_dds_security_ac",
        "init_access_control,finalize_access_control",
    ),
    (
        "PLUGIN_SYMBOLS_dds_security_auth",
        "init_authentication,finalize_authentication",
    ),
    (
        "PLUGIN_SYMBOLS_dds_security_crypto",
        "init_crypto,finalize_crypto",
    ),
];

fn main() -> Result<(), Box<dyn Error>> {
    for file in ["build.rs", "sources.sha256", "c"] {
        println!("cargo::rerun-if-changed={file}");
    }
    let root = cyclonedds_src::source_dir().join("src");
    let os = env::var("CARGO_CFG_TARGET_OS")?;
    let security = env::var_os("CARGO_FEATURE_SECURITY").is_some();
    let mut build = cc::Build::new();
    // In every profile: unoptimised code is too slow for a sensor.
    build
        .opt_level(2)
        .debug(false)
        .define("NDEBUG", None)
        .std("gnu2x");
    build.flag("-fvisibility=hidden").include("c");
    for folder in INCLUDES {
        build.include(root.join(folder));
    }
    if security {
        build.define("LATTICE_DDS_SECURITY", None);
        for folder in SECURITY_INCLUDES {
            build.include(root.join(folder));
        }
        for (name, value) in PLUGINS {
            build.define(name, value);
        }
    }
    let mut cyclone = build.clone();
    cyclone.warnings(false).flag("-w");
    for line in SOURCES.lines() {
        let (digest, file) = line
            .split_once("  ")
            .ok_or("sources.sha256: no digest and file")?;
        let text = checked(&root.join(file), digest)?;
        if file.ends_with(".c") && is_wanted(file, &os, security) {
            cyclone.file(match CHANGES.iter().find(|change| change.file == file) {
                Some(change) => changed(change, text)?,
                None => root.join(file),
            });
        }
    }
    build
        .warnings(true)
        .warnings_into_errors(true)
        .files(["c/blob.c", "c/participants.c", "c/writer.c"])
        .try_compile("lattice_blob")?;
    cyclone.try_compile("lattice_ddsc")?;
    if security {
        println!("cargo::rustc-link-lib=ssl");
        println!("cargo::rustc-link-lib=crypto");
    }
    Ok(())
}

/// Reads a file and verifies its digest.
fn checked(path: &Path, digest: &str) -> Result<Vec<u8>, Box<dyn Error>> {
    let text = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let found: String = Sha256::digest(&text)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    match found == digest {
        true => Ok(text),
        false => Err(format!(
            "{} is another file than the one in sources.sha256",
            path.display()
        )
        .into()),
    }
}

/// True for a file of the built parts.
fn is_wanted(file: &str, os: &str, security: bool) -> bool {
    let of_security =
        file.starts_with("security/") || file.starts_with("core/ddsi/src/ddsi_security_");
    let of_macos = file.contains("/darwin/");
    let of_others = file.contains("/netstat/linux/") || file.ends_with("time/posix/time.c");
    match os {
        "macos" => !of_others && (security || !of_security),
        _ => !of_macos && (security || !of_security),
    }
}

/// Writes a patched copy and returns its path.
fn changed(change: &Change, text: Vec<u8>) -> Result<PathBuf, Box<dyn Error>> {
    let mut text = format!("#include \"blob.h\"\n{}", String::from_utf8(text)?);
    for (from, to) in change.pieces {
        if text.matches(from).count() != 1 {
            return Err(format!("{}: not once {from:?}", change.file).into());
        }
        text = text.replace(from, to);
    }
    let folder = PathBuf::from(env::var_os("OUT_DIR").ok_or("no OUT_DIR")?);
    let path = folder.join(change.file.replace('/', "_"));
    fs::write(&path, text)?;
    Ok(path)
}
