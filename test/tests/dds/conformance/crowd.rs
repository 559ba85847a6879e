//! Many participants on loopback without multicast find each other.

use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::SubscriptionExecutor;
use lattice_runtime::env::TransportKind;
use lattice_test::domain::TestDomain;

use super::{Echo, PATIENCE, QOS, runtime};

/// Quiet time after which another word is said.
const BETWEEN_WORDS: Duration = Duration::from_secs(1);
/// Words until the crowd is given up.
const MOST_WORDS: usize = 60;

/// Participants, the last one included.
const SIZE: usize = 40;

#[test]
#[ignore = "starts forty processes, which starve the tests beside it"]
fn a_crowd_of_participants_hears_the_last_one() {
    for transport in TransportKind::BUILT_IN {
        let (domain, start) = (TestDomain::take(), Instant::now());
        let crowd = SIZE - 1;
        let _echoes: Vec<_> = (0..crowd)
            .map(|_| Echo::start(&domain, *transport))
            .collect();
        let last = runtime(&domain, *transport, "last");
        let node = last.node("last").unwrap();
        let publisher = node.publisher("/heard", QOS).unwrap();
        let (sender, heard) = channel();
        let handler = move |message: std::sync::Arc<RosString>| {
            let _ = sender.send(message.data.clone());
        };
        let _out = node
            .subscribe("/said", QOS, SubscriptionExecutor::Shared, handler)
            .unwrap();
        let (sender, joined) = channel();
        publisher.on_subscriber_joined(move || {
            let _ = sender.send(());
        });
        while publisher.subscriber_count() < crowd {
            joined.recv_timeout(PATIENCE).unwrap();
        }
        // An echo may answer before it knows our reader: a word after the other, until all say one again.
        let all_say = |word: &String| {
            let data = word.clone();
            publisher.publish(RosString { data }).unwrap();
            let answers = std::iter::from_fn(|| heard.recv_timeout(BETWEEN_WORDS).ok());
            answers.filter(|answer| answer == word).take(crowd).count() == crowd
        };
        let all = (0..MOST_WORDS).any(|number| all_say(&number.to_string()));
        assert!(all, "{}: not all of {crowd} answer", transport.0);
        println!("{}: {} in {:?}", transport.0, crowd + 1, start.elapsed());
    }
}
