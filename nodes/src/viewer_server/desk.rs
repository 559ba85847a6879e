//! The desk at which one client asks: what is offered there, what it may ask, how much at a time.

use std::collections::BTreeMap;

use super::protocol::{
    self, AdvertisedService, ClientChannel, ClientData, ClientMessage, Value, Wish,
};

/// Most questions of a client that wait for their answers.
const MAX_IN_FLIGHT: usize = 16;
/// Most channels of a client.
const MAX_CHANNELS: usize = 16;

/// A topic that clients may publish on.
#[derive(Clone, Debug)]
pub struct OpenTopic {
    /// Full name.
    pub name: String,
    /// Type of its messages.
    pub type_name: &'static str,
}

/// All that clients may ask for besides what is shown.
#[derive(Clone, Debug, Default)]
pub struct Offer {
    /// Services, by their ids.
    pub services: Vec<AdvertisedService>,
    /// Topics.
    pub topics: Vec<OpenTopic>,
    /// True if parameters may be read and set.
    pub parameters: bool,
    /// True if the graph of nodes is known.
    pub graph: bool,
}

impl Offer {
    /// Names of what is offered in the protocol.
    pub fn capabilities(&self) -> Vec<&'static str> {
        [
            ("services", !self.services.is_empty()),
            ("parameters", self.parameters),
            ("parametersSubscribe", self.parameters),
            ("clientPublish", !self.topics.is_empty()),
            ("connectionGraph", self.graph),
        ]
        .into_iter()
        .filter_map(|(name, offered)| offered.then_some(name))
        .collect()
    }
}

/// A question that others answer.
#[derive(Debug, PartialEq)]
pub enum Ask {
    /// Call of a service.
    Call {
        /// Its id.
        service: u32,
        /// By which the client knows the answer.
        call: u32,
        /// CDR.
        request: Vec<u8>,
    },
    /// Values of parameters.
    GetParameters(Vec<String>, Option<String>),
    /// Other values.
    SetParameters(Vec<Value>, Option<String>),
    /// A message, on the topic of this place in the offer.
    Publish(usize, Vec<u8>),
}

/// Consequence of a message of a client.
#[derive(Debug, PartialEq)]
pub enum Step {
    /// It wants channels.
    Subscribe(Vec<Wish>),
    /// It wants them no more.
    Unsubscribe(Vec<u32>),
    /// It wants to hear of changes of these parameters, none for all, or does no longer.
    Watch(Vec<String>, bool),
    /// It wants the graph of nodes, or does no longer.
    Graph(bool),
    /// Something is to be asked for.
    Ask(Ask),
    /// A text for the client.
    Tell(String),
    /// Nothing.
    Done,
}

/// The state of one client.
#[derive(Debug)]
pub struct Desk<'a> {
    offer: &'a Offer,
    /// Topics of the offer by the client's channels.
    channels: BTreeMap<u32, usize>,
    in_flight: usize,
}

impl<'a> Desk<'a> {
    /// A desk at which nobody has asked.
    pub fn new(offer: &'a Offer) -> Self {
        Self {
            offer,
            channels: BTreeMap::new(),
            in_flight: 0,
        }
    }

    /// Takes a text message.
    pub fn text(&mut self, text: &str) -> Step {
        match ClientMessage::parse(text) {
            Ok(ClientMessage::Subscribe { subscriptions }) => Step::Subscribe(subscriptions),
            Ok(ClientMessage::Unsubscribe { subscription_ids }) => {
                Step::Unsubscribe(subscription_ids)
            }
            Ok(ClientMessage::GetParameters {
                parameter_names,
                id,
            }) if self.offer.parameters => self.ask(Ask::GetParameters(parameter_names, id)),
            Ok(ClientMessage::SetParameters { parameters, id }) if self.offer.parameters => {
                self.ask(Ask::SetParameters(parameters, id))
            }
            Ok(ClientMessage::SubscribeParameterUpdates { parameter_names })
                if self.offer.parameters =>
            {
                Step::Watch(parameter_names, true)
            }
            Ok(ClientMessage::UnsubscribeParameterUpdates { parameter_names })
                if self.offer.parameters =>
            {
                Step::Watch(parameter_names, false)
            }
            Ok(ClientMessage::SubscribeConnectionGraph) if self.offer.graph => Step::Graph(true),
            Ok(ClientMessage::UnsubscribeConnectionGraph) => Step::Graph(false),
            Ok(ClientMessage::Advertise { channels }) if !self.offer.topics.is_empty() => {
                self.advertise(&channels)
            }
            Ok(ClientMessage::Unadvertise { channel_ids }) => {
                channel_ids
                    .iter()
                    .for_each(|id| _ = self.channels.remove(id));
                Step::Done
            }
            Ok(_) => tell("this is not offered here; writing is off unless `allow_write` is on"),
            Err(error) => tell(&error.to_string()),
        }
    }

    /// Takes a binary message.
    pub fn data(&mut self, bytes: &[u8]) -> Step {
        match ClientData::parse(bytes) {
            Ok(ClientData::Message { channel, payload }) => match self.channels.get(&channel) {
                Some(topic) => self.ask(Ask::Publish(*topic, payload.to_vec())),
                None => tell(&format!("channel {channel} is not yours to publish on")),
            },
            Ok(ClientData::Call {
                service,
                call,
                encoding,
                payload,
            }) => {
                let refuse = |why: &str| Step::Tell(protocol::service_failure(service, call, why));
                if service as usize >= self.offer.services.len() {
                    return refuse("there is no such service; `allow_write` may be off");
                }
                if encoding != b"cdr" {
                    return refuse("requests are taken as cdr alone");
                }
                let request = payload.to_vec();
                match self.ask(Ask::Call {
                    service,
                    call,
                    request,
                }) {
                    Step::Tell(_) => refuse(TOO_MANY),
                    step => step,
                }
            }
            Err(error) => tell(&error.to_string()),
        }
    }

