//! Notes on corrected layouts of clouds and on the source of the times of their points, once for each topic.

use lattice_core::cloud::{LayoutNote, TimeSource, TimeUnit};
use serde::{Deserialize, Serialize};

/// Limit of notes.
const MAX_NOTES: usize = 128;
/// Number of clouds of a topic whose point times are compared with the period of the clouds.
const CHECKED_CLOUDS: u32 = 3;

/// Note on the clouds of a topic.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CloudNote {
    /// Topic of the clouds.
    pub topic: String,
    /// True if points may have wrong positions because of it.
    pub is_warning: bool,
    /// Text of the note, with a remedy.
    pub text: String,
}

/// Notes since the start.
#[derive(Clone, Debug, Default)]
pub(crate) struct CloudNotes {
    notes: Vec<CloudNote>,
    topics: Vec<TopicTimes>,
}

/// State of the times of a topic's points.
#[derive(Clone, Debug)]
struct TopicTimes {
    topic: String,
    has_source: bool,
    last_stamp_ns: i64,
    checked: u32,
}

impl CloudNotes {
    /// Notes in the order of their first cloud.
    pub fn all(&self) -> &[CloudNote] {
        &self.notes
    }

    /// Notes corrections of the layout of a cloud.
    pub fn on_layout(&mut self, topic: &str, notes: &[LayoutNote]) {
        for note in notes {
            self.add(topic, true, note.to_string());
        }
    }

    /// Notes the time field of the first cloud of a topic with points, and times that would fit the period of the
    /// clouds in another unit.
    pub fn on_times(&mut self, topic: &str, stamp_ns: i64, source: &TimeSource) {
        if *source == TimeSource::Nothing {
            return;
        }
        let at = match self.topics.iter().position(|known| known.topic == topic) {
            Some(at) => at,
            None if self.topics.len() >= MAX_NOTES => return,
            None => {
                self.topics.push(TopicTimes {
                    topic: topic.to_owned(),
                    has_source: false,
                    last_stamp_ns: stamp_ns,
                    checked: 0,
                });
                self.topics.len() - 1
            }
        };
        let Some(times) = self.topics.get_mut(at) else {
            return;
        };
        let is_first = !std::mem::replace(&mut times.has_source, true);
        let period_ns =
            stamp_ns.saturating_sub(std::mem::replace(&mut times.last_stamp_ns, stamp_ns));
        let is_checked = period_ns > 0 && times.checked < CHECKED_CLOUDS;
        times.checked += u32::from(is_checked);
        if is_first {
            let (is_warning, text) = text(source);
            self.add(topic, is_warning, text);
        }
        if let (
            true,
            TimeSource::Field {
                unit,
                span_ns,
                field,
                ..
            },
        ) = (is_checked, source)
            && let Some(fitting) = other_unit(*span_ns, *unit, period_ns)
        {
            let (name, unit, fitting) = (&field.name, unit.name(), fitting.name());
            let (span_s, period_s) = (*span_ns as f64 * 1e-9, period_ns as f64 * 1e-9);
            self.add(topic, true, format!(
                "times of field '{}' read as {unit} span {span_s} s, though clouds are {period_s:.3} s apart: if they are {fitting}, set `time.unit: {fitting}`",
                shown(name)
            ));
        }
    }

    fn add(&mut self, topic: &str, is_warning: bool, text: String) {
        let is_same = |note: &CloudNote| note.topic == topic && kind(&note.text).eq(kind(&text));
        if self.notes.len() >= MAX_NOTES || self.notes.iter().any(is_same) {
            return;
        }
        match is_warning {
            true => log::warn!("{topic}: {text}"),
            false => log::info!("{topic}: {text}"),
        }
        self.notes.push(CloudNote {
            topic: topic.to_owned(),
            is_warning,
            text,
        });
    }
}

/// Text without its numbers, so that those of the next cloud give no new note.
fn kind(text: &str) -> impl Iterator<Item = char> {
    text.chars().filter(|c| !c.is_ascii_digit())
}

