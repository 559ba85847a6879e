//! Several endpoints of one topic, in one process and outside, now and later.

use super::*;

#[test]
fn one_process_shares_the_message_itself() {
    let domain = TestDomain::take();
    let runtime = runtime(&domain, "a");
    let (from, to) = (runtime.node("a").unwrap(), runtime.node("b").unwrap());
    let publisher = from
        .publisher::<PointCloud2>("points", Qos::SENSOR)
        .unwrap();
    let (_subscription, heard) = hear::<PointCloud2>(&to, "/points", Qos::SENSOR, Load::Large);
    assert_eq!(publisher.subscriber_count(), 1);
    let message = Arc::new(cloud(1600));
    publisher.publish(Arc::clone(&message)).unwrap();
    assert!(Arc::ptr_eq(
        &heard.recv_timeout(PATIENCE).unwrap(),
        &message
    ));
    assert_eq!(publisher.sent(), 0, "nobody outside listens");
    let refused = to.publisher::<RosString>("points", Qos::DEFAULT);
    assert!(matches!(refused, Err(RuntimeError::TypeMismatch { .. })));
}

#[test]
fn a_subscriber_in_the_process_does_not_hold_up_those_outside() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let qos = Qos::reliable(5);
    for (topic, load, subscribe_first) in [
        ("first_small", Load::Small, true),
        ("first_large", Load::Large, true),
        ("second_small", Load::Small, false),
        ("second_large", Load::Large, false),
    ] {
        let before = subscribe_first.then(|| hear::<RosString>(&from, topic, qos, load));
        let publisher = from.publisher::<RosString>(topic, qos).unwrap();
        let (_here, heard_here) =
            before.unwrap_or_else(|| hear::<RosString>(&from, topic, qos, load));
        let (there, heard_there) = hear::<RosString>(&to, topic, Qos::reliable(100), load);
        let counted = publisher.clone();
        wait_until(&a, move || counted.subscriber_count() == 2);
        for i in 0..100 {
            publisher.publish(text(&i.to_string())).unwrap();
        }
        assert!(publisher.flush(PATIENCE), "{topic}");
        for i in 0..100 {
            for heard in [&heard_here, &heard_there] {
                let message = heard.recv_timeout(PATIENCE).unwrap();
                assert_eq!(message.data, i.to_string(), "{topic}");
            }
        }
        assert_eq!((publisher.dropped(), there.lost()), (0, 0), "{topic}");
        assert_eq!(publisher.subscriber_count(), 2, "{topic}");
    }
}

#[test]
fn a_subscription_hears_this_process_and_others() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let (here, heard) = hear::<RosString>(&to, "chatter", Qos::DEFAULT, Load::Small);
    let inside = to.publisher::<RosString>("chatter", Qos::DEFAULT).unwrap();
    let outside = from
        .publisher::<RosString>("chatter", Qos::DEFAULT)
        .unwrap();
    wait_until(&b, move || here.publisher_count() == 2);
    wait_for_subscriber!(outside);
    for publisher in [inside, outside] {
        publisher.publish(text("once")).unwrap();
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "once");
    }
}

#[test]
fn a_late_joiner_hears_what_was_latched() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let from = a.node("a").unwrap();
    let publisher = from.publisher::<RosString>("origin", Qos::LATCHED).unwrap();
    publisher.publish(text("here")).unwrap();
    assert!(publisher.flush(PATIENCE));
    assert_eq!(publisher.sent(), 0, "serialised for nobody");
    for (runtime, name) in [(&a, "same_process"), (&b, "b")] {
        let node = runtime.node(name).unwrap();
        let (_subscription, heard) = hear::<RosString>(&node, "origin", Qos::LATCHED, Load::Small);
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "here", "{name}");
    }
}

#[test]
fn a_second_subscription_hears_only_what_comes_after_it() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let publisher = from
        .publisher::<RosString>("chatter", Qos::DEFAULT)
        .unwrap();
    let (_first, heard_first) = hear::<RosString>(&to, "chatter", Qos::DEFAULT, Load::Small);
    wait_for_subscriber!(publisher);
    publisher.publish(text("before")).unwrap();
    assert_eq!(heard_first.recv_timeout(PATIENCE).unwrap().data, "before");
    let (_second, heard_second) = hear::<RosString>(&to, "chatter", Qos::DEFAULT, Load::Small);
    let counted = publisher.clone();
    wait_until(&a, move || counted.subscriber_count() == 2);
    publisher.publish(text("after")).unwrap();
    for heard in [heard_first, heard_second] {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, "after");
    }
}

#[test]
fn static_transforms_go_in_one_message() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let broadcaster = StaticTfBroadcaster::new(&a.node("a").unwrap()).unwrap();
    for (child, x) in [("laser", 1.0), ("ins", 2.0), ("laser", 3.0)] {
        let mut transform = TransformStamped {
            child_frame_id: child.to_owned(),
            ..TransformStamped::default()
        };
        transform.transform.translation.x = x;
        broadcaster.send([transform]).unwrap();
    }
    let node = b.node("b").unwrap();
    let qos = Qos::TF_STATIC_LISTENER;
    let (_subscription, heard) = hear::<TFMessage>(&node, "/tf_static", qos, Load::Small);
    let frames = loop {
        let message = heard.recv_timeout(PATIENCE).unwrap();
        let frame = |t: &TransformStamped| (t.child_frame_id.clone(), t.transform.translation.x);
        let frames: Vec<_> = message.transforms.iter().map(frame).collect();
        if frames.iter().any(|(_, x)| *x == 3.0) {
            break frames;
        }
    };
    assert_eq!(frames, [("ins".to_owned(), 2.0), ("laser".to_owned(), 3.0)]);
}
