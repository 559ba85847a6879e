//! Session configuration, from the variables of rmw_zenoh.

use std::path::Path;
use std::time::Duration;

use zenoh::Config;

use super::error_text::words;
use crate::config::env::{
    Network, ZENOH_CHECK_ATTEMPTS as CHECK_ATTEMPTS, ZENOH_OVERRIDE as OVERRIDE,
    ZENOH_SESSION_CONFIG as SESSION_CONFIG,
};

/// Period of router checks.
pub(super) const CHECK_PERIOD: Duration = Duration::from_secs(1);

/// Differences of rmw_zenoh's default session from Zenoh's: a peer that learns of others from a router on this
/// machine; no multicast; timeouts for many nodes starting at once.
const DEFAULT: &str = r#"{
    mode: "peer",
    connect: { endpoints: ["tcp/localhost:7447"] },
    listen: { endpoints: ["tcp/localhost:0"] },
    scouting: {
        multicast: { enabled: false },
        gossip: {
            enabled: true,
            target: { router: ["router", "peer"], peer: ["router"] },
            autoconnect_strategy: { peer: { to_router: "always", to_peer: "greater-zid" } },
        },
    },
    timestamping: { enabled: { router: true, peer: true, client: true } },
    queries_default_timeout: 600000,
    transport: {
        unicast: {
            open_timeout: 60000,
            accept_timeout: 60000,
            accept_pending: 10000,
            max_sessions: 10000,
        },
        link: { tx: { lease: 60000, keep_alive: 2, queue: {
            congestion_control: { block: { wait_before_close: 60000000 } },
        } } },
    },
}"#;

/// Policy of the router check at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RouterCheck {
    /// This many checks, then the session continues without a router.
    Attempts(u64),
    /// Checks until a router is found.
    Endless,
    Skipped,
}

/// Configuration for the network settings.
pub(super) fn config(network: &Network) -> Result<(Config, RouterCheck), String> {
    let given = &network.zenoh;
    let mut config = match &given.session_config {
        Some(path) => from_file(path.trim())?,
        None => Config::from_json5(DEFAULT).map_err(words)?,
    };
    let overrides = given.overrides.as_deref().unwrap_or_default();
    for pair in overrides.split(';') {
        if !pair.trim().is_empty() {
            insert(&mut config, pair)?;
        }
    }
    if network.discovery_off {
        for pair in [
            "connect/endpoints=[]",
            "listen/endpoints=[]",
            "scouting/multicast/enabled=false",
            "scouting/gossip/enabled=false",
        ] {
            insert(&mut config, pair)?;
        }
    }
    let check = match &given.router_check {
        _ if network.discovery_off => RouterCheck::Skipped,
        None => RouterCheck::Attempts(1),
        Some(text) => match text.trim().parse::<i64>() {
            Ok(0) => RouterCheck::Endless,
            Ok(count) => u64::try_from(count).map_or(RouterCheck::Skipped, RouterCheck::Attempts),
            Err(_) => return Err(format!("{CHECK_ATTEMPTS}={text:?} is not an integer")),
        },
    };
    Ok((config, check))
}

fn from_file(path: &str) -> Result<Config, String> {
    // Zenoh selects the format by the extension.
    let ending = Path::new(path)
        .extension()
        .and_then(|ending| ending.to_str());
    match ending {
        Some("json5" | "json" | "yaml" | "yml") => Config::from_file(path)
            .map_err(|error| format!("{SESSION_CONFIG}={path}: {}", words(error))),
        _ => Err(format!(
            "{SESSION_CONFIG}={path:?} does not end in .json5, .json, .yaml or .yml"
        )),
    }
}

fn insert(config: &mut Config, pair: &str) -> Result<(), String> {
    let (key, value) = pair
        .split_once('=')
        .ok_or_else(|| format!("{OVERRIDE}: {pair:?} is not KEY=VALUE"))?;
    let inserted = config.insert_json5(key.trim(), value.trim());
    inserted.map_err(|error| format!("{OVERRIDE}: {}: {}", pair.trim(), words(error)))
}

