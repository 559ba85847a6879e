//! Protocol state, permissions and limits of one client.

use std::collections::BTreeMap;

use super::inputs::Input;
use super::offer::{MAX_MESSAGE_BYTES, Offer, OpenTopic};
use super::session_action::{BridgeRequest, SessionAction};
use crate::viewer_server::protocol::{self, ClientChannel, ClientData, ClientMessage};

/// Limit of requests without reply per client.
const MAX_IN_FLIGHT: usize = 16;
/// Limit of channels per client.
const MAX_CHANNELS: usize = 32;

/// Session of one client.
#[derive(Debug)]
pub struct ClientSession<'a> {
    offer: &'a Offer,
    /// Offered topics by the client's channel id; true for JSON.
    channels: BTreeMap<u32, (usize, bool)>,
    in_flight: usize,
}

impl<'a> ClientSession<'a> {
    /// Session without requests.
    pub fn new(offer: &'a Offer) -> Self {
        Self {
            offer,
            channels: BTreeMap::new(),
            in_flight: 0,
        }
    }

    /// Handles a text message.
    pub fn on_text(&mut self, text: &str) -> SessionAction {
        use SessionAction::{Done, Graph, Subscribe, Unsubscribe, Watch};
        if text.len() > MAX_MESSAGE_BYTES {
            return reject(TOO_LONG);
        }
        match ClientMessage::parse(text) {
            Ok(ClientMessage::Subscribe { subscriptions }) => Subscribe(subscriptions),
            Ok(ClientMessage::Unsubscribe { subscription_ids }) => Unsubscribe(subscription_ids),
            Ok(ClientMessage::GetParameters {
                parameter_names,
                id,
            }) if self.offer.parameters => {
                self.request(BridgeRequest::GetParameters(parameter_names, id))
            }
            Ok(ClientMessage::SetParameters { parameters, id }) if self.offer.parameters => {
                self.request(BridgeRequest::SetParameters(parameters, id))
            }
            Ok(ClientMessage::SubscribeParameterUpdates { parameter_names })
                if self.offer.parameters =>
            {
                Watch(parameter_names, true)
            }
            Ok(ClientMessage::UnsubscribeParameterUpdates { parameter_names })
                if self.offer.parameters =>
            {
                Watch(parameter_names, false)
            }
            Ok(ClientMessage::SubscribeConnectionGraph) if self.offer.graph => Graph(true),
            Ok(ClientMessage::UnsubscribeConnectionGraph) => Graph(false),
            Ok(ClientMessage::Advertise { channels }) if !self.offer.topics.is_empty() => {
                self.advertise(&channels)
            }
            Ok(ClientMessage::Unadvertise { channel_ids }) => {
                channel_ids
                    .iter()
                    .for_each(|id| _ = self.channels.remove(id));
                Done
            }
            Ok(_) => reject("operation not offered; writing requires `allow_write`"),
            Err(error) => reject(&error.to_string()),
        }
    }

    /// Handles a binary message.
    pub fn on_binary(&mut self, bytes: &[u8]) -> SessionAction {
        match ClientData::parse(bytes) {
            Ok(ClientData::Message { channel, payload }) => self.message(channel, payload),
            Ok(ClientData::Call { service, call, .. }) if bytes.len() > MAX_MESSAGE_BYTES => {
                SessionAction::Reply(protocol::service_failure(service, call, TOO_LONG))
            }
            Ok(ClientData::Call {
                service,
                call,
                encoding,
                payload,
            }) => {
                let refuse =
                    |why: &str| SessionAction::Reply(protocol::service_failure(service, call, why));
                if service as usize >= self.offer.services.len() {
                    return refuse(&format!(
                        "unknown service {service}; others need `allow_write` or `allow_headset`"
                    ));
                }
                if encoding != b"cdr" {
                    return refuse("the encoding of requests must be cdr");
                }
                let request = payload.to_vec();
                match self.request(BridgeRequest::Call {
                    service,
                    call,
                    request,
                }) {
                    SessionAction::Reply(_) => refuse(TOO_MANY),
                    step => step,
                }
            }
            Err(error) => reject(&error.to_string()),
        }
    }

    fn message(&mut self, channel: u32, payload: &[u8]) -> SessionAction {
        let Some(&(topic, is_json)) = self.channels.get(&channel) else {
            return reject(&format!("channel {channel} is not advertised"));
        };
        let streams = self.offer.topics.get(topic);
        if streams.is_some_and(|topic| topic.stream_bytes.is_some()) {
            let bytes = payload.to_vec();
            return SessionAction::Input(Input {
                topic,
                is_json,
                bytes,
            });
        }
        match payload.len() > MAX_MESSAGE_BYTES {
            true => reject(TOO_LONG),
            false => self.request(BridgeRequest::Publish(topic, payload.to_vec())),
        }
    }

