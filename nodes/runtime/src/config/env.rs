//! Network settings from the environment variables of ROS 2.

use thiserror::Error;

use super::security::Security;

/// Highest DDS domain whose ports fit below 65536.
const DOMAIN_ID_MAX: u16 = 232;
/// Domains whose ports overlap the ephemeral port range of Linux.
const EPHEMERAL_DOMAINS: std::ops::RangeInclusive<u16> = 102..=214;

const DOMAIN_ID: &str = "ROS_DOMAIN_ID";
const LOCALHOST_ONLY: &str = "ROS_LOCALHOST_ONLY";
const DISCOVERY_RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
const STATIC_PEERS: &str = "ROS_STATIC_PEERS";
const IMPLEMENTATION: &str = "RMW_IMPLEMENTATION";
pub(crate) const ZENOH_SESSION_CONFIG: &str = "ZENOH_SESSION_CONFIG_URI";
pub(crate) const ZENOH_OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";
pub(crate) const ZENOH_CHECK_ATTEMPTS: &str = "ZENOH_ROUTER_CHECK_ATTEMPTS";

/// Transport of the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransportKind {
    /// DDS, by Eclipse Cyclone DDS.
    Dds,
    /// Zenoh, by the conventions of rmw_zenoh.
    #[cfg(feature = "zenoh")]
    Zenoh,
}

/// Name of the Zenoh transport, even where it is not built in.
const ZENOH: &str = "rmw_zenoh_cpp";

impl TransportKind {
    /// Transports built in, by their `RMW_IMPLEMENTATION` names; the first is the default.
    pub const BUILT_IN: &[(&str, TransportKind)] = &[
        ("rmw_cyclonedds_cpp", TransportKind::Dds),
        #[cfg(feature = "zenoh")]
        (ZENOH, TransportKind::Zenoh),
    ];

    /// Names of other DDS implementations, which interoperate with ours.
    const OTHER_DDS: [&str; 3] = [
        "rmw_fastrtps_cpp",
        "rmw_fastrtps_dynamic_cpp",
        "rmw_connextdds",
    ];

    /// Name in `RMW_IMPLEMENTATION`.
    pub fn name(self) -> &'static str {
        let found = Self::BUILT_IN.iter().find(|(_, kind)| *kind == self);
        found.map_or("", |(name, _)| name)
    }
}

/// The network settings of a process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// DDS domain, 0 to 232.
    pub domain_id: u16,
    /// True: communication is restricted to this machine.
    pub localhost_only: bool,
    /// True: discovery is off in both directions.
    pub discovery_off: bool,
    /// Addresses of hosts to discover in addition to multicast.
    pub static_peers: Vec<String>,
    /// Selected transport.
    pub transport: TransportKind,
    /// DDS Security, if enabled.
    pub security: Option<Security>,
    /// Settings of the session on Zenoh.
    pub zenoh: ZenohSettings,
    /// Warnings for the log.
    pub warnings: Vec<String>,
    /// Notes for the log, level INFO.
    pub notes: Vec<String>,
}

/// Variables of rmw_zenoh, unparsed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ZenohSettings {
    /// `ZENOH_SESSION_CONFIG_URI`: a file of Zenoh.
    pub session_config: Option<String>,
    /// `ZENOH_CONFIG_OVERRIDE`: `KEY=VALUE` for each setting, separated by `;`.
    pub overrides: Option<String>,
    /// `ZENOH_ROUTER_CHECK_ATTEMPTS`.
    pub router_check: Option<String>,
}

/// Invalid environment variable.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EnvError {
    /// Invalid `ROS_DOMAIN_ID`.
    #[error("ROS_DOMAIN_ID={0:?} is outside 0..=232; set a DDS domain in this range or unset it")]
    Domain(String),
    /// `RMW_IMPLEMENTATION` names a transport that is not built in.
    #[error(
        "RMW_IMPLEMENTATION={given:?} is not built in; possible are {possible}, or leave it unset{remedy}"
    )]
    Transport {
        /// Value of the variable.
        given: String,
        /// Names of the transports built in.
        possible: String,
        /// Build instruction, if known.
        remedy: &'static str,
    },
}

impl EnvError {
    pub(crate) fn not_built_in(given: &str) -> Self {
        let names: Vec<_> = TransportKind::BUILT_IN
            .iter()
            .map(|(name, _)| *name)
            .collect();
        Self::Transport {
            given: given.to_owned(),
            possible: names.join(" and "),
            remedy: match given {
                ZENOH => "; for Zenoh build with `cargo build --features zenoh`",
                _ => "",
            },
        }
    }
}

