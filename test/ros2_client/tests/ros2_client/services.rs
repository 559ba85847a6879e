//! The runtime against ros2-client as a peer: services by both rmw mappings, parameters, the graph.

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use futures::StreamExt;
use lattice_msgs::diagnostic_msgs::{DiagnosticArray, KeyValue};
use lattice_msgs::rcl_interfaces::{GetParametersRequest, GetParametersResponse};
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Runtime, SubscriptionExecutor};
use ros2_client::qos::History;
use ros2_client::{Message, Name, Node, NodeEvent, ServiceMapping, ServiceTypeName};

use super::client::{Domain, Foreign, MAPPINGS, PATIENCE, peer, reliable};

const TRIGGER: (&str, &str) = ("std_srvs", "Trigger");

fn runtime(domain: &Domain, args: &[&str]) -> Runtime {
    let args = args.iter().map(|&arg| arg.to_owned());
    let args = RosArgs::parse(args).unwrap();
    Runtime::with_transport("mapper", args, &domain.network()).unwrap()
}

/// Calls a service once the client knows it.
fn call<Q: Message + Clone + 'static, R: Message + 'static>(
    peer: &mut Node,
    mapping: ServiceMapping,
    service: &str,
    type_name: (&str, &str),
    request: Q,
) -> R {
    let name = Name::parse(service).unwrap();
    let type_name = ServiceTypeName::new(type_name.0, type_name.1);
    let client = peer
        .create_client::<Q, R>(mapping, &name, &type_name, reliable(), reliable())
        .unwrap();
    let answer = async {
        client.wait_for_service(peer).await;
        client.async_call_service(request).await.unwrap()
    };
    let timeout = async {
        smol::Timer::after(PATIENCE).await;
        panic!("{service} did not answer to {mapping:?}");
    };
    smol::block_on(smol::future::or(answer, timeout))
}

#[test]
fn a_trigger_answers_clients_of_both_rmw() {
    let domain = Domain::take();
    let runtime = runtime(&domain, &[]);
    let mut calls = 0;
    let server = runtime
        .node("mapper")
        .unwrap()
        .service_trigger("~/reset", move || {
            calls += 1;
            (true, format!("call {calls}"))
        })
        .unwrap();
    assert_eq!(server.name(), "/mapper/reset");
    for (i, &mapping) in MAPPINGS.iter().enumerate() {
        // Two clients of one participant would see each other's replies.
        let mut peer = peer(&domain);
        let request = Foreign(TriggerRequest::default());
        let reply: Foreign<TriggerResponse> =
            call(&mut peer, mapping, "/mapper/reset", TRIGGER, request);
        let expected = TriggerResponse {
            success: true,
            message: format!("call {}", i + 1),
        };
        assert_eq!(reply.0, expected, "{mapping:?}");
    }
}

#[test]
fn an_answer_given_at_the_end_reaches_its_client() {
    let domain = Domain::take();
    let runtime = runtime(&domain, &[]);
    let shutdown = runtime.shutdown_handle();
    let (sender, asked) = channel();
    let _server = runtime
        .node("mapper")
        .unwrap()
        .service_later::<Trigger>("~/save_map", move |_, reply| {
            // The end begins before this thread can send the answer.
            sender.send(reply).unwrap();
            shutdown.wait();
        })
        .unwrap();
    let mut peer = peer(&domain);
    let client = std::thread::spawn(move || {
        let request = Foreign(TriggerRequest::default());
        call(&mut peer, MAPPINGS[0], "/mapper/save_map", TRIGGER, request)
    });
    let saved = TriggerResponse {
        success: true,
        message: "saved".to_owned(),
    };
    asked.recv_timeout(PATIENCE).unwrap().send(saved.clone());
    runtime.shutdown_handle().request();
    runtime.spin().unwrap();
    let reply: Foreign<TriggerResponse> = client.join().unwrap();
    assert_eq!(reply.0, saved);
}

#[test]
fn many_requests_at_once_are_all_answered() {
    let (answered, lost) = answered_and_lost(700);
    assert!(answered >= 700 && lost == 0, "{answered} {lost}");
}

#[test]
fn requests_that_find_no_room_are_counted() {
    let (answered, lost) = answered_and_lost(1500);
    assert!(answered >= 1000 && lost > 0, "{answered} {lost}");
}

