//! Waiting until discovery knows every writer made so far.
//!
//! RustDDS matches a new writer with the readers of its own participant that are there when discovery
//! takes the writer up. Nothing is delivered between the two, so a reliable reader never acknowledges:
//! the writer stalls as soon as its send window is full. A reader that comes later is not matched with
//! the writer. So readers wait here. The probe is a reader that is always there, and a writer made
//! for the wait: discovery takes writers up in turn, and their match is the sign.

use std::sync::Arc;
use std::time::Duration;

use smol::Timer;

use super::events::Endpoints;
use super::participant::Dds;
use super::reader::DdsReader;
use super::writer::RawWriter;
use crate::error::RuntimeError;
use crate::peers::Peers;
use crate::qos::Qos;
use rustdds::RTPSEntity;

/// Longest wait: discovery takes a writer up within milliseconds.
const PATIENCE: Duration = Duration::from_secs(2);

const TYPE: &str = "std_msgs/msg/Empty";
const QOS: Qos = Qos::best_effort(1);

/// The lasting half of the probe. Its topic has no ROS prefix, so ROS tools do not show it.
pub(crate) struct Barrier {
    topic: String,
    _reader: DdsReader,
}

/// A wait that has begun.
pub(crate) struct Wait {
    writer: RawWriter,
    peers: Arc<Peers>,
    endpoints: Arc<Endpoints>,
}

impl Barrier {
    pub(crate) fn new(dds: &Dds) -> Result<Self, RuntimeError> {
        let guid = dds.participant().guid().to_bytes();
        let name: String = guid.iter().map(|byte| format!("{byte:02x}")).collect();
        let topic = format!("lattice_probe_{name}");
        let reader = dds.reader(&topic, topic.clone(), TYPE, &QOS)?;
        Ok(Self {
            topic,
            _reader: DdsReader::new(reader, 0),
        })
    }

    /// Begins to wait for the writers made before this call.
    pub(crate) fn begin(
        &self,
        dds: &Dds,
        endpoints: &Arc<Endpoints>,
    ) -> Result<Wait, RuntimeError> {
        let writer = dds.writer(&self.topic, self.topic.clone(), TYPE, &QOS)?;
        Ok(Wait {
            writer,
            peers: Arc::new(Peers::of_probe(&self.topic)),
            endpoints: Arc::clone(endpoints),
        })
    }
}

impl Wait {
    /// Completes when discovery knows them, or after two seconds.
    pub(crate) async fn end(self) {
        self.endpoints.register(self.writer.guid(), &self.peers);
        let known = async {
            self.peers.known(|_| true).await;
            true
        };
        let too_long = async {
            Timer::after(PATIENCE).await;
            false
        };
        if !smol::future::or(known, too_long).await {
            log::warn!("discovery is slow: a subscription may hear its own process over DDS");
        }
    }
}
