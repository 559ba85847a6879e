//! Numbers of samples that are no gaps: those before a subscriber joined, and those of a publisher that begins anew.

use std::sync::mpsc::Receiver;

use lattice_msgs::std_msgs::String as RosString;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Subscription, SubscriptionExecutor};
use lattice_test::domain::TestDomain;

use super::*;

/// Messages before the late subscriber, and after it.
const MESSAGES: usize = 300;

/// The numbers from the first received to the last one, each once, and none counted as lost.
fn assert_all_from_first(
    (subscription, heard): &(Subscription, Receiver<Arc<RosString>>),
    last: usize,
) -> usize {
    let number = |message: Arc<RosString>| message.data.parse::<usize>().unwrap();
    let first = number(heard.recv_timeout(PATIENCE).unwrap());
    for expected in first + 1..=last {
        assert_eq!(number(heard.recv_timeout(PATIENCE).unwrap()), expected);
    }
    let lost = (subscription.lost_on_network(), subscription.overrun());
    assert_eq!(lost, (0, 0), "{first} to {last}");
    last - first + 1
}

#[test]
fn a_late_subscriber_and_a_publisher_that_begins_anew_lose_nothing() {
    for qos in [Qos::reliable(2 * MESSAGES), Qos::best_effort(2 * MESSAGES)] {
        let domain = TestDomain::take();
        let start = |name| {
            let process = runtime(&domain, name, &[]);
            let node = process.node(name).unwrap();
            (process, node)
        };
        let (_first, first) = start("early");
        let early = hear::<RosString>(&first, "/numbers", qos, SubscriptionExecutor::Shared);
        let (_second, second) = start("late");
        let mut late: Option<(Subscription, _)> = None;
        let until = |reached: &dyn Fn() -> bool| {
            while !reached() {
                std::thread::sleep(Duration::from_millis(1));
            }
        };
        let mut received = [0; 2];
        for life in 1..=2 {
            let (sends, node) = start("sends");
            let publisher = node.publisher::<RosString>("/numbers", qos).unwrap();
            let send = |numbers: std::ops::Range<usize>| {
                for number in numbers {
                    publisher.publish(text(number)).unwrap();
                }
                assert!(publisher.flush(PATIENCE));
            };
            // What is sent before both sides know each other is for nobody.
            let known = |count: usize, of: &Subscription| {
                until(&|| publisher.subscriber_count() == count && of.publisher_count() == 1);
            };
            known(life, &early.0);
            if let Some(late) = &late {
                known(life, &late.0);
            }
            send(0..MESSAGES);
            let late = late.get_or_insert_with(|| {
                let late =
                    hear::<RosString>(&second, "/numbers", qos, SubscriptionExecutor::Shared);
                known(2, &late.0);
                late
            });
            send(MESSAGES..2 * MESSAGES);
            let last = 2 * MESSAGES - 1;
            assert_eq!(assert_all_from_first(&early, last), 2 * MESSAGES);
            let of_late = assert_all_from_first(late, last);
            assert_eq!(of_late, [MESSAGES, 2 * MESSAGES][life - 1]);
            received[0] += 2 * MESSAGES as u64;
            received[1] += of_late as u64;
            // Both sides have the same numbers.
            assert_eq!(publisher.sent(), 2 * MESSAGES as u64);
            assert_eq!(publisher.dropped(), 0);
            assert_eq!([early.0.received(), late.0.received()], received);
            drop((publisher, node, sends));
            until(&|| early.0.publisher_count() == 0 && late.0.publisher_count() == 0);
        }
    }
}