impl Network {
    /// Reads the environment of the process.
    pub fn from_env() -> Result<Network, EnvError> {
        Self::from_lookup(|name| {
            std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
        })
    }

    /// Reads an environment given as a function; an empty variable counts as unset.
    fn from_lookup(lookup: impl Fn(&str) -> Option<String>) -> Result<Network, EnvError> {
        let get = |name| lookup(name).filter(|value| !value.is_empty());
        let mut warnings = Vec::new();
        let domain_id = match get(DOMAIN_ID) {
            None => 0,
            Some(value) => domain_id(&value).ok_or(EnvError::Domain(value))?,
        };
        if EPHEMERAL_DOMAINS.contains(&domain_id) {
            warnings.push(format!(
                "{DOMAIN_ID}={domain_id} uses ports in the ephemeral range of Linux; \
                 0 to 101 and 215 to 232 are safe"
            ));
        }
        let range = get(DISCOVERY_RANGE);
        let local_range = range
            .as_deref()
            .is_some_and(|range| is_local(range, &mut warnings));
        let localhost_only = localhost_only(get(LOCALHOST_ONLY), &mut warnings);
        if localhost_only && !local_range && range.is_some() {
            warnings.push(format!(
                "{DISCOVERY_RANGE} is ignored since {LOCALHOST_ONLY} is 1"
            ));
        }
        let mut notes = Vec::new();
        let transport = transport(get(IMPLEMENTATION), &mut notes)?;
        let discovery_off = range.as_deref() == Some("OFF") && !localhost_only;
        let peers = get(STATIC_PEERS);
        if discovery_off && peers.is_some() {
            warnings.push(format!(
                "{STATIC_PEERS} is ignored since {DISCOVERY_RANGE} is OFF"
            ));
        }
        let peers = peers.filter(|_| !discovery_off);
        let static_peers = static_peers(peers, &mut warnings);
        Ok(Network {
            domain_id,
            localhost_only: localhost_only || local_range,
            discovery_off,
            static_peers,
            transport,
            zenoh: ZenohSettings {
                session_config: get(ZENOH_SESSION_CONFIG),
                overrides: get(ZENOH_OVERRIDE),
                router_check: get(ZENOH_CHECK_ATTEMPTS),
            },
            security: Security::from_lookup(lookup),
            warnings,
            notes,
        })
    }
}

fn domain_id(value: &str) -> Option<u16> {
    value.trim().parse().ok().filter(|id| *id <= DOMAIN_ID_MAX)
}

fn transport(name: Option<String>, notes: &mut Vec<String>) -> Result<TransportKind, EnvError> {
    let Some(name) = name else {
        return Ok(TransportKind::Dds);
    };
    if TransportKind::OTHER_DDS.contains(&&*name) {
        notes.push(format!(
            "{IMPLEMENTATION}={name}: using Eclipse Cyclone DDS, the built-in DDS"
        ));
        return Ok(TransportKind::Dds);
    }
    let mut built_in = TransportKind::BUILT_IN.iter();
    let found = built_in.find(|(known, _)| *known == name);
    let kind = found.map(|(_, kind)| *kind);
    kind.ok_or_else(|| EnvError::not_built_in(&name))
}

/// Addresses separated by `;`.
fn static_peers(value: Option<String>, warnings: &mut Vec<String>) -> Vec<String> {
    let Some(value) = value else {
        return Vec::new();
    };
    let addresses = value.split(';').map(str::trim).filter(|a| !a.is_empty());
    let is_address = |text: &&str| {
        let allowed = |c: char| c.is_ascii_alphanumeric() || ".:-_%[]".contains(c);
        text.chars().all(allowed)
    };
    let (good, bad): (Vec<_>, Vec<_>) = addresses.partition(is_address);
    if !bad.is_empty() {
        warnings.push(format!("{STATIC_PEERS}: invalid addresses {bad:?}"));
    }
    good.into_iter().map(str::to_owned).collect()
}

/// True for a discovery range limited to this machine.
fn is_local(range: &str, warnings: &mut Vec<String>) -> bool {
    match range {
        "OFF" | "LOCALHOST" => true,
        "SUBNET" | "SYSTEM_DEFAULT" => false,
        _ => {
            warnings.push(format!(
                "{DISCOVERY_RANGE}={range:?} is none of OFF, LOCALHOST, SUBNET, SYSTEM_DEFAULT; \
                 LOCALHOST is assumed"
            ));
            true
        }
    }
}