    /// To be called for each answer.
    pub fn answered(&mut self) {
        self.in_flight = self.in_flight.saturating_sub(1);
    }

    fn ask(&mut self, ask: Ask) -> Step {
        if self.in_flight >= MAX_IN_FLIGHT {
            return tell(TOO_MANY);
        }
        self.in_flight += 1;
        Step::Ask(ask)
    }

    fn advertise(&mut self, channels: &[ClientChannel]) -> Step {
        for channel in channels {
            let fits = |topic: &OpenTopic| {
                topic.name == channel.topic && topic.type_name == channel.schema_name
            };
            let topic = self.offer.topics.iter().position(fits);
            let room = self.channels.len() < MAX_CHANNELS;
            let free = !self.channels.contains_key(&channel.id);
            match topic.filter(|_| room && free && channel.encoding == "cdr") {
                Some(topic) => _ = self.channels.insert(channel.id, topic),
                None => return tell(&refusal(channel, &self.offer.topics)),
            }
        }
        Step::Done
    }
}

const TOO_MANY: &str = "too many questions wait for their answers";

fn tell(problem: &str) -> Step {
    Step::Tell(protocol::status(problem))
}

fn refusal(channel: &ClientChannel, topics: &[OpenTopic]) -> String {
    let open = topics.iter().map(|topic| topic.name.as_str());
    format!(
        "channel {} is not taken: topics that are open, as cdr: {}",
        channel.id,
        open.collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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
            topics: vec![OpenTopic {
                name: "/goal_pose".to_owned(),
                type_name: "geometry_msgs/msg/PoseStamped",
            }],
            parameters: true,
            graph: true,
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
        let mut desk = Desk::new(&offer);
        for text in [
            ADVERTISE,
            WATCH,
            GRAPH,
            r#"{"op":"getParameters","parameterNames":[]}"#,
            r#"{"op":"setParameters","parameters":[{"name":"/a.b","value":1}]}"#,
        ] {
            assert!(matches!(desk.text(text), Step::Tell(_)), "{text}");
        }
        for bytes in [call(0, b"cdr"), vec![1, 3, 0, 0, 0, 0, 1, 0, 0]] {
            assert!(matches!(desk.data(&bytes), Step::Tell(_)));
        }
    }

    #[test]
    fn what_is_offered_is_asked_for_up_to_a_number() {
        let offer = offer();
        let mut desk = Desk::new(&offer);
        let refused = [call(1, b"cdr"), call(u32::MAX, b"cdr"), call(0, b"json")];
        for bytes in &refused {
            let Step::Tell(text) = desk.data(bytes) else {
                panic!("{bytes:?} was taken");
            };
            assert!(text.contains("serviceCallFailure") && text.contains("\"callId\":7"));
        }
        let names = vec!["/a.b".to_owned()];
        assert_eq!(desk.text(WATCH), Step::Watch(names.clone(), true));
        let unwatch = WATCH.replace("subscribe", "unsubscribe");
        assert_eq!(desk.text(&unwatch), Step::Watch(names, false));
        assert_eq!(desk.text(GRAPH), Step::Graph(true));
        let unfollow = GRAPH.replace("subscribe", "unsubscribe");
        assert_eq!(desk.text(&unfollow), Step::Graph(false));
        let all = r#"{"op":"subscribeParameterUpdates"}"#;
        assert_eq!(desk.text(all), Step::Watch(Vec::new(), true));
        assert_eq!(desk.text(ADVERTISE), Step::Done);
        assert!(matches!(desk.text(ADVERTISE), Step::Tell(_)), "twice");
        let other = ADVERTISE
            .replace("goal_pose", "cmd_vel")
            .replace(":3", ":4");
        assert!(matches!(desk.text(&other), Step::Tell(_)), "not open");
        for _ in 0..MAX_IN_FLIGHT - 1 {
            assert!(matches!(
                desk.data(&call(0, b"cdr")),
                Step::Ask(Ask::Call { call: 7, .. })
            ));
        }
        let publish = [1, 3, 0, 0, 0, 9];
        assert_eq!(desk.data(&publish), Step::Ask(Ask::Publish(0, vec![9])));
        assert!(matches!(desk.data(&publish), Step::Tell(_)), "too many");
        desk.answered();
        assert!(matches!(desk.data(&publish), Step::Ask(_)));
        desk.answered();
        assert_eq!(
            desk.text(r#"{"op":"unadvertise","channelIds":[3]}"#),
            Step::Done
        );
        assert!(matches!(desk.data(&publish), Step::Tell(_)), "no longer");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(5000))]
        #[test]
        fn mutated_messages_do_not_panic(changes in prop::collection::vec((0..200usize, any::<u8>()), 0..8), cut in 0..200usize) {
            let offer = offer();
            let mut desk = Desk::new(&offer);
            for seed in [ADVERTISE.as_bytes(), WATCH.as_bytes(), &call(0, b"cdr")] {
                let mut bytes = seed.to_vec();
                for (at, byte) in &changes {
                    let at = at % bytes.len();
                    bytes[at] = *byte;
                }
                bytes.truncate(cut);
                desk.data(&bytes);
                desk.text(&String::from_utf8_lossy(&bytes));
                prop_assert!(desk.in_flight <= MAX_IN_FLIGHT && desk.channels.len() <= MAX_CHANNELS);
            }
        }
    }
}
