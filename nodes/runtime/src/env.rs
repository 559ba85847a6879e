//! Network settings that ROS 2 reads from the environment.

use thiserror::Error;

/// Highest DDS domain whose ports fit below 65536.
pub const DOMAIN_ID_MAX: u16 = 232;
/// Domains whose ports lie among those that Linux gives to outgoing connections.
const EPHEMERAL_DOMAINS: std::ops::RangeInclusive<u16> = 102..=214;

const DOMAIN_ID: &str = "ROS_DOMAIN_ID";
const LOCALHOST_ONLY: &str = "ROS_LOCALHOST_ONLY";
const DISCOVERY_RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
const STATIC_PEERS: &str = "ROS_STATIC_PEERS";

/// The network settings of a process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// DDS domain, 0 to 232.
    pub domain_id: u16,
    /// True where nothing may leave this machine.
    pub localhost_only: bool,
    /// Lines for the log.
    pub warnings: Vec<String>,
}

/// Reason why the environment is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EnvError {
    /// `ROS_DOMAIN_ID` is no domain.
    #[error("ROS_DOMAIN_ID={value:?} is no DDS domain; expected a number from 0 to 232")]
    DomainId {
        /// The value given.
        value: String,
    },
}

impl Network {
    /// Reads the environment of the process.
    pub fn from_env() -> Result<Network, EnvError> {
        Self::from_lookup(|name| {
            std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
        })
    }

    /// Reads an environment given as a function; an empty variable counts as unset.
    pub fn from_lookup(lookup: impl Fn(&str) -> Option<String>) -> Result<Network, EnvError> {
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
        if get(STATIC_PEERS).is_some() {
            warnings.push(format!(
                "{STATIC_PEERS} is ignored: this transport finds others by multicast only"
            ));
        }
        Ok(Network {
            domain_id,
            localhost_only: localhost_only || local_range,
            warnings,
        })
    }
}

fn domain_id(value: &str) -> Option<u16> {
    value.trim().parse().ok().filter(|id| *id <= DOMAIN_ID_MAX)
}

/// True for a discovery range that stays on this machine.
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
            variables
                .iter()
                .find(|(key, _)| *key == name)
                .map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn an_empty_environment_has_the_defaults_of_ros() {
        let expected = Network {
            domain_id: 0,
            localhost_only: false,
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
            let network = read(&[(DOMAIN_ID, value)]).unwrap();
            assert_eq!(
                (network.domain_id, network.warnings.len()),
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
        for (value, local, warnings) in [
            ("OFF", true, 0),
            ("LOCALHOST", true, 0),
            ("SUBNET", false, 0),
            ("SYSTEM_DEFAULT", false, 0),
            ("subnet", true, 1),
        ] {
            let network = read(&[(DISCOVERY_RANGE, value)]).unwrap();
            let found = (network.localhost_only, network.warnings.len());
            assert_eq!(found, (local, warnings), "{value}");
        }
    }

    #[test]
    fn localhost_only_overrides_the_range() {
        let network = read(&[(LOCALHOST_ONLY, "1"), (DISCOVERY_RANGE, "SUBNET")]).unwrap();
        assert!(network.localhost_only);
        let warnings = network.warnings.len();
        assert_eq!(warnings, 2, "deprecated, and the range ignored");
        assert!(!read(&[(LOCALHOST_ONLY, "0")]).unwrap().localhost_only);
        let odd = read(&[(LOCALHOST_ONLY, "true")]).unwrap();
        assert_eq!((odd.localhost_only, odd.warnings.len()), (false, 1));
    }

    #[test]
    fn static_peers_are_warned_about() {
        let network = read(&[(STATIC_PEERS, "10.0.0.1; robot ;")]).unwrap();
        assert_eq!(network.warnings.len(), 1);
    }
}