fn localhost_only(value: Option<String>, warnings: &mut Vec<String>) -> bool {
    match value.as_deref() {
        Some("1") => {
            let instead = format!("{DISCOVERY_RANGE}=LOCALHOST");
            warnings.push(format!("{LOCALHOST_ONLY} is deprecated; use {instead}"));
            true
        }
        None | Some("0") => false,
        Some(value) => {
            warnings.push(format!(
                "{LOCALHOST_ONLY}={value:?} is neither 0 nor 1; 0 is assumed"
            ));
            false
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)]) -> Result<Network, EnvError> {
        Network::from_lookup(|name| {
            let found = variables.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| (*value).to_owned())
        })
    }

    /// Domain, locality and number of warnings.
    fn network(variables: &[(&str, &str)]) -> (u16, bool, usize) {
        let network = read(variables).unwrap();
        let warnings = network.warnings.len();
        (network.domain_id, network.localhost_only, warnings)
    }

    #[test]
    fn an_empty_environment_has_the_defaults_of_ros() {
        assert_eq!(network(&[]), (0, false, 0));
        let names = [DOMAIN_ID, LOCALHOST_ONLY, DISCOVERY_RANGE, STATIC_PEERS];
        assert_eq!(network(&names.map(|name| (name, ""))), (0, false, 0));
    }

    #[test]
    fn every_dds_of_ros_means_ours_and_others_must_be_built_in() {
        for (name, kind) in TransportKind::BUILT_IN {
            let network = read(&[(IMPLEMENTATION, name)]).unwrap();
            assert_eq!((network.transport, network.notes), (*kind, vec![]));
        }
        for name in TransportKind::OTHER_DDS {
            let network = read(&[(IMPLEMENTATION, name)]).unwrap();
            assert_eq!(network.transport, TransportKind::Dds);
            assert!(network.notes[0].contains(name) && network.warnings.is_empty());
        }
        assert_eq!(read(&[]).unwrap().transport, TransportKind::Dds);
        let error = read(&[(IMPLEMENTATION, "rmw_other")]).unwrap_err();
        let words = "\"rmw_other\" is not built in; possible are";
        assert!(error.to_string().contains(words), "{error}");
        if let Err(error) = read(&[(IMPLEMENTATION, ZENOH)]) {
            assert!(error.to_string().contains("--features zenoh"), "{error}");
        }
        assert_eq!(
            read(&[(IMPLEMENTATION, ZENOH)]).is_ok(),
            cfg!(feature = "zenoh")
        );
    }

    #[test]
    fn off_is_off_whatever_peers_are_named() {
        let off = (DISCOVERY_RANGE, "OFF");
        let network = read(&[off, (STATIC_PEERS, "10.0.0.1")]).unwrap();
        assert!(network.discovery_off && network.localhost_only);
        assert_eq!((network.static_peers, network.warnings.len()), (vec![], 1));
        assert!(
            !read(&[(DISCOVERY_RANGE, "LOCALHOST")])
                .unwrap()
                .discovery_off
        );
    }

    #[test]
    fn static_peers_are_addresses() {
        let network = read(&[(STATIC_PEERS, "10.0.0.1; robot ;<x/>")]).unwrap();
        assert_eq!(network.static_peers, ["10.0.0.1", "robot"]);
        assert_eq!(network.warnings.len(), 1);
    }

    #[test]
    fn domains_end_at_232() {
        for (id, warnings) in [(0, 0), (101, 0), (102, 1), (214, 1), (215, 0), (232, 0)] {
            let found = network(&[(DOMAIN_ID, &id.to_string())]);
            assert_eq!(found, (id, false, warnings));
        }
        for value in ["233", "-1", "x", "1.0", "99999999999999999999"] {
            let error = read(&[(DOMAIN_ID, value)]).unwrap_err();
            assert!(error.to_string().contains(value), "{error}");
        }
    }

    #[test]
    fn ranges_and_localhost_only_decide_what_leaves_the_machine() {
        let (range, only) = (DISCOVERY_RANGE, LOCALHOST_ONLY);
        let both = [(only, "1"), (range, "SUBNET")];
        for (variables, local, warnings) in [
            (&[(range, "OFF")][..], true, 0),
            (&[(range, "LOCALHOST")], true, 0),
            (&[(range, "SUBNET")], false, 0),
            (&[(range, "SYSTEM_DEFAULT")], false, 0),
            (&[(range, "subnet")], true, 1),
            // Deprecated, and the range is ignored.
            (&both, true, 2),
            (&[(only, "0")], false, 0),
            (&[(only, "true")], false, 1),
        ] {
            assert_eq!(network(variables), (0, local, warnings), "{variables:?}");
        }
    }
}
