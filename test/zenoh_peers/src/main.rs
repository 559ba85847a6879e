//! A node of ros2-client over its Zenoh backend, driven by lines of standard input. Each command is answered by one line.
//!
//! `ZENOH_CONFIG_OVERRIDE` has the settings of Zenoh.
//!
//! ```text
//! lattice_zenoh_peers DOMAIN           the node /peer with the parameter `speed` = 1.0
//!
//! hear TOPIC QOS                       subscribes to a string
//! hear_cloud TOPIC QOS                 subscribes to a PointCloud2
//! take TOPIC                           SEQUENCE GID TEXT, or SEQUENCE GID WIDTH BYTES SUM of a cloud
//! advertise TOPIC QOS                  publishes strings
//! advertise_cloud TOPIC QOS            publishes clouds
//! subscribed TOPIC                     waits for a subscription
//! say TOPIC TEXT                       publishes a string
//! say_long TOPIC BYTES                 publishes a string of this length
//! say_cloud TOPIC BYTES                publishes a cloud with this data
//! get NODE NAME                        value of a parameter of a node, by its service
//! set NODE NAME VALUE                  sets a number
//! list NODE                            number of its parameters
//! trigger SERVICE                      calls std_srvs/Trigger
//! counts TOPIC                         PUBLISHERS SUBSCRIPTIONS
//! found NODE, lost NODE                waits until a node is in the graph, or is not
//! ```

mod cloud;
mod graph;

use std::collections::HashMap;
use std::error::Error;
use std::io::{BufRead, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use futures::executor::block_on;
use ros2_client::qos::{Durability, History, Liveliness, WhenFull};
use ros2_client::{
    Context, ContextOptions, MessageInfo, MessageTypeName, Name, Node, NodeName, NodeOptions,
    Parameter, ParameterValue, Publisher, QosProfile, ServiceTypeName, Subscription, Topic,
};
use serde::{Deserialize, Serialize};

use cloud::Cloud;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Period at which the parameter services look for requests: ros2-client has no callback for them.
const SERVICE_PERIOD: Duration = Duration::from_millis(5);

enum Writer {
    Text(Publisher<String>),
    Cloud(Publisher<Cloud>),
}

enum Reader {
    Text(Subscription<String>),
    Cloud(Subscription<Cloud>),
}

#[derive(Deserialize, Serialize)]
struct TriggerRequest {
    structure_needs_at_least_one_member: u8,
}

#[derive(Deserialize, Serialize)]
struct TriggerResponse {
    success: bool,
    message: String,
}

/// The node and its endpoints, by topic.
struct Peer<'a> {
    context: &'a Context,
    node: &'a Node,
    writers: HashMap<String, Writer>,
    readers: HashMap<String, Reader>,
}

fn main() -> Outcome<()> {
    let domain = std::env::args().nth(1).ok_or("expected DOMAIN")?.parse()?;
    let context = Context::with_options(ContextOptions::new().domain_id(domain))?;
    let options = NodeOptions::new()
        .enable_rosout(false)
        .declare_parameter("speed", ParameterValue::Double(1.0));
    let node = context.new_node(NodeName::new("/", "peer")?, options)?;
    let parameters = node.parameter_server().ok_or("no parameter services")?;
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        let is_over = &is_over;
        scope.spawn(move || parameters.spin(SERVICE_PERIOD, || is_over.load(Ordering::Relaxed)));
        let mut peer = Peer {
            context: &context,
            node: &node,
            writers: HashMap::new(),
            readers: HashMap::new(),
        };
        let result = peer.work();
        is_over.store(true, Ordering::Relaxed);
        result
    })
}

fn qos(name: &str) -> Outcome<QosProfile> {
    let reliable = QosProfile::default()
        .reliability_reliable(WhenFull::Block)
        .history(History::KeepLast { depth: 7 });
    Ok(match name {
        "reliable" => reliable,
        "best_effort" => reliable.reliability_best_effort(),
        "latched" => reliable.durability(Durability::TransientLocal),
        // Every field differs from the default of rmw_zenoh.
        "all" => QosProfile::default()
            .reliability_best_effort()
            .durability(Durability::TransientLocal)
            .history(History::KeepAll)
            .deadline(Some(Duration::from_millis(1500)))
            .lifespan(Some(Duration::from_secs(10)))
            .liveliness(Liveliness::ManualByTopic)
            .liveliness_lease(Some(Duration::from_millis(2500))),
        _ => return Err(format!("unknown QoS {name}").into()),
    })
}

fn origin(info: &MessageInfo) -> String {
    let gid = info.publisher_gid().to_bytes16();
    let gid: String = gid.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("{} {gid}", info.sequence_number())
}

