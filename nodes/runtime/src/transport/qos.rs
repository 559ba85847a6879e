//! QoS of our topics, and overrides by parameters.

use crate::config::params::{ParamError, Params};

/// Largest history depth settable by parameter, samples.
const DEPTH_MAX: usize = 10_000;

/// Reliability policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reliability {
    /// Lost samples are not resent.
    BestEffort,
    /// Lost samples are resent.
    Reliable,
}

/// Durability policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Durability {
    /// Late joiners receive no earlier samples.
    Volatile,
    /// Late joiners receive the last samples.
    TransientLocal,
}

/// QoS of a topic; the history is always "keep last `depth`".
///
/// ```
/// use lattice_runtime::qos::{Durability, Qos, Reliability};
///
/// let latched = Qos::latched(1);
/// assert_eq!(latched.durability, Durability::TransientLocal);
/// assert_eq!(Qos::SENSOR.reliability, Reliability::BestEffort);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Qos {
    /// Reliability.
    pub reliability: Reliability,
    /// Durability.
    pub durability: Durability,
    /// History depth, at least 1.
    pub depth: usize,
    /// Samples that a transient-local writer keeps for late joiners; `depth` if `None`.
    pub kept: Option<usize>,
}

impl Qos {
    /// Clouds of a headset: matches every driver.
    pub const SENSOR: Qos = Qos::best_effort(5);
    /// Point clouds, in and between our nodes: line scanners send hundreds of small clouds per second, in
    /// bursts after waiting for a pose.
    pub const SCANS: Qos = Qos::best_effort(20);
    /// Inputs of INS, IMU and GNSS: 2 s at 100 Hz, for interpolation.
    pub const INS: Qos = Qos::best_effort(200);
    /// The map: depth for the chunks of a keyframe, at most 60 kB each. Late joiners match as with every
    /// latched topic, but receive a new keyframe instead of a history.
    pub const MAP: Qos = Qos::latched(500).keeping(1);
    /// Markers: depth for all chunks, at most 60 kB each; all are republished for late joiners.
    pub const MARKERS: Qos = Qos::latched(500).keeping(1);
    /// Small results of which only the last matters: origin, calibration.
    pub const LATCHED: Qos = Qos::latched(1);
    /// Map updates since a keyframe.
    pub const DELTAS: Qos = Qos::reliable(100);
    /// `/tf`, publisher and subscription.
    pub const TF: Qos = Qos::reliable(100);
    /// `/tf_static`, publisher: one message with all its transforms.
    pub const TF_STATIC: Qos = Qos::latched(1);
    /// `/tf_static`, subscription: the messages of many publishers.
    pub const TF_STATIC_LISTENER: Qos = Qos::latched(100);
    /// `/diagnostics`.
    pub const DIAGNOSTICS: Qos = Qos::reliable(10);
    /// `/clock`, subscription: matches every player and simulator.
    pub const CLOCK: Qos = Qos::best_effort(1);
    /// `/clock`, publisher: matches every subscription.
    pub const CLOCK_PLAYER: Qos = Qos::reliable(1);
    /// `/rosout`.
    pub const ROSOUT: Qos = Qos::latched(1000);
    /// `/parameter_events`.
    pub const PARAMETER_EVENTS: Qos = Qos::reliable(1000);
    /// Services.
    pub const SERVICES: Qos = Qos::reliable(10);
    /// Requests of a server: requests queue while it is busy; beyond the depth the oldest are lost
    /// and counted.
    pub const REQUESTS: Qos = Qos::reliable(1024);
    /// Default QoS of ROS.
    pub const DEFAULT: Qos = Qos::reliable(10);

    /// Best effort, volatile.
    pub const fn best_effort(depth: usize) -> Qos {
        Qos {
            reliability: Reliability::BestEffort,
            durability: Durability::Volatile,
            depth,
            kept: None,
        }
    }

    /// Reliable, volatile.
    pub const fn reliable(depth: usize) -> Qos {
        Qos {
            reliability: Reliability::Reliable,
            durability: Durability::Volatile,
            depth,
            kept: None,
        }
    }

    /// Reliable, transient local.
    pub const fn latched(depth: usize) -> Qos {
        Qos {
            reliability: Reliability::Reliable,
            durability: Durability::TransientLocal,
            depth,
            kept: None,
        }
    }

    /// The same QoS with fewer samples for late joiners.
    #[must_use]
    pub const fn keeping(self, samples: usize) -> Qos {
        Qos {
            kept: Some(samples),
            ..self
        }
    }

    /// Samples for late joiners: none of a volatile writer, else at least 1.
    pub fn kept(&self) -> usize {
        match self.durability {
            Durability::Volatile => 0,
            Durability::TransientLocal => {
                self.kept.unwrap_or(self.depth).clamp(1, self.depth.max(1))
            }
        }
    }

