//! Parameter descriptions, declared once in tables beside the code that reads them.

use super::ParamValue;

/// Description of a parameter, and whether it is read-only.
#[derive(Debug, PartialEq, Eq)]
pub struct About {
    /// Full name; a leading `*` matches all names with the rest as suffix.
    pub name: &'static str,
    /// Meaning, with the unit if the name has none.
    pub text: &'static str,
    /// Reason why it cannot change at run time; `None`: it can.
    pub fixed: Option<&'static str>,
}

impl About {
    pub(super) fn is_of(&self, name: &str) -> bool {
        match self.name.strip_prefix('*') {
            Some(ending) => name.starts_with("qos.") && name.ends_with(ending),
            None => self.name == name,
        }
    }
}

/// Table of [`About`]: `"name": "text";` for settable parameters, `"name" fixed("reason"): "text";` for read-only ones.
#[macro_export]
macro_rules! about {
    (@) => { None };
    (@ $why:expr) => { Some($why) };
    ($($name:literal $(fixed($why:expr))?: $text:literal;)*) => {
        &[$($crate::params::About {
            name: $name,
            text: $text,
            fixed: $crate::about!(@ $($why)?),
        }),*]
    };
}

/// Parameters that every node has.
pub(super) const OF_EVERY_NODE: &[About] = about! {
    "max_message_bytes" fixed("subscriptions are made with it"): "Largest message accepted, bytes.";
    "use_sim_time": "Whether the node uses the time on /clock.";
    "managed" fixed("it is read at the start"):
        "Whether the node is a lifecycle node, which waits to be configured and activated (ros2 lifecycle).";
    "start_type_description_service" fixed("the service is made at the start"):
        "Whether ~/get_type_description is served.";
    "*.reliability" fixed(QOS): "Reliability of the topic: reliable (lost samples are resent) or best_effort.";
    "*.durability" fixed(QOS): "Durability of the topic: transient_local (late joiners receive the last samples) or volatile.";
    "*.depth" fixed(QOS): "History depth of the topic, samples.";
};

const QOS: &str = "endpoints are made with it";

/// Inclusive range of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Inclusive integer range.
    Integer(i64, i64),
    /// Inclusive float range.
    Float(f64, f64),
}

/// A parameter declared by the node.
#[derive(Clone, Debug, PartialEq)]
pub struct Declared {
    /// Current value.
    pub value: ParamValue,
    /// Default value.
    pub default: ParamValue,
    /// Allowed range, if any.
    pub range: Option<Range>,
    /// Allowed words; empty: any.
    pub allowed: String,
    /// Description, if any.
    pub about: Option<&'static About>,
    /// True after listeners were notified.
    pub(super) told: bool,
}

impl Declared {
    pub(super) fn new(
        value: ParamValue,
        default: ParamValue,
        about: Option<&'static About>,
    ) -> Self {
        Self {
            value,
            default,
            range: None,
            allowed: String::new(),
            about,
            told: false,
        }
    }

    /// Meaning, with its unit.
    pub fn text(&self) -> &'static str {
        self.about.map_or("", |about| about.text)
    }

    /// Reason why it cannot change at run time.
    pub fn fixed(&self) -> Option<&'static str> {
        let unknown = "it is read at the start";
        self.about.map_or(Some(unknown), |about| about.fixed)
    }

    /// Allowed range or words; empty: any value of its type.
    pub fn constraint(&self) -> String {
        match self.range {
            Some(Range::Integer(least, i64::MAX)) => format!("{least} or more"),
            Some(Range::Integer(least, most)) => format!("{least} to {most}"),
            Some(Range::Float(least, f64::MAX)) => format!("{least} or more"),
            Some(Range::Float(least, most)) => format!("{least} to {most}"),
            None => self.allowed.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Params;
    use super::*;

    const TABLE: &[About] = about! {
        "rate_hz": "How often.";
        "frame" fixed("it is"): "Where.";
    };

    #[test]
    fn what_is_read_is_described_by_its_table() {
        let params = Params::from_values("/n", [("rate_hz", ParamValue::F64(2.0))]);
        params.describe(TABLE);
        params.describe(TABLE);
        params.f64_in("rate_hz", 5.0, 0.1..=100.0).unwrap();
        params.usize_in("qos.map.depth", 5, 1..=9).unwrap();
        params.word("frame", &["map", "odom"]).unwrap();
        params.i64("other", 1).unwrap();
        let all = params.described();
        let rate = &all["rate_hz"];
        assert_eq!((rate.text(), rate.fixed()), ("How often.", None));
        assert_eq!(rate.range, Some(Range::Float(0.1, 100.0)));
        assert_eq!(
            (&rate.value, &rate.default),
            (&ParamValue::F64(2.0), &ParamValue::F64(5.0))
        );
        assert_eq!(
            all["qos.map.depth"].text(),
            "History depth of the topic, samples."
        );
        assert_eq!(all["frame"].constraint(), "map or odom");
        assert!(
            all["other"].fixed().is_some(),
            "what is not described is fixed"
        );
        let help = params.help();
        let expected = "  rate_hz: double, 0.1 to 100 (default 5.0)\n      How often.\n";
        assert!(help.contains(expected), "{help}");
        assert!(
            help.contains("  frame [fixed]: string, map or odom (default \"map\")"),
            "{help}"
        );
    }
}
