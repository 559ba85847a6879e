//! Many participants on loopback without multicast find each other.

use std::sync::mpsc::channel;
use std::time::Instant;

use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::Load;
use lattice_runtime::env::TransportKind;
use lattice_test::domain::TestDomain;

use super::{Echo, PATIENCE, QOS, runtime};

/// RustDDS looks for the first twelve only.
fn size(kind: TransportKind) -> usize {
    match kind {
        TransportKind::RustDds => 10,
        TransportKind::Cyclone => 40,
    }
}

#[test]
#[ignore = "starts forty processes, which starve the tests beside it"]
fn a_crowd_of_participants_hears_the_last_one() {
    for transport in TransportKind::BUILT_IN {
        let (domain, start) = (TestDomain::take(), Instant::now());
        let crowd = size(transport.1) - 1;
        let _echoes: Vec<_> = (0..crowd)
            .map(|_| Echo::start(&domain, *transport))
            .collect();
        let last = runtime(&domain, *transport, "last");
        let node = last.node("last").unwrap();
        let publisher = node.publisher("/heard", QOS).unwrap();
        let (sender, heard) = channel();
        let handler = move |_: std::sync::Arc<RosString>| {
            let _ = sender.send(());
        };
        let _out = node.subscribe("/said", QOS, Load::Small, handler).unwrap();
        let (sender, joined) = channel();
        publisher.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        while publisher.subscriber_count() < crowd {
            joined.recv_timeout(PATIENCE).unwrap();
        }
        publisher.publish(RosString::default()).unwrap();
        for _ in 0..crowd {
            heard.recv_timeout(PATIENCE).unwrap();
        }
        println!("{}: {} in {:?}", transport.0, crowd + 1, start.elapsed());
    }
}