fn shown(name: &str) -> String {
    name.chars().take(48).collect()
}

/// Text of a note, and true if it is a warning.
fn text(source: &TimeSource) -> (bool, String) {
    match source {
        TimeSource::Nothing => (false, String::new()),
        TimeSource::NoField { candidates } if candidates.is_empty() => {
            let text = "no time field: all points of a cloud are taken at its stamp";
            (false, text.to_owned())
        }
        TimeSource::NoField { candidates } => (
            true,
            format!(
                "no field is known as time, all points of a cloud are taken at its stamp: if one of {candidates} is their time, set `time.field` and `time.unit`"
            ),
        ),
        TimeSource::NotFinite { field } => (
            true,
            format!(
                "times of field '{}' are all NaN or infinite: all points of a cloud are taken at its stamp",
                shown(&field.name)
            ),
        ),
        TimeSource::Field {
            field,
            unit,
            reference,
            span_ns,
        } => {
            let (name, unit, reference) = (shown(&field.name), unit.name(), reference.name());
            let span_s = *span_ns as f64 * 1e-9;
            let text = format!(
                "time of points: field '{name}', in {unit}, {reference}; a cloud spans {span_s:.4} s"
            );
            (false, text)
        }
    }
}

/// Another unit in which the times would span most of the period of the clouds, if they span almost nothing in
/// `unit`.
fn other_unit(span_ns: i64, unit: TimeUnit, period_ns: i64) -> Option<TimeUnit> {
    let (span, period) = (span_ns as f64, period_ns as f64);
    if span <= 0.0 || span > 0.02 * period {
        return None;
    }
    let mut units = TimeUnit::ALL.into_iter().filter(|other| *other != unit);
    units.find(|other| {
        let factor = other.scale_ns() as f64 / unit.scale_ns() as f64;
        (0.3..=1.2).contains(&(span * factor / period))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::cloud::{PointField, TimeReference};

    const MS: i64 = 1_000_000;

    #[test]
    fn each_kind_of_note_is_said_once_a_topic() {
        let mut notes = CloudNotes::default();
        for step in 0..5 {
            for topic in ["left", "right"] {
                let changed = [LayoutNote::RowStep {
                    row_step: step,
                    used: 16 * step,
                }];
                notes.on_layout(topic, &changed);
                let candidates = "curvature".to_owned();
                notes.on_times(topic, 0, &TimeSource::NoField { candidates });
            }
        }
        let said: Vec<_> = notes
            .all()
            .iter()
            .map(|note| (&*note.topic, note.is_warning))
            .collect();
        assert_eq!(
            said,
            [
                ("left", true),
                ("left", true),
                ("right", true),
                ("right", true)
            ]
        );
        assert!(
            notes.all()[1]
                .text
                .contains("if one of curvature is their time")
        );
    }

    #[test]
    fn times_in_another_unit_are_noticed_by_the_time_between_clouds() {
        let field = PointField {
            name: "t".into(),
            offset: 12,
            datatype: 6,
            count: 1,
        };
        let warnings = |span_ns| {
            let mut notes = CloudNotes::default();
            for i in 0..4 {
                let source = TimeSource::Field {
                    field: &field,
                    unit: TimeUnit::Nanoseconds,
                    reference: TimeReference::StampStart,
                    span_ns,
                };
                notes.on_times("points", i * 100 * MS, &source);
            }
            let texts = notes.all().iter().filter(|note| note.is_warning);
            texts.map(|note| note.text.clone()).collect::<Vec<_>>()
        };
        assert!(warnings(99 * MS).is_empty(), "a sweep in nanoseconds");
        assert!(warnings(20_000).is_empty(), "a flash, in no unit a sweep");
        let micros = warnings(99_000);
        assert_eq!(micros.len(), 1);
        assert!(micros[0].contains("set `time.unit: us`"), "{micros:?}");
        assert!(warnings(99)[0].contains("set `time.unit: ms`"));
    }
}
