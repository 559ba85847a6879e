//! What ROS 2 reads from the environment about the network.

use thiserror::Error;

/// Highest DDS domain whose ports fit below 65536.
pub const DOMAIN_ID_MAX: u16 = 232;
/// Domains whose ports lie among those that Linux gives to outgoing connections.
const EPHEMERAL_DOMAINS: std::ops::RangeInclusive<u16> = 102..=214;

const DOMAIN_ID: &str = "ROS_DOMAIN_ID";
const LOCALHOST_ONLY: &str = "ROS_LOCALHOST_ONLY";
const DISCOVERY_RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
const STATIC_PEERS: &str = "ROS_STATIC_PEERS";

/// Where to look for other participants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// Nowhere.
    Off,
    /// On this machine.
    Localhost,
    /// Wherever multicast reaches; the default.
    Subnet,
    /// As the DDS implementation does without ROS.
    SystemDefault,
}

/// The network settings of a process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transport {
    /// DDS domain, 0 to 232.
    pub domain_id: u16,
    /// Where to look for others.
    pub discovery: DiscoveryRange,
    /// True where nothing may leave this machine (`discovery` is then `Localhost`, or `Off`).
    pub localhost_only: bool,
    /// `ROS_STATIC_PEERS` as given; not used by this transport.
    pub static_peers: Vec<String>,
    /// What the user should hear.
    pub warnings: Vec<String>,
}

/// Why the environment is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EnvError {
    /// `ROS_DOMAIN_ID` is no domain.
    #[error("ROS_DOMAIN_ID={value:?} is no DDS domain; expected a number from 0 to 232")]
    DomainId {
        /// The value given.
        value: String,
    },
}

impl Transport {
    /// Reads the environment of the process.
    pub fn from_env() -> Result<Transport, EnvError> {
        Self::from_lookup(|name| {
            std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
        })
    }

    /// Reads an environment given as a function; an empty variable counts as unset.
    pub fn from_lookup(lookup: impl Fn(&str) -> Option<String>) -> Result<Transport, EnvError> {
        let get = |name| lookup(name).filter(|value| !value.is_empty());
        let mut warnings = Vec::new();
        let domain_id = match get(DOMAIN_ID) {
            None => 0,
            Some(value) => domain_id(&value).ok_or(EnvError::DomainId { value })?,
        };
        if EPHEMERAL_DOMAINS.contains(&domain_id) {
            warnings.push(format!(
                "{DOMAIN_ID}={domain_id} uses ports that Linux gives to outgoing connections; \
                 0 to 101 and 215 to 232 are safe"
            ));
        }
        let mut discovery = match get(DISCOVERY_RANGE) {
            None => DiscoveryRange::Subnet,
            Some(value) => discovery_range(&value, &mut warnings),
        };
        if localhost_only(get(LOCALHOST_ONLY), &mut warnings) {
            if discovery != DiscoveryRange::Localhost && get(DISCOVERY_RANGE).is_some() {
                warnings.push(format!(
                    "{DISCOVERY_RANGE} is ignored since {LOCALHOST_ONLY} is 1"
                ));
            }
            discovery = DiscoveryRange::Localhost;
        }
        let static_peers: Vec<String> = get(STATIC_PEERS)
            .unwrap_or_default()
            .split(';')
            .map(str::trim)
            .filter(|peer| !peer.is_empty())
            .map(str::to_owned)
            .collect();
        if !static_peers.is_empty() {
            warnings.push(format!(
                "{STATIC_PEERS} is ignored: this transport finds others by multicast only"
            ));
        }
        let localhost_only = matches!(discovery, DiscoveryRange::Localhost | DiscoveryRange::Off);
        Ok(Transport {
            domain_id,
            discovery,
            localhost_only,
            static_peers,
            warnings,
        })
    }
}

fn domain_id(value: &str) -> Option<u16> {
    value.trim().parse().ok().filter(|id| *id <= DOMAIN_ID_MAX)
}

