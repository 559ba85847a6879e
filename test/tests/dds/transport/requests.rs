//! Requests that a server does not answer: counted in the diagnostics of its process.

use std::sync::Mutex;

use lattice_msgs::cdr;
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};
use lattice_runtime::{CallError, Client, Reply};

use super::*;

type Diagnostics = Receiver<Arc<DiagnosticArray>>;

/// Waits until the transport states a number of a service.
fn until(stated: &Diagnostics, key: &str, count: usize) {
    let expected = count.to_string();
    loop {
        let all = stated.recv_timeout(PATIENCE).expect(key);
        let mut values = all.status.iter().flat_map(|status| &status.values);
        if values.any(|value| value.key == key && value.value == expected) {
            return;
        }
    }
}

fn call(client: &Client) -> impl Future<Output = Result<Vec<u8>, CallError>> + Send + 'static {
    let request = cdr::to_vec(&TriggerRequest::default()).unwrap();
    client.call(request, PATIENCE)
}

#[test]
fn requests_that_nobody_answers_and_those_without_room_are_counted() {
    let two = Two::start();
    let (_diagnostics, stated) = hear(
        &two.from,
        "/diagnostics",
        Qos::DIAGNOSTICS,
        SubscriptionExecutor::Shared,
    );
    // Dropped by its handler.
    let forgets = |_: TriggerRequest, reply: Reply<TriggerResponse>| drop(reply);
    let _forgets = (two
        .to
        .service_concurrent::<Trigger>("/forgets", 16, forgets))
    .unwrap();
    let client = two.from.client::<Trigger>("/forgets").unwrap();
    let calls: Vec<_> = (0..3).map(|_| smol::spawn(call(&client))).collect();
    until(&stated, "/forgets requests_failed", 3);
    drop(calls);
    // One at a time, which waits for the test.
    let (held, holds) = channel::<Reply<TriggerResponse>>();
    let held = Mutex::new(held);
    let hold = move |_: TriggerRequest, reply| drop(held.lock().unwrap().send(reply));
    let _holds = (two.to.service_concurrent::<Trigger>("/holds", 1, hold)).unwrap();
    let client = two.from.client::<Trigger>("/holds").unwrap();
    let first = smol::spawn(call(&client));
    let reply = holds.recv_timeout(PATIENCE).unwrap();
    // As many as wait, and five that displace the oldest of them.
    let (depth, more) = (Qos::REQUESTS.depth, 5);
    let calls: Vec<_> = (0..depth + more)
        .map(|_| {
            let call = smol::spawn(call(&client));
            // Sent one by one, so that none is lost on its way.
            std::thread::sleep(Duration::from_micros(100));
            call
        })
        .collect();
    let answer = |reply: Reply<TriggerResponse>| reply.send(TriggerResponse::default());
    std::thread::sleep(Duration::from_secs(1));
    answer(reply);
    assert!(smol::block_on(first).is_ok());
    for _ in 0..depth {
        answer(holds.recv_timeout(PATIENCE).unwrap());
    }
    until(&stated, "/holds requests_lost", more);
    drop(calls);
}
