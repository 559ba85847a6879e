//! Rejected messages by topic and reason, with a text for the operator.

use serde::{Deserialize, Serialize};

/// Limit of distinct pairs of topic and reason.
const MAX_REFUSALS: usize = 64;

/// Messages of a topic rejected for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// Topic of the messages.
    pub topic: String,
    /// Counter of the reason, such as `clouds_no_mount`.
    pub reason: String,
    /// Number of rejected messages.
    pub count: u64,
    /// Value, limit and remedy of the last described message.
    pub text: String,
}

/// Rejections since the start.
#[derive(Clone, Debug, Default)]
pub struct Refusals(Vec<Refusal>);

impl Refusals {
    /// Counts a rejected message. The first, hundredth, ten thousandth and so on of a topic and a
    /// reason is logged as a warning.
    pub fn add(&mut self, topic: &str, reason: &'static str, text: impl FnOnce() -> String) {
        let known = |refusal: &&mut Refusal| refusal.topic == topic && refusal.reason == reason;
        let Some(refusal) = self.0.iter_mut().find(known) else {
            let text = text();
            log::warn!("{topic}: {text}");
            if self.0.len() < MAX_REFUSALS {
                self.0.push(Refusal {
                    topic: topic.to_owned(),
                    reason: reason.to_owned(),
                    count: 1,
                    text,
                });
            }
            return;
        };
        refusal.count += 1;
        if is_power_of_hundred(refusal.count) {
            refusal.text = text();
            log::warn!("{topic}: {} ({} so far)", refusal.text, refusal.count);
        }
    }

    /// All rejections, in the order of their first message.
    pub fn all(&self) -> &[Refusal] {
        &self.0
    }

    /// Most frequent rejection whose reason has this prefix.
    pub fn most_frequent(&self, reason: &str) -> Option<&Refusal> {
        most_frequent(&self.0, reason)
    }
}

/// Most frequent rejection whose reason has this prefix.
pub fn most_frequent<'a>(refusals: &'a [Refusal], reason: &str) -> Option<&'a Refusal> {
    let mut of_kind = refusals.iter().filter(|r| r.reason.starts_with(reason));
    let first = of_kind.next()?;
    Some(
        of_kind.fold(first, |most, next| match next.count > most.count {
            true => next,
            false => most,
        }),
    )
}

fn is_power_of_hundred(mut count: u64) -> bool {
    while count > 1 && count.is_multiple_of(100) {
        count /= 100;
    }
    count == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_counted_by_topic_and_reason_and_bounded() {
        let mut refusals = Refusals::default();
        for i in 0..300 {
            refusals.add("odom", "poses_invalid", || format!("number {i}"));
            refusals.add("points", "clouds_malformed", || format!("number {i}"));
        }
        refusals.add("points", "clouds_no_mount", || "no mount".into());
        let all = refusals.all();
        assert_eq!(all.len(), 3);
        assert_eq!((all[0].count, &*all[0].text), (300, "number 99"));
        let clouds = refusals.most_frequent("clouds_").unwrap();
        assert_eq!(clouds.reason, "clouds_malformed");
        for i in 0..2 * MAX_REFUSALS {
            refusals.add(&format!("topic{i}"), "poses_invalid", String::new);
        }
        assert_eq!(refusals.all().len(), MAX_REFUSALS);
    }
}