    /// Applies `qos.<topic>.reliability`, `.durability` and `.depth`.
    ///
    /// The topic is given as in the node's code (`map`) or by its full name (`/robot/map`), which takes
    /// precedence.
    pub fn with_overrides(
        self,
        params: &Params,
        resolved_topic: &str,
        relative_topic: &str,
    ) -> Result<Qos, ParamError> {
        let mut qos = self;
        for (topic, always) in [(relative_topic, true), (resolved_topic, false)] {
            let key = |quality: &str| {
                let key = format!("qos.{topic}.{quality}");
                (always || params.is_given(&key)).then_some(key)
            };
            if let Some(key) = key("reliability") {
                qos.reliability = choose(params, &key, qos.reliability, RELIABILITIES)?;
            }
            if let Some(key) = key("durability") {
                qos.durability = choose(params, &key, qos.durability, DURABILITIES)?;
            }
            if let Some(key) = key("depth") {
                qos.depth = params.usize_in(&key, qos.depth, 1..=DEPTH_MAX)?;
            }
        }
        Ok(qos)
    }
}

const RELIABILITIES: [(&str, Reliability); 2] = [
    ("best_effort", Reliability::BestEffort),
    ("reliable", Reliability::Reliable),
];
const DURABILITIES: [(&str, Durability); 2] = [
    ("volatile", Durability::Volatile),
    ("transient_local", Durability::TransientLocal),
];

/// Reads one of two words; the default is a value.
fn choose<T: Copy + PartialEq>(
    params: &Params,
    key: &str,
    default: T,
    choices: [(&str, T); 2],
) -> Result<T, ParamError> {
    let known = choices.iter().find(|(_, value)| *value == default);
    let word = known.map_or("", |(word, _)| word);
    let place = params.word_or(key, &choices.map(|(word, _)| word), word)?;
    Ok(choices.get(place).map_or(default, |(_, value)| *value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::params::ParamValue;

    fn params(values: &[(&str, &str)]) -> Params {
        let read = |text| ParamValue::from_yaml_text(text).unwrap();
        let values = values.iter().map(|(name, text)| (*name, read(text)));
        Params::from_values("/robot/mapper", values)
    }

    fn map_qos(values: &[(&str, &str)]) -> Result<Qos, ParamError> {
        Qos::MAP.with_overrides(&params(values), "/robot/map", "map")
    }

    #[test]
    fn both_names_count_and_the_full_one_wins() {
        let relative = ("qos.map.depth", "7");
        let full = ("qos./robot/map.depth", "8");
        assert_eq!(map_qos(&[]).unwrap(), Qos::MAP);
        assert_eq!(map_qos(&[relative]).unwrap().depth, 7);
        assert_eq!(map_qos(&[full]).unwrap().depth, 8);
        assert_eq!(map_qos(&[relative, full]).unwrap().depth, 8);
        let reliability = ("qos.map.reliability", "best_effort");
        let qos = map_qos(&[reliability, ("qos.map.durability", "volatile")]);
        assert_eq!(qos.unwrap(), Qos::best_effort(Qos::MAP.depth).keeping(1));
        assert_eq!(map_qos(&[]).unwrap().kept(), 1);
        assert_eq!(
            map_qos(&[("qos.map.durability", "volatile")])
                .unwrap()
                .kept(),
            0
        );
        assert_eq!(Qos::latched(7).kept(), 7);
    }

    #[test]
    fn overrides_are_declared_and_so_not_unused() {
        let names = ["qos.map.depth", "qos./robot/map.depth", "qos.mop.depth"];
        let params = params(&names.map(|name| (name, "7")));
        Qos::MAP
            .with_overrides(&params, "/robot/map", "map")
            .unwrap();
        assert_eq!(params.unused(), ["qos.mop.depth"]);
        assert_eq!(params.declared().len(), 4);
    }

    #[test]
    fn wrong_values_say_what_is_expected() {
        let full = "qos./robot/map.durability";
        for (name, value, part) in [
            ("qos.map.reliability", "maybe", "best_effort or reliable"),
            (full, "latched", "volatile or transient_local"),
            ("qos.map.depth", "0", "a number from 1 to 10000"),
            ("qos.map.depth", "-1", "a number from 1 to 10000"),
            ("qos.map.depth", "10001", "a number from 1 to 10000"),
            ("qos.map.depth", "many", "an integer"),
            ("qos.map.reliability", "1", "a text"),
        ] {
            let error = map_qos(&[(name, value)]).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains(name), "{error}");
        }
    }
}
