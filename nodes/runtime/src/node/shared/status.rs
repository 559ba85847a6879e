//! Diagnostics of the runtime: buffers, drops, incompatible peers.

use std::sync::atomic::Ordering::Relaxed;

use lattice_msgs::diagnostic_msgs::DiagnosticStatus;

use super::Shared;
use crate::communication::subscription::Stats;
use crate::node::diagnostics::{Level, status};
use crate::sync::lock;
use crate::transport::port::ReaderLosses;

const QOS: &str = "QoS does not match";

/// Limit of stored losses.
pub(super) const MAX_LOSSES: usize = 1000;

/// A problem between this process and another.
struct TransportProblem {
    /// Topic or service, and the kind of problem.
    of: String,
    count: u64,
    /// Text without the topic.
    problem: &'static str,
}

impl TransportProblem {
    /// `None` if the count is zero.
    fn of(topic: &str, what: &str, count: u64, problem: &'static str) -> Option<Self> {
        (count > 0).then(|| Self {
            of: format!("{topic} {what}"),
            count,
            problem,
        })
    }
}

/// Lost and undecodable messages of a subscription.
fn not_had(topic: &str, stats: &Stats) -> Vec<TransportProblem> {
    let ReaderLosses {
        on_network,
        overrun,
    } = &stats.losses;
    let counts = [
        ("undecodable", &stats.undecodable, "undecodable samples"),
        ("lost_on_network", on_network, "messages lost"),
        ("overrun", overrun, "messages lost"),
    ];
    let troubles = counts.map(|(what, count, problem)| {
        TransportProblem::of(topic, what, count.load(Relaxed), problem)
    });
    troubles.into_iter().flatten().collect()
}

impl Shared {
    /// State of the transport of this process, as a task of `node`.
    pub(crate) fn transport_status(&self, node: &str) -> DiagnosticStatus {
        let bytes = self.receive_buffer.bytes;
        let bytes = bytes.map_or_else(|| "unknown".to_owned(), |bytes| bytes.to_string());
        let mut values = vec![
            ("socket_receive_buffer_bytes".to_owned(), bytes),
            (
                "participants_kept_out".to_owned(),
                self.unauthenticated_participants().to_string(),
            ),
        ];
        let mut problems = Vec::new();
        if self.receive_buffer.is_short() {
            problems.push("receive buffer short, raise net.core.rmem_max");
        }
        let troubles = self.troubles();
        self.note_losses(&troubles);
        for trouble in troubles {
            if !problems.contains(&trouble.problem) {
                problems.push(trouble.problem);
            }
            values.push((trouble.of, trouble.count.to_string()));
        }
        let (level, message) = match problems.is_empty() {
            true => (Level::Ok, "running".to_owned()),
            false => (Level::Warn, problems.join("; ")),
        };
        status(node, "transport", level, message, values)
    }

    /// Messages and requests lost so far, by topic; for ended publishers and servers as of the last status.
    pub(crate) fn losses(&self) -> Vec<(String, u64)> {
        self.note_losses(&self.troubles());
        for (topic, stats) in self.subscribed() {
            self.note_losses(&not_had(&topic, &stats));
        }
        lock(&self.losses).clone().into_iter().collect()
    }

    fn note_losses(&self, troubles: &[TransportProblem]) {
        let mut losses = lock(&self.losses);
        for trouble in troubles.iter().filter(|trouble| trouble.problem != QOS) {
            if losses.len() < MAX_LOSSES || losses.contains_key(&trouble.of) {
                let most = losses.entry(trouble.of.clone()).or_default();
                *most = trouble.count.max(*most);
            }
        }
    }

    /// All losses and incompatibilities, with their counts.
    fn troubles(&self) -> Vec<TransportProblem> {
        let mut troubles = Vec::new();
        for publisher in self.publishers() {
            let topic = publisher.peers.topic();
            let dropped = publisher.writer.dropped();
            troubles.extend(TransportProblem::of(
                topic,
                "dropped",
                dropped,
                "messages dropped",
            ));
            let incompatible = publisher.peers.incompatible_count() as u64;
            troubles.extend(TransportProblem::of(
                topic,
                "incompatible_subscribers",
                incompatible,
                QOS,
            ));
        }
        for intake in self.intakes() {
            let topic = &intake.topic;
            troubles.extend(not_had(topic, &intake.stats));
            let incompatible = intake.peers.incompatible_count() as u64;
            troubles.extend(TransportProblem::of(
                topic,
                "incompatible_publishers",
                incompatible,
                QOS,
            ));
        }
        const REQUESTS: &str = "requests not answered";
        for of in self.unanswered() {
            let (lost, failed) = (of.lost.load(Relaxed), of.failed.load(Relaxed));
            troubles.extend(TransportProblem::of(
                &of.name,
                "requests_lost",
                lost,
                REQUESTS,
            ));
            troubles.extend(TransportProblem::of(
                &of.name,
                "requests_failed",
                failed,
                REQUESTS,
            ));
        }
        troubles
    }
}