/// Warnings about DDS settings without effect on Zenoh.
pub(super) fn warnings(network: &Network) -> Vec<&'static str> {
    let mut warnings = Vec::new();
    if network.localhost_only && !network.discovery_off {
        warnings.push(
            "ROS_AUTOMATIC_DISCOVERY_RANGE and ROS_LOCALHOST_ONLY have no effect on Zenoh: its router decides \
             what leaves this machine",
        );
    }
    if !network.static_peers.is_empty() {
        warnings.push(
            "ROS_STATIC_PEERS is ignored on Zenoh; name endpoints in ZENOH_CONFIG_OVERRIDE, such as \
             connect/endpoints=[\"tcp/192.168.1.1:7447\"]",
        );
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::env::ZenohSettings;

    fn network(variable: &str, value: &str) -> Network {
        let given = |name| (name == variable).then(|| value.to_owned());
        Network {
            discovery_off: false,
            zenoh: ZenohSettings {
                session_config: given(SESSION_CONFIG),
                overrides: given(OVERRIDE),
                router_check: given(CHECK_ATTEMPTS),
            },
            ..Network::from_env().unwrap()
        }
    }

    fn read(variable: &str, value: &str) -> Result<(Config, RouterCheck), String> {
        config(&network(variable, value))
    }

    fn value(config: &Config, key: &str) -> String {
        config.get_json(key).unwrap()
    }

    #[test]
    fn the_default_is_that_of_rmw_zenoh() {
        let (config, check) = read("", "").unwrap();
        assert_eq!(check, RouterCheck::Attempts(1));
        for (key, expected) in [
            ("mode", "\"peer\""),
            ("connect/endpoints", "[\"tcp/localhost:7447\"]"),
            ("listen/endpoints", "[\"tcp/localhost:0\"]"),
            ("scouting/multicast/enabled", "false"),
            ("queries_default_timeout", "600000"),
        ] {
            assert_eq!(value(&config, key), expected, "{key}");
        }
    }

    #[test]
    fn overrides_are_applied_in_turn_and_wrong_ones_are_named() {
        let given = "mode=\"client\"; scouting/multicast/enabled=true;;";
        let (config, _) = read(OVERRIDE, given).unwrap();
        assert_eq!(value(&config, "mode"), "\"client\"");
        assert_eq!(value(&config, "scouting/multicast/enabled"), "true");
        for wrong in ["mode", "mode=\"cook\"", "no/such/key=1"] {
            let error = read(OVERRIDE, wrong).unwrap_err();
            assert!(error.contains(OVERRIDE) && error.contains(wrong), "{error}");
        }
    }

    #[test]
    fn files_are_read_and_wrong_ones_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        std::fs::write(path("a.json5"), "{ mode: \"client\" }").unwrap();
        std::fs::write(path("b.json5"), "{ mode: ").unwrap();
        std::fs::write(path("c.txt"), "{}").unwrap();
        let (config, _) = read(SESSION_CONFIG, &path("a.json5")).unwrap();
        assert_eq!(value(&config, "mode"), "\"client\"");
        for name in ["b.json5", "c.txt", "none.json5"] {
            let error = read(SESSION_CONFIG, &path(name)).unwrap_err();
            assert!(error.contains(name), "{error}");
        }
    }

    #[test]
    fn routers_are_looked_for_as_often_as_asked() {
        for (text, expected) in [
            ("0", RouterCheck::Endless),
            ("-1", RouterCheck::Skipped),
            ("3", RouterCheck::Attempts(3)),
        ] {
            assert_eq!(read(CHECK_ATTEMPTS, text).unwrap().1, expected);
        }
        let error = read(CHECK_ATTEMPTS, "many").unwrap_err();
        assert!(error.contains("many"), "{error}");
    }

    #[test]
    fn off_reaches_nobody() {
        let network = Network {
            discovery_off: true,
            ..network("", "")
        };
        let (config, check) = config(&network).unwrap();
        assert_eq!(check, RouterCheck::Skipped);
        for key in ["connect/endpoints", "listen/endpoints"] {
            assert_eq!(value(&config, key), "[]");
        }
    }
}