fn discovery_range(value: &str, warnings: &mut Vec<String>) -> DiscoveryRange {
    match value {
        "OFF" => DiscoveryRange::Off,
        "LOCALHOST" => DiscoveryRange::Localhost,
        "SUBNET" => DiscoveryRange::Subnet,
        "SYSTEM_DEFAULT" => DiscoveryRange::SystemDefault,
        _ => {
            warnings.push(format!(
                "{DISCOVERY_RANGE}={value:?} is none of OFF, LOCALHOST, SUBNET, SYSTEM_DEFAULT; \
                 LOCALHOST is assumed"
            ));
            DiscoveryRange::Localhost
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

    fn read(variables: &[(&str, &str)]) -> Result<Transport, EnvError> {
        Transport::from_lookup(|name| {
            variables
                .iter()
                .find(|(key, _)| *key == name)
                .map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn an_empty_environment_has_the_defaults_of_ros() {
        let expected = Transport {
            domain_id: 0,
            discovery: DiscoveryRange::Subnet,
            localhost_only: false,
            static_peers: vec![],
            warnings: vec![],
        };
        assert_eq!(read(&[]).unwrap(), expected);
        let empty =
            [DOMAIN_ID, LOCALHOST_ONLY, DISCOVERY_RANGE, STATIC_PEERS].map(|name| (name, ""));
        assert_eq!(read(&empty).unwrap(), expected);
    }

    #[test]
    fn domains_end_at_232() {
        for (value, id, warnings) in [
            ("0", 0, 0),
            ("101", 101, 0),
            ("102", 102, 1),
            ("214", 214, 1),
            ("215", 215, 0),
            ("232", 232, 0),
        ] {
            let transport = read(&[(DOMAIN_ID, value)]).unwrap();
            assert_eq!(
                (transport.domain_id, transport.warnings.len()),
                (id, warnings),
                "{value}"
            );
        }
        for value in ["233", "-1", "x", "1.0", "99999999999999999999"] {
            let error = read(&[(DOMAIN_ID, value)]).unwrap_err();
            assert_eq!(
                error,
                EnvError::DomainId {
                    value: value.to_owned()
                }
            );
            assert!(error.to_string().contains(value), "{error}");
        }
    }

    #[test]
    fn discovery_ranges_follow_the_variable() {
        for (value, range, localhost_only) in [
            ("OFF", DiscoveryRange::Off, true),
            ("LOCALHOST", DiscoveryRange::Localhost, true),
            ("SUBNET", DiscoveryRange::Subnet, false),
            ("SYSTEM_DEFAULT", DiscoveryRange::SystemDefault, false),
        ] {
            let transport = read(&[(DISCOVERY_RANGE, value)]).unwrap();
            assert_eq!(
                (transport.discovery, transport.localhost_only),
                (range, localhost_only)
            );
            assert!(transport.warnings.is_empty(), "{value}");
        }
        let transport = read(&[(DISCOVERY_RANGE, "subnet")]).unwrap();
        assert_eq!(transport.discovery, DiscoveryRange::Localhost);
        assert!(
            transport.warnings[0].contains("\"subnet\""),
            "{:?}",
            transport.warnings
        );
    }

    #[test]
    fn localhost_only_overrides_the_range() {
        let transport = read(&[(LOCALHOST_ONLY, "1"), (DISCOVERY_RANGE, "SUBNET")]).unwrap();
        assert_eq!(transport.discovery, DiscoveryRange::Localhost);
        assert!(transport.localhost_only);
        assert_eq!(
            transport.warnings.len(),
            2,
            "deprecated, and the range ignored"
        );
        assert!(!read(&[(LOCALHOST_ONLY, "0")]).unwrap().localhost_only);
        let odd = read(&[(LOCALHOST_ONLY, "true")]).unwrap();
        assert_eq!((odd.localhost_only, odd.warnings.len()), (false, 1));
    }

    #[test]
    fn static_peers_are_kept_and_warned_about() {
        let transport = read(&[(STATIC_PEERS, "10.0.0.1; robot ;")]).unwrap();
        assert_eq!(transport.static_peers, ["10.0.0.1", "robot"]);
        assert_eq!(transport.warnings.len(), 1);
    }
}
