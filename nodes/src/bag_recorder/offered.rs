//! QoS of a recorded topic: compatible with all its publishers, and as recorded in a bag.

use lattice_bag::BagQos;
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::{RemotePublisher, SubscriptionExecutor};

/// Queue depths in DDS: bursts of small messages, and a bounded number of 4 MB clouds.
const SMALL_DEPTH: usize = 500;
const LARGE_DEPTH: usize = 50;

/// Recorded depth of publishers; the samples of a latched one arrive together at a late joiner.
const DEPTH: u64 = 100;
const LATCHED_DEPTH: u64 = 500;

/// QoS of a subscription that matches all these publishers: reliable if all are, latched if all are.
pub(super) fn subscription(publishers: &[&RemotePublisher], executor: SubscriptionExecutor) -> Qos {
    let reliable = |p: &&RemotePublisher| p.reliability == Reliability::Reliable;
    let latched = |p: &&RemotePublisher| p.durability == Durability::TransientLocal;
    Qos {
        reliability: match publishers.iter().all(reliable) {
            true => Reliability::Reliable,
            false => Reliability::BestEffort,
        },
        durability: match publishers.iter().all(latched) {
            true => Durability::TransientLocal,
            false => Durability::Volatile,
        },
        depth: match executor {
            SubscriptionExecutor::Shared => SMALL_DEPTH,
            SubscriptionExecutor::Dedicated => LARGE_DEPTH,
        },
        kept: None,
    }
}

/// QoS of a publisher as recorded in a bag. Discovery does not give the depth: a player needs a sufficient one.
pub(super) fn noted(publisher: &RemotePublisher) -> BagQos {
    let latched = publisher.durability == Durability::TransientLocal;
    BagQos {
        reliable: publisher.reliability == Reliability::Reliable,
        latched,
        depth: if latched { LATCHED_DEPTH } else { DEPTH },
        ..BagQos::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weakest_publisher_decides() {
        let publisher = |qos: Qos| RemotePublisher {
            topic: "/a".into(),
            type_name: "a/msg/B".into(),
            type_hash: None,
            reliability: qos.reliability,
            durability: qos.durability,
        };
        let [latched, reliable, sensor] = [Qos::LATCHED, Qos::DEFAULT, Qos::SENSOR].map(publisher);
        let heard = |publishers: &[&RemotePublisher]| {
            let qos = subscription(publishers, SubscriptionExecutor::Shared);
            (qos.reliability, qos.durability)
        };
        type R = Reliability;
        type D = Durability;
        assert_eq!(heard(&[&latched]), (R::Reliable, D::TransientLocal));
        assert_eq!(heard(&[&latched, &reliable]), (R::Reliable, D::Volatile));
        assert_eq!(heard(&[&latched, &sensor]), (R::BestEffort, D::Volatile));
        assert!(noted(&latched).latched && !noted(&sensor).reliable);
    }
}
