//! Status of a mapper with an empty map.

use std::time::Instant;

use super::counts::MapperCounts;

/// Time and cause of an empty map.
pub(super) struct Unmapped {
    since: Instant,
    /// Topic of the clouds.
    topic: String,
    /// Reason for the last rejected cloud.
    pub last_refusal: Option<String>,
}

impl Unmapped {
    /// Begins now.
    pub fn new(topic: String) -> Self {
        Self {
            since: Instant::now(),
            topic,
            last_refusal: None,
        }
    }

    /// Status in one line.
    pub fn message(&self, counts: &MapperCounts) -> String {
        let seconds = self.since.elapsed().as_secs();
        format!(
            "no cloud mapped since the start {seconds} s ago: {}",
            self.cause(counts)
        )
    }

    fn cause(&self, counts: &MapperCounts) -> String {
        let (topic, clouds) = (&self.topic, counts.clouds_in);
        match &self.last_refusal {
            _ if clouds == 0 => {
                format!("none received on {topic}; see /diagnostics of enu_transformer")
            }
            Some(refusal) => {
                format!("{clouds} clouds received on {topic}, the last rejected: {refusal}")
            }
            None => format!(
                "{clouds} clouds on {topic} have {} points, {} of them not finite, {} out of the range of the \
                 lattice",
                counts.points_in, counts.points_not_finite, counts.points_out_of_range
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cause_is_that_of_the_clouds() {
        let mut unmapped = Unmapped::new("/points_enu".to_owned());
        let mut counts = MapperCounts::default();
        let begin = "no cloud mapped since the start 0 s ago: ";
        let says = |unmapped: &Unmapped, counts: &MapperCounts| {
            let message = unmapped.message(counts);
            message.strip_prefix(begin).unwrap().to_owned()
        };
        let none = says(&unmapped, &counts);
        assert!(none.starts_with("none received on /points_enu"), "{none}");
        counts.clouds_in = 2;
        counts.points_in = 7;
        counts.points_not_finite = 7;
        let empty = says(&unmapped, &counts);
        assert!(empty.contains("7 points, 7 of them not finite"), "{empty}");
        unmapped.last_refusal = Some("cloud in frame 'velodyne'".to_owned());
        let refused = says(&unmapped, &counts);
        assert!(
            refused.ends_with("rejected: cloud in frame 'velodyne'"),
            "{refused}"
        );
    }
}