    /// To be called for each reply.
    pub fn answered(&mut self) {
        self.in_flight = self.in_flight.saturating_sub(1);
    }

    fn request(&mut self, request: BridgeRequest) -> SessionAction {
        if self.in_flight >= MAX_IN_FLIGHT {
            return reject(TOO_MANY);
        }
        self.in_flight += 1;
        SessionAction::Request(request)
    }

    fn advertise(&mut self, channels: &[ClientChannel]) -> SessionAction {
        for channel in channels {
            let fits = |topic: &OpenTopic| {
                topic.name == channel.topic && topic.type_name == channel.schema_name
            };
            let topic = self.offer.topics.iter().position(fits);
            let room = self.channels.len() < MAX_CHANNELS;
            let free = !self.channels.contains_key(&channel.id);
            let streams = |at: usize| {
                let topic = self.offer.topics.get(at);
                topic.is_some_and(|topic| topic.stream_bytes.is_some())
            };
            let is_json = channel.encoding == "json";
            let is_read = |at: &usize| channel.encoding == "cdr" || is_json && streams(*at);
            match topic.filter(|at| room && free && is_read(at)) {
                Some(topic) => _ = self.channels.insert(channel.id, (topic, is_json)),
                None => return reject(&refusal(channel, &self.offer.topics)),
            }
        }
        SessionAction::Done
    }
}

const TOO_LONG: &str = "a message above 64 kB";
const TOO_MANY: &str = "too many requests without a reply; wait for replies";

fn reject(problem: &str) -> SessionAction {
    SessionAction::Reply(protocol::status(problem))
}