/// Sends requests to a server that is busy with one: the numbers of answers, and of losses in the diagnostics.
fn answered_and_lost(requests: usize) -> (usize, usize) {
    let domain = Domain::take();
    let runtime = runtime(&domain, &[]);
    let (sender, asked) = channel();
    let _server = runtime
        .node("mapper")
        .unwrap()
        .service_later::<Trigger>("~/reset", move |_, reply| sender.send(reply).unwrap())
        .unwrap();
    let (sender, told) = channel();
    let hear = move |array: Arc<DiagnosticArray>| {
        let values = array.status.iter().flat_map(|status| &status.values);
        let lost = |value: &&KeyValue| value.key == "/mapper/reset requests_lost";
        let lost = values
            .filter(lost)
            .find_map(|value| value.value.parse::<usize>().ok());
        let _ = sender.send(lost.unwrap_or(0));
    };
    let node = runtime.node("mapper").unwrap();
    let _diagnostics = node
        .subscribe(
            "/diagnostics",
            Qos::DIAGNOSTICS,
            SubscriptionExecutor::Shared,
            hear,
        )
        .unwrap();
    let mut peer = peer(&domain);
    let type_name = ServiceTypeName::new(TRIGGER.0, TRIGGER.1);
    let name = Name::parse("/mapper/reset").unwrap();
    let depth = 2 * requests;
    let qos = || reliable().history(History::KeepLast { depth });
    let client = peer
        .create_client::<Foreign<TriggerRequest>, Foreign<TriggerResponse>>(
            MAPPINGS[0],
            &name,
            &type_name,
            qos(),
            qos(),
        )
        .unwrap();
    let (done, sent) = channel();
    let (came, heard) = channel();
    let calls = std::thread::spawn(move || {
        let ask = || {
            let request = Foreign(TriggerRequest::default());
            smol::block_on(client.async_send_request(request)).unwrap();
        };
        smol::block_on(client.wait_for_service(&peer));
        ask();
        heard.recv_timeout(PATIENCE).unwrap();
        (0..requests).for_each(|_| ask());
        done.send(()).unwrap();
        // They send again what is lost.
        (client, peer)
    });
    let first = asked.recv_timeout(PATIENCE).unwrap();
    came.send(()).unwrap();
    // All have been sent before the first is answered.
    sent.recv_timeout(PATIENCE).unwrap();
    first.send(TriggerResponse::default());
    let (mut answered, mut lost) = (0, 0);
    let deadline = Instant::now() + PATIENCE;
    while answered + lost < requests {
        assert!(
            Instant::now() < deadline,
            "{answered} and {lost} of {requests}"
        );
        if let Ok(reply) = asked.recv_timeout(Duration::from_millis(5)) {
            reply.send(TriggerResponse::default());
            answered += 1;
        }
        lost = told.try_iter().last().unwrap_or(lost);
    }
    drop(calls.join().unwrap());
    (answered, lost)
}

#[test]
fn parameters_are_served_to_clients_of_both_rmw() {
    let domain = Domain::take();
    let runtime = runtime(&domain, &["--ros-args", "-p", "max_message_bytes:=5000"]);
    let type_name = ("rcl_interfaces", "GetParameters");
    for &mapping in &MAPPINGS {
        let mut peer = peer(&domain);
        let request = Foreign(GetParametersRequest {
            names: vec!["max_message_bytes".to_owned(), "none".to_owned()],
        });
        let service = "/mapper/get_parameters";
        let reply: Foreign<GetParametersResponse> =
            call(&mut peer, mapping, service, type_name, request);
        let values: Vec<_> = reply.0.values.iter().map(|v| v.integer_value).collect();
        assert_eq!(values, [5000, 0], "{mapping:?}");
    }
    drop(runtime);
}

#[test]
fn the_graph_names_every_node_with_its_endpoints() {
    let domain = Domain::take();
    let peer = peer(&domain);
    let mut events = Box::pin(peer.status_receiver().unwrap());
    let (sender, announced) = channel();
    // Its queue is short: what is not taken at once is lost.
    let listener = smol::spawn(async move {
        while let Some(event) = events.next().await {
            if let NodeEvent::ParticipantEntities(info) = event {
                let nodes = info.nodes().iter();
                let mut names: Vec<_> = nodes.map(|n| n.fully_qualified_name()).collect();
                names.sort();
                let _ = sender.send(names);
            }
        }
    });
    let runtime = runtime(&domain, &["--ros-args", "-r", "__ns:=/robot"]);
    let markers = runtime.node("markers").unwrap();
    let expected = ["/robot/mapper", "/robot/markers"];
    while announced.recv_timeout(PATIENCE).unwrap() != expected {}
    drop(listener);
    drop(markers);
}
