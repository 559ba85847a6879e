//! The runtime's own diagnostics: buffers, drops, peers that do not match.

use lattice_msgs::diagnostic_msgs::DiagnosticStatus;

use super::Shared;
use crate::dds::effective_receive_buffer;
use crate::diagnostics::{Level, status};

/// Below this, bursts of large messages are lost; twice the largest message is needed.
const ENOUGH_BYTES: usize = 16 << 20;

/// Receive buffer that the kernel grants a socket, asked once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReceiveBuffer {
    bytes: Option<usize>,
}

impl ReceiveBuffer {
    pub(crate) fn probe() -> Self {
        Self {
            bytes: effective_receive_buffer(),
        }
    }

    fn is_short(self) -> bool {
        self.bytes.is_some_and(|bytes| bytes < ENOUGH_BYTES)
    }

    /// Logs the command that mends a short buffer.
    pub(crate) fn warn_if_short(self) {
        if let Some(bytes) = self.bytes.filter(|_| self.is_short()) {
            log::warn!(
                "sockets get a receive buffer of {bytes} bytes; clouds above {} bytes may be lost. \
                 Run: sudo sysctl -w net.core.rmem_max={ENOUGH_BYTES}",
                bytes / 2,
            );
        }
    }
}

impl Shared {
    /// State of the transport of this process, as a task of `node`.
    pub(crate) fn transport_status(&self, node: &str) -> DiagnosticStatus {
        let mut values = vec![(
            "socket_receive_buffer_bytes".to_owned(),
            self.receive_buffer
                .bytes
                .map_or_else(|| "unknown".to_owned(), |bytes| bytes.to_string()),
        )];
        let mut problems = Vec::new();
        if self.receive_buffer.is_short() {
            problems.push("receive buffer short, raise net.core.rmem_max");
        }
        let mut add = |what: &'static str, problem: &'static str, topic: &str, count: u64| {
            if count > 0 {
                values.push((format!("{topic} {what}"), count.to_string()));
                if !problems.contains(&problem) {
                    problems.push(problem);
                }
            }
        };
        for publisher in self.publishers() {
            let topic = publisher.peers.topic();
            add(
                "dropped",
                "messages dropped",
                topic,
                publisher.writer.dropped(),
            );
            let incompatible = publisher.peers.incompatible_count();
            add(
                "incompatible_subscribers",
                "QoS does not match",
                topic,
                incompatible as u64,
            );
        }
        for intake in self.intakes() {
            let subscription = &intake.stats;
            let topic = subscription.peers().topic();
            add(
                "undecodable",
                "undecodable samples",
                topic,
                subscription.undecodable(),
            );
            add("lost", "messages lost", topic, subscription.lost());
            let incompatible = subscription.peers().incompatible_count();
            add(
                "incompatible_publishers",
                "QoS does not match",
                topic,
                incompatible as u64,
            );
        }
        let (level, message) = if problems.is_empty() {
            (Level::Ok, "running".to_owned())
        } else {
            (Level::Warn, problems.join("; "))
        };
        status(node, "transport", level, message, values)
    }
}
