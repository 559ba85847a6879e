//! Playback options: topics, rate, range and clock.

use crate::{BagError, BagReader, TopicInfo};

/// Allowed playback rates.
pub(super) const RATES: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// Largest rate of `/clock`, Hz.
const MAX_CLOCK_HZ: f64 = 10_000.0;

/// Playback options.
#[derive(Clone, Debug)]
pub struct PlayerOptions {
    /// Bag seconds per second, 0.001 to 1000.
    pub rate: f64,
    /// Start offset from the first message, s.
    pub start_offset_s: f64,
    /// Duration in bag time, s; `None`: to its end.
    pub duration_s: Option<f64>,
    /// True to restart at the end.
    pub loop_: bool,
    /// Names of the topics to play; `None`: all.
    pub include: Option<Vec<String>>,
    /// Names of topics not to play.
    pub exclude: Vec<String>,
    /// Rate of `/clock`, Hz of the caller's clock; `None`: never.
    pub clock_hz: Option<f64>,
}

impl Default for PlayerOptions {
    fn default() -> Self {
        PlayerOptions {
            rate: 1.0,
            start_offset_s: 0.0,
            duration_s: None,
            loop_: false,
            include: None,
            exclude: Vec::new(),
            clock_hz: None,
        }
    }
}

/// A played topic.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PlayedTopic {
    /// Index into the reader's topics.
    pub bag_topic: usize,
    /// Topic of the bag.
    pub info: TopicInfo,
}

impl PlayerOptions {
    pub(super) fn check(&self) -> Result<(), BagError> {
        if !RATES.contains(&self.rate) {
            let reason = format!("{} is outside 0.001..=1000", self.rate);
            return Err(BagError::invalid("rate", reason));
        }
        let seconds = |name, value: f64| match value.is_finite() && (0.0..=1e9).contains(&value) {
            true => Ok(()),
            false => {
                let reason = format!("{value} s is outside 0..=1e9 s");
                Err(BagError::invalid(name, reason))
            }
        };
        seconds("start_offset_s", self.start_offset_s)?;
        self.duration_s
            .map_or(Ok(()), |duration_s| seconds("duration_s", duration_s))?;
        match self.clock_hz {
            Some(hz) if !(hz > 0.0 && hz <= MAX_CLOCK_HZ) => Err(BagError::invalid(
                "clock_hz",
                format!("{hz} Hz is not above 0 and at most {MAX_CLOCK_HZ} Hz"),
            )),
            _ => Ok(()),
        }
    }

    /// Topics to play; topics that are not CDR of a known type are skipped.
    pub(super) fn topics(&self, reader: &BagReader) -> Result<Vec<PlayedTopic>, BagError> {
        reader.expect_topics(self.include.as_deref().unwrap_or_default())?;
        reader.expect_topics(&self.exclude)?;
        let mut played = Vec::new();
        for (bag_topic, info) in reader.topics().iter().enumerate() {
            let is_included = self
                .include
                .as_ref()
                .is_none_or(|names| names.contains(&info.name));
            if !is_included || self.exclude.contains(&info.name) {
                continue;
            }
            if info.serialization_format != "cdr" || info.type_name.is_empty() {
                let (name, format) = (&info.name, &info.serialization_format);
                log::warn!(
                    "{name} is skipped: its messages are {format:?}, not CDR of a known type"
                );
                continue;
            }
            played.push(PlayedTopic {
                bag_topic,
                info: info.clone(),
            });
        }
        Ok(played)
    }
}

/// Validated seconds, in nanoseconds.
pub(super) fn ns_from_s(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
