//! Messages as bytes: sent raw, refused, decoded later.

use super::*;

#[test]
fn raw_messages_arrive_as_they_are() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let qos = Qos::reliable(100);
    let publisher = from
        .raw_publisher("/chatter", RosString::TYPE, qos)
        .unwrap();
    let (_there, heard) = hear::<RosString>(&to, "chatter", qos, Load::Small);
    wait_for_subscriber!(publisher);
    for i in 0..100 {
        let bytes = cdr::to_vec(&text(&i.to_string())).unwrap();
        publisher.publish_blocking(bytes).unwrap();
    }
    assert!(publisher.flush(PATIENCE));
    for i in 0..100 {
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, i.to_string());
    }
    for bad in [
        vec![],
        vec![0, 1, 0],
        vec![0, 0, 0, 0, 1],
        vec![0, 7, 0, 0, 1],
    ] {
        let refused = publisher.publish_blocking(bad);
        assert!(matches!(
            refused,
            Err(PublishError::NotLittleEndianCdr { .. })
        ));
    }
    let refused = from.raw_publisher("/x", "std_msgs/String/x/y", qos);
    assert!(matches!(refused, Err(RuntimeError::TypeName { .. })));
}

#[test]
fn undecodable_and_long_samples_are_counted_and_the_next_arrives() {
    let domain = TestDomain::take();
    let a = runtime(&domain, "a");
    let b = with_args(&domain, "b", &["-p", "max_message_bytes:=1000"]);
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    for (topic, qos, load) in [
        ("reliable", Qos::DEFAULT, Load::Small),
        ("best_effort", Qos::INS, Load::Large),
    ] {
        let publisher = from
            .raw_publisher(&format!("/{topic}"), RosString::TYPE, qos)
            .unwrap();
        let (subscription, heard) = hear::<RosString>(&to, topic, qos, load);
        wait_for_match!(publisher, subscription);
        let length_lies = vec![0, 1, 0, 0, 255, 255, 255, 255, b'x', 0];
        let not_utf8 = vec![0, 1, 0, 0, 3, 0, 0, 0, 0xff, 0xfe, 0];
        let too_long = cdr::to_vec(&text(&"x".repeat(1000))).unwrap();
        let good = cdr::to_vec(&text("good")).unwrap();
        for bytes in [length_lies, not_utf8, too_long, good] {
            publisher.publish_blocking(bytes).unwrap();
        }
        assert_eq!(
            heard.recv_timeout(PATIENCE).unwrap().data,
            "good",
            "{topic}"
        );
        assert_eq!(
            (subscription.undecodable(), subscription.received()),
            (3, 1),
            "{topic}"
        );
    }
}

#[test]
fn a_message_is_decoded_by_who_works_on_it() {
    let domain = TestDomain::take();
    let (a, b) = (runtime(&domain, "a"), runtime(&domain, "b"));
    let (from, to) = (a.node("a").unwrap(), b.node("b").unwrap());
    let (qos, (sender, heard)) = (Qos::DEFAULT, channel());
    let subscription = to
        .subscribe_undecoded::<RosString>("chatter", qos, Load::Small, move |message| {
            let _ = sender.send(message);
        })
        .unwrap();
    let next = || heard.recv_timeout(PATIENCE).unwrap();
    let there = from
        .raw_publisher("/chatter", RosString::TYPE, qos)
        .unwrap();
    wait_for_match!(there, subscription);
    let good = cdr::to_vec(&text("outside")).unwrap();
    let length = good.len();
    there
        .publish_blocking(vec![0, 1, 0, 0, 9, 0, 0, 0])
        .unwrap();
    there.publish_blocking(good).unwrap();
    let (bad, good) = (next(), next());
    assert_eq!(
        (subscription.received(), subscription.undecodable()),
        (0, 0)
    );
    assert!(bad.decode().is_none());
    assert_eq!(good.bytes(|_| 0), length);
    assert_eq!(good.decode().unwrap().data, "outside");
    let here = to.publisher::<RosString>("chatter", qos).unwrap();
    here.publish(text("here")).unwrap();
    let shared = next();
    assert_eq!(shared.bytes(|message| message.data.len()), 4);
    assert_eq!(shared.decode().unwrap().data, "here");
    assert_eq!(
        (subscription.received(), subscription.undecodable()),
        (2, 1)
    );
}
