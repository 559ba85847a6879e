//! Quality of service of a recorded topic: what all its publishers can give, and how a bag notes theirs.

use lattice_bag::BagQos;
use lattice_runtime::qos::{Durability, Qos, Reliability};
use lattice_runtime::{RemotePublisher, SubscriptionExecutor};

/// Samples that wait in DDS: a burst of small ones, and not too much of 4 MB clouds.
const SMALL_DEPTH: usize = 500;
const LARGE_DEPTH: usize = 50;

/// Depths that are noted of publishers; the samples of a latched one come all at once to one who joins late.
const DEPTH: u64 = 100;
const LATCHED_DEPTH: u64 = 500;

/// The QoS of a subscription that hears all these publishers: reliable if all are, latched if all are.
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

/// The QoS of a publisher as a bag notes it. Discovery does not tell the depth: a player needs enough.
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
