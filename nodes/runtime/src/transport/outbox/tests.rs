//! Queues in front of writers.

use futures::future::BoxFuture;

use super::*;
use crate::transport::port::WriteRefusal;

/// A writer whose reader does not acknowledge.
struct Stuck;

impl SampleWriter for Stuck {
    fn id(&self) -> EndpointId {
        EndpointId([7; 16])
    }

    fn write(&self, _: Bytes, _: Option<SampleId>) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        Box::pin(smol::future::pending())
    }

    fn unacknowledged(&self) -> u64 {
        0
    }

    fn wait_for_acknowledgments(&self, _: Duration) -> bool {
        false
    }
}

/// A writer whose readers acknowledge at once.
struct Prompt;

impl SampleWriter for Prompt {
    fn id(&self) -> EndpointId {
        EndpointId([8; 16])
    }

    fn write(&self, _: Bytes, _: Option<SampleId>) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        Box::pin(async { Ok(()) })
    }

    fn wait_for_acknowledgments(&self, _: Duration) -> bool {
        true
    }
}

/// A writer that sends the first sample later than the queue waits, and then no other.
struct Late(AtomicUsize);

impl SampleWriter for Late {
    fn id(&self) -> EndpointId {
        EndpointId([9; 16])
    }

    fn write(&self, _: Bytes, _: Option<SampleId>) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        self.0.fetch_add(1, Relaxed);
        Box::pin(smol::future::pending())
    }

    fn is_sending(&self, _: &Bytes) -> bool {
        self.0.load(Relaxed) == 1
    }

    fn wait_for_acknowledgments(&self, _: Duration) -> bool {
        false
    }
}

#[test]
fn a_sample_that_is_still_being_sent_is_not_counted_as_dropped() {
    let late = Arc::new(Late(AtomicUsize::new(0)));
    let (outbox, task) = Outbox::new("/chatter", late, WhenFull::Drop, 9, usize::MAX);
    for body in [&b"first"[..], b"second", b"third"] {
        outbox.send_body(Bytes::from_static(body), None).unwrap();
    }
    let flushed = or(async { outbox.flushed().await.is_some() }, async {
        task.await;
        false
    });
    assert!(smol::block_on(flushed));
    assert_eq!((outbox.sent(), outbox.sent_bytes()), (1, 5));
    assert_eq!(outbox.dropped(), 2);
}

#[test]
fn all_is_acknowledged_once_the_queue_is_empty() {
    let (outbox, task) = Outbox::new("/chatter", Arc::new(Prompt), WhenFull::Wait, 1, usize::MAX);
    assert!(outbox.is_acknowledged());
    outbox.send_body(Bytes::from_static(b"body"), None).unwrap();
    // Refused, and so not waited for.
    assert!(outbox.send_body(Bytes::from_static(b"more"), None).is_err());
    assert!(!outbox.is_acknowledged());
    let flushed = smol::block_on(or(async { outbox.flushed().await.is_some() }, async {
        task.await;
        false
    }));
    assert!(flushed && outbox.is_acknowledged());
    outbox.close();
    assert!(
        outbox.is_acknowledged(),
        "nothing is waited for after the end"
    );
}

#[test]
fn who_waits_for_a_full_queue_goes_on_in_time_and_at_the_end() {
    let (outbox, _task) = Outbox::new("/chatter", Arc::new(Stuck), WhenFull::Wait, 1, usize::MAX);
    let (shutdown, long) = (Shutdown::default(), Duration::from_secs(600));
    let body = Bytes::from_static(b"body");
    let send = |patience, shutdown| outbox.send_body_within(body.clone(), patience, shutdown);
    send(long, &shutdown).unwrap();
    for dropped in 1..=2 {
        let refused = send(Duration::from_millis(1), &shutdown);
        let full =
            matches!(refused, Err(PublishError::QueueFull { dropped: n, .. }) if n == dropped);
        assert!(full, "{refused:?}");
    }
    std::thread::scope(|scope| {
        let waiting = scope.spawn(|| send(long, &shutdown));
        shutdown.request();
        let result = waiting.join().unwrap();
        assert!(matches!(result, Err(PublishError::Closed { .. })));
    });
}