fn refusal(channel: &ClientChannel, topics: &[OpenTopic]) -> String {
    let open = topics.iter().map(|topic| topic.name.as_str());
    format!(
        "channel {} is rejected; open topics, as cdr: {}",
        channel.id,
        open.collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::SessionAction::{Done, Graph, Reply, Request, Watch};
    use super::*;
    use crate::viewer_server::protocol::AdvertisedService;

    fn offer() -> Offer {
        let service = AdvertisedService {
            id: 0,
            name: "/lattice_mapper/reset".to_owned(),
            type_name: "std_srvs/srv/Empty",
            request_schema: String::new(),
            response_schema: String::new(),
        };
        Offer {
            services: vec![service],
            topics: vec![
                OpenTopic {
                    name: "/goal_pose".to_owned(),
                    type_name: "geometry_msgs/msg/PoseStamped",
                    stream_bytes: None,
                },
                OpenTopic {
                    name: "/headset/pose".to_owned(),
                    type_name: "geometry_msgs/msg/PoseStamped",
                    stream_bytes: Some(100_000),
                },
            ],
            parameters: true,
            graph: true,
            stream_bytes_per_s: 1_000_000,
        }
    }

    fn call(service: u32, encoding: &[u8]) -> Vec<u8> {
        let mut bytes = vec![2];
        for number in [service, 7, encoding.len() as u32] {
            bytes.extend(number.to_le_bytes());
        }
        [&bytes, encoding, &[0, 1, 0, 0, 0]].concat()
    }

    const WATCH: &str = r#"{"op":"subscribeParameterUpdates","parameterNames":["/a.b"]}"#;
    const GRAPH: &str = r#"{"op":"subscribeConnectionGraph"}"#;
    const ADVERTISE: &str = r#"{"op":"advertise","channels":[{"id":3,"topic":"/goal_pose","encoding":"cdr","schemaName":"geometry_msgs/msg/PoseStamped"}]}"#;

    #[test]
    fn nothing_can_be_written_where_nothing_is_offered() {
        let offer = Offer::default();
        assert!(offer.capabilities().is_empty());
        let mut session = ClientSession::new(&offer);
        for text in [
            ADVERTISE,
            WATCH,
            GRAPH,
            r#"{"op":"getParameters","parameterNames":[]}"#,
            r#"{"op":"setParameters","parameters":[{"name":"/a.b","value":1}]}"#,
        ] {
            assert!(matches!(session.on_text(text), Reply(_)), "{text}");
        }
        for bytes in [call(0, b"cdr"), vec![1, 3, 0, 0, 0, 0, 1, 0, 0]] {
            assert!(matches!(session.on_binary(&bytes), Reply(_)));
        }
    }

    #[test]
    fn what_is_offered_is_asked_for_up_to_a_number() {
        let offer = offer();
        let mut session = ClientSession::new(&offer);
        let refused = [call(1, b"cdr"), call(u32::MAX, b"cdr"), call(0, b"json")];
        for bytes in &refused {
            let Reply(text) = session.on_binary(bytes) else {
                panic!("{bytes:?} was taken");
            };
            assert!(text.contains("serviceCallFailure") && text.contains("\"callId\":7"));
        }
        let names = vec!["/a.b".to_owned()];
        assert_eq!(session.on_text(WATCH), Watch(names.clone(), true));
        let unwatch = WATCH.replace("subscribe", "unsubscribe");
        assert_eq!(session.on_text(&unwatch), Watch(names, false));
        assert_eq!(session.on_text(GRAPH), Graph(true));
        let unfollow = GRAPH.replace("subscribe", "unsubscribe");
        assert_eq!(session.on_text(&unfollow), Graph(false));
        let all = r#"{"op":"subscribeParameterUpdates"}"#;
        assert_eq!(session.on_text(all), Watch(Vec::new(), true));
        assert_eq!(session.on_text(ADVERTISE), Done);
        assert!(matches!(session.on_text(ADVERTISE), Reply(_)), "twice");
        let other = ADVERTISE
            .replace("goal_pose", "cmd_vel")
            .replace(":3", ":4");
        assert!(matches!(session.on_text(&other), Reply(_)), "not open");
        for _ in 0..MAX_IN_FLIGHT - 1 {
            assert!(matches!(
                session.on_binary(&call(0, b"cdr")),
                Request(BridgeRequest::Call { call: 7, .. })
            ));
        }
        let publish = [1, 3, 0, 0, 0, 9];
        assert_eq!(
            session.on_binary(&publish),
            Request(BridgeRequest::Publish(0, vec![9]))
        );
        assert!(matches!(session.on_binary(&publish), Reply(_)), "too many");
        session.answered();
        assert!(matches!(session.on_binary(&publish), Request(_)));
        session.answered();
        assert_eq!(
            session.on_text(r#"{"op":"unadvertise","channelIds":[3]}"#),
            Done
        );
        assert!(matches!(session.on_binary(&publish), Reply(_)), "no longer");
    }

    #[test]
    fn messages_for_a_headset_are_no_questions_and_may_be_long() {
        let offer = offer();
        assert_eq!(offer.max_message_bytes(), 100_005);
        assert_eq!(Offer::default().max_message_bytes(), MAX_MESSAGE_BYTES);
        let mut session = ClientSession::new(&offer);
        let pose = ADVERTISE.replace("/goal_pose", "/headset/pose");
        assert_eq!(session.on_text(&pose), Done);
        let json = pose.replace(":3", ":4").replace("\"cdr", "\"json");
        assert_eq!(session.on_text(&json), Done);
        let goal = ADVERTISE.replace(":3", ":5");
        assert_eq!(session.on_text(&goal), Done);
        let json_goal = goal.replace(":5", ":6").replace("\"cdr", "\"json");
        assert!(matches!(session.on_text(&json_goal), Reply(_)));
        let message = |channel: u8, length: usize| {
            let head = [1, channel, 0, 0, 0];
            [&head[..], &vec![7; length]].concat()
        };
        for (channel, is_json) in [(3, false), (4, true)] {
            for _ in 0..2 * MAX_IN_FLIGHT {
                let bytes = vec![7; 90_000];
                let input = Input {
                    topic: 1,
                    is_json,
                    bytes,
                };
                assert_eq!(
                    session.on_binary(&message(channel, 90_000)),
                    SessionAction::Input(input)
                );
            }
        }
        assert!(matches!(session.on_binary(&message(5, 90_000)), Reply(_)));
        assert!(matches!(session.on_binary(&message(5, 1)), Request(_)));
        let long = "x".repeat(90_000);
        assert_eq!(session.on_text(&long), reject(TOO_LONG));
        let mut long = call(0, b"cdr");
        long.resize(90_000, 0);
        assert!(matches!(session.on_binary(&long), Reply(text) if text.contains("above 64 kB")));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(5000))]
        #[test]
        fn mutated_messages_do_not_panic(changes in prop::collection::vec((0..200usize, any::<u8>()), 0..8), cut in 0..200usize) {
            let offer = offer();
            let mut session = ClientSession::new(&offer);
            for seed in [ADVERTISE.as_bytes(), WATCH.as_bytes(), &call(0, b"cdr")] {
                let mut bytes = seed.to_vec();
                for (at, byte) in &changes {
                    let at = at % bytes.len();
                    bytes[at] = *byte;
                }
                bytes.truncate(cut);
                session.on_binary(&bytes);
                session.on_text(&String::from_utf8_lossy(&bytes));
                prop_assert!(session.in_flight <= MAX_IN_FLIGHT && session.channels.len() <= MAX_CHANNELS);
            }
        }
    }
}
