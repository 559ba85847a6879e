//! The end of a runtime.

use super::*;

#[test]
fn shutdown_stops_timers_sends_what_is_queued_and_leaves_at_once() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let publisher = from.publisher::<RosString>("last", Qos::DEFAULT).unwrap();
    let (subscription, heard) = hear::<RosString>(&to, "last", Qos::DEFAULT, Load::Large);
    wait_for_subscriber!(publisher);
    let (ticks, ticked) = channel();
    a.timer(Duration::from_millis(1), move || {
        let _ = ticks.send(());
    });
    ticked.recv_timeout(PATIENCE).unwrap();
    for i in 0..20 {
        publisher.publish(text(&i.to_string())).unwrap();
    }
    let shutdown = a.shutdown_handle();
    assert!(!shutdown.is_requested());
    std::thread::spawn(move || shutdown.request());
    a.spin().unwrap();
    while ticked.recv_timeout(PATIENCE).is_ok() {}
    for i in 0..20 {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, i.to_string());
    }
    wait_until(&b, move || subscription.publisher_count() == 0);
    assert!(matches!(
        publisher.publish(text("late")),
        Ok(()) | Err(PublishError::Closed { .. })
    ));
    let late = from.publisher::<RosString>("late", Qos::DEFAULT);
    assert!(matches!(late, Err(RuntimeError::Closed { .. })));
}

#[test]
fn the_last_messages_of_the_process_reach_their_handlers() {
    let domain = TestDomain::take();
    for load in [Load::Small, Load::Large] {
        let runtime = runtime(&domain, "a");
        let node = runtime.node("a").unwrap();
        let publisher = node.publisher::<RosString>("last", Qos::DEFAULT).unwrap();
        let (shutdown, (sender, heard)) = (runtime.shutdown_handle(), channel());
        let _subscription = node
            .subscribe::<RosString>("last", Qos::DEFAULT, load, move |message| {
                // The end begins while all but the first wait.
                shutdown.wait();
                let _ = sender.send(message);
            })
            .unwrap();
        for i in 0..100 {
            publisher.publish(text(&i.to_string())).unwrap();
        }
        runtime.shutdown_handle().request();
        runtime.spin().unwrap();
        assert_eq!(heard.try_iter().count(), 100, "{load:?}");
    }
}

#[test]
fn a_handler_that_panics_ends_the_process_in_good_order() {
    let domain = TestDomain::take();
    for load in [Load::Small, Load::Large] {
        let runtime = runtime(&domain, "a");
        let node = runtime.node("a").unwrap();
        let publisher = node.publisher::<RosString>("bomb", Qos::DEFAULT).unwrap();
        let _subscription = node
            .subscribe::<RosString>("bomb", Qos::DEFAULT, load, |_| panic!("on purpose"))
            .unwrap();
        publisher.publish(text("tick")).unwrap();
        assert!(matches!(runtime.spin(), Err(RuntimeError::Panicked { .. })));
    }
}