impl Peer<'_> {
    /// Executes commands until the input ends.
    fn work(&mut self) -> Outcome<()> {
        println!("ready");
        for line in std::io::stdin().lock().lines() {
            let line = line?;
            let words: Vec<&str> = line.split(' ').collect();
            let answer = self
                .execute(&words)
                .map_err(|why| format!("{line}: {why}"))?;
            println!("{answer}");
            std::io::stdout().flush()?;
        }
        Ok(())
    }

    fn execute(&mut self, words: &[&str]) -> Outcome<String> {
        match *words {
            [
                "hear" | "hear_cloud" | "advertise" | "advertise_cloud",
                topic,
                profile,
            ] => {
                self.create(words[0], topic, qos(profile)?)?;
            }
            ["take", topic] => return self.take(topic),
            ["subscribed", topic] => block_on(self.context.wait_for_subscription(topic)),
            ["say", topic, text] => self.say(topic, text.to_owned())?,
            ["say_long", topic, bytes] => self.say(topic, "x".repeat(bytes.parse()?))?,
            ["say_cloud", topic, bytes] => match self.writers.get(topic) {
                Some(Writer::Cloud(writer)) => writer.publish(Cloud::of(bytes.parse()?))?,
                _ => return Err("no clouds are advertised".into()),
            },
            ["get", node, name] => {
                let values = self.parameters_of(node)?.get_parameters(&[name])?;
                return Ok(format!("{:?}", values.first()));
            }
            ["set", node, name, value] => {
                let value = ParameterValue::Double(value.parse()?);
                let name = name.to_owned();
                let results = self
                    .parameters_of(node)?
                    .set_parameters([Parameter { name, value }])?;
                return Ok(format!("{:?}", results.first()));
            }
            ["list", node] => {
                return Ok(self
                    .parameters_of(node)?
                    .list_parameters(&[])?
                    .len()
                    .to_string());
            }
            ["trigger", service] => return self.trigger(service),
            ["counts", topic] => {
                let [publishers, subscriptions] = [
                    self.context.publisher_count(topic),
                    self.context.subscription_count(topic),
                ];
                return Ok(format!("{publishers} {subscriptions}"));
            }
            ["found", node] => graph::wait(self.context, node, true)?,
            ["lost", node] => graph::wait(self.context, node, false)?,
            _ => return Err("unknown command".into()),
        }
        Ok("done".to_owned())
    }

    fn topic(&self, name: &str, of: (&str, &str), qos: &QosProfile) -> Outcome<Topic> {
        let name = Name::new("/", name.trim_start_matches('/'))?;
        let of = MessageTypeName::new(of.0, of.1);
        Ok(self.node.create_topic(&name, of, qos))
    }

    fn create(&mut self, what: &str, name: &str, qos: QosProfile) -> Outcome<()> {
        let of = match what.ends_with("_cloud") {
            true => ("sensor_msgs", "PointCloud2"),
            false => ("std_msgs", "String"),
        };
        let (topic, node, key) = (self.topic(name, of, &qos)?, self.node, name.to_owned());
        match what {
            "hear" => {
                let reader = Reader::Text(node.create_subscription(&topic, None)?);
                self.readers.insert(key, reader);
            }
            "hear_cloud" => {
                let reader = Reader::Cloud(node.create_subscription(&topic, None)?);
                self.readers.insert(key, reader);
            }
            "advertise" => {
                let writer = Writer::Text(node.create_publisher(&topic, None)?);
                self.writers.insert(key, writer);
            }
            _ => {
                let writer = Writer::Cloud(node.create_publisher(&topic, None)?);
                self.writers.insert(key, writer);
            }
        }
        Ok(())
    }

    fn say(&self, topic: &str, text: String) -> Outcome<()> {
        match self.writers.get(topic) {
            Some(Writer::Text(writer)) => Ok(writer.publish(text)?),
            _ => Err("no strings are advertised".into()),
        }
    }

    fn take(&self, topic: &str) -> Outcome<String> {
        Ok(match self.readers.get(topic) {
            Some(Reader::Text(reader)) => {
                let (text, info) = block_on(reader.async_take())?;
                format!("{} {text}", origin(&info))
            }
            Some(Reader::Cloud(reader)) => {
                let (cloud, info) = block_on(reader.async_take())?;
                format!("{} {}", origin(&info), cloud.summary())
            }
            None => return Err("nobody listens".into()),
        })
    }

    fn parameters_of(&self, node: &str) -> Outcome<ros2_client::ParameterClient> {
        let name = NodeName::new("/", node.trim_start_matches('/'))?;
        Ok(self.node.create_parameter_client(&name)?)
    }

    fn trigger(&self, service: &str) -> Outcome<String> {
        let (node, base) = service.rsplit_once('/').ok_or("expected /NODE/NAME")?;
        let name = Name::new(node, base)?;
        let of = ServiceTypeName::new("std_srvs", "Trigger");
        let client = self
            .node
            .create_client::<TriggerRequest, TriggerResponse>(&name, &of)?;
        let request = TriggerRequest {
            structure_needs_at_least_one_member: 0,
        };
        Ok(match client.call(request) {
            Ok(response) => format!("{} {}", response.success, response.message),
            Err(why) => why.to_string(),
        })
    }
}
