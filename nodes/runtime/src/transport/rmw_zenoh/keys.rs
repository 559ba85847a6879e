//! Key expressions of topics and services, and the liveliness tokens that describe nodes and endpoints.

use twox_hash::XxHash3_128;

use crate::config::names;
use crate::transport::port::{EndpointId, PortNode};
use crate::transport::qos::{Durability, Qos, Reliability};

/// Prefix of every token.
const ADMIN: &str = "@ros2_lv";

/// Longest accepted token, bytes: three names of 512 bytes, a type, and short fields.
const MAX_TOKEN_BYTES: usize = 4096;

/// Hash in the token of a subscription that accepts every version of its type.
pub(super) const ANY_HASH: &str = "AnyTypeHash";

/// Kind of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Publisher,
    Subscription,
    Server,
    Client,
}

impl Kind {
    const ALL: [(&str, Kind); 4] = [
        ("MP", Kind::Publisher),
        ("MS", Kind::Subscription),
        ("SS", Kind::Server),
        ("SC", Kind::Client),
    ];

    fn code(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, kind)| *kind == self);
        found.map_or("", |(code, _)| code)
    }

    /// Kind of the matching end.
    pub(super) fn counterpart(self) -> Kind {
        match self {
            Kind::Publisher => Kind::Subscription,
            Kind::Subscription => Kind::Publisher,
            Kind::Server => Kind::Client,
            Kind::Client => Kind::Server,
        }
    }
}

/// Topic or service of an endpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    /// Full name.
    pub name: String,
    /// Type in DDS form, such as `sensor_msgs::msg::dds_::Imu_`.
    pub dds_type: String,
    /// Type hash `RIHS01_...`; `None`: any.
    pub hash: Option<String>,
}

impl Channel {
    /// Key expression of its samples or requests.
    pub(super) fn key(&self, domain: u16) -> String {
        let (name, hash) = (self.name.trim_matches('/'), self.hash.as_deref());
        format!("{domain}/{name}/{}/{}", self.dds_type, hash.unwrap_or("*"))
    }
}

/// Session of this process as encoded in tokens.
#[derive(Clone, Debug)]
pub(super) struct Session {
    pub domain: u16,
    pub zid: String,
    pub enclave: String,
}

impl Session {
    /// Key expression that matches the tokens of all sessions of the domain.
    pub(super) fn all_tokens(&self) -> String {
        format!("{ADMIN}/{}/**", self.domain)
    }

    /// Token of a node.
    pub(super) fn node_token(&self, node: &PortNode) -> String {
        self.token(node, &node.number.to_string(), "NN")
    }

    /// Token of an endpoint with this number in the session.
    pub(super) fn endpoint_token(
        &self,
        node: &PortNode,
        number: u64,
        kind: Kind,
        channel: &Channel,
        qos: &Qos,
    ) -> String {
        let head = self.token(node, &number.to_string(), kind.code());
        let (name, hash) = (mangle(&channel.name), channel.hash.as_deref());
        let hash = hash.unwrap_or(ANY_HASH);
        format!(
            "{head}/{name}/{}/{hash}/{}",
            channel.dds_type,
            qos_text(qos)
        )
    }

    fn token(&self, node: &PortNode, number: &str, code: &str) -> String {
        let Session {
            domain,
            zid,
            enclave,
        } = self;
        let parts = [enclave, &node.namespace, &node.name].map(|part| mangle(part));
        let [enclave, namespace, name] = parts;
        let node = node.number;
        format!("{ADMIN}/{domain}/{zid}/{node}/{number}/{code}/{enclave}/{namespace}/{name}")
    }
}

/// Gid of an endpoint, derived from its token.
pub(super) fn gid(token: &str) -> EndpointId {
    EndpointId(XxHash3_128::oneshot(token.as_bytes()).to_le_bytes())
}

/// An endpoint of another session.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Token {
    pub kind: Kind,
    pub zid: String,
    /// Full name of its node.
    pub node: String,
    pub channel: Channel,
    pub reliability: Reliability,
    pub durability: Durability,
}

/// Parses the token of an endpoint. `Ok(None)`: a node token. The error describes an invalid token.
pub(super) fn read_token(key: &str) -> Result<Option<Token>, &'static str> {
    if key.len() > MAX_TOKEN_BYTES {
        return Err("too long");
    }
    let parts: Vec<&str> = key.split('/').collect();
    if parts.contains(&"") {
        return Err("a part is empty");
    }
    let [
        ADMIN,
        _domain,
        zid,
        node_number,
        number,
        code,
        _enclave,
        namespace,
        node,
        rest @ ..,
    ] = &parts[..]
    else {
        return Err("too short");
    };
    let numbers = [node_number, number];
    if numbers.iter().any(|text| text.parse::<u64>().is_err()) {
        return Err("a number is malformed");
    }
    if *code == "NN" {
        return Ok(None);
    }
    let Some((_, kind)) = Kind::ALL.iter().find(|(known, _)| known == code) else {
        return Err("unknown kind");
    };
    // Further parts are specific to rmw_zenoh: buffers of other devices.
    let [name, dds_type, hash, qos, ..] = rest else {
        return Err("too short");
    };
    let (reliability, durability) = read_qos(qos).ok_or("unknown QoS")?;
    Ok(Some(Token {
        kind: *kind,
        zid: (*zid).to_owned(),
        node: names::fully_qualified(&demangle(node), &demangle(namespace)),
        channel: Channel {
            name: demangle(name),
            dds_type: (*dds_type).to_owned(),
            hash: Some((*hash).to_owned()),
        },
        reliability,
        durability,
    }))
}

/// Mangles a name: a part of a token has no slash and is not empty.
fn mangle(name: &str) -> String {
    match name {
        "" => "%".to_owned(),
        name => name.replace('/', "%"),
    }
}

fn demangle(part: &str) -> String {
    part.replace('%', "/")
}

/// Reliability, durability, history and depth, deadline, lifespan, liveliness; a field with the default of
/// rmw_zenoh (reliable, volatile, keep last) is empty.
fn qos_text(qos: &Qos) -> String {
    let reliability = match qos.reliability {
        Reliability::Reliable => "",
        Reliability::BestEffort => "2",
    };
    let durability = match qos.durability {
        Durability::Volatile => "",
        Durability::TransientLocal => "1",
    };
    format!("{reliability}:{durability}:,{}:,:,:,,", qos.depth.max(1))
}

fn read_qos(text: &str) -> Option<(Reliability, Durability)> {
    let mut parts = text.split(':');
    // Numbers of rmw; 0 is the system default.
    let reliability = match parts.next()? {
        "" | "0" | "1" => Reliability::Reliable,
        "2" => Reliability::BestEffort,
        _ => return None,
    };
    let durability = match parts.next()? {
        "1" => Durability::TransientLocal,
        "" | "0" | "2" => Durability::Volatile,
        _ => return None,
    };
    // History, deadline, lifespan and liveliness must be present.
    (parts.count() >= 4).then_some((reliability, durability))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";
    const ZID: &str = "aac3178e146ba6f1fc6e6a4085e77f21";

    fn session() -> Session {
        Session {
            domain: 0,
            zid: ZID.to_owned(),
            enclave: "/".to_owned(),
        }
    }

    fn node(namespace: &str) -> PortNode {
        PortNode {
            number: 0,
            namespace: namespace.to_owned(),
            name: "listener".to_owned(),
        }
    }

    fn chatter(name: &str) -> Channel {
        Channel {
            name: name.to_owned(),
            dds_type: "std_msgs::msg::dds_::String_".to_owned(),
            hash: Some(HASH.to_owned()),
        }
    }

    #[test]
    fn keys_and_tokens_are_those_of_the_design_page() {
        let key = chatter("/robot1/chatter").key(2);
        let expected = format!("2/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}");
        assert_eq!(key, expected);
        let any = Channel {
            hash: None,
            ..chatter("/chatter")
        };
        assert_eq!(any.key(0), "0/chatter/std_msgs::msg::dds_::String_/*");
        let of_node = session().node_token(&node("/"));
        assert_eq!(of_node, format!("@ros2_lv/0/{ZID}/0/0/NN/%/%/listener"));
        let token =
            |kind, qos| session().endpoint_token(&node("/"), 10, kind, &chatter("/chatter"), &qos);
        let expected = |code, qos| {
            format!(
                "@ros2_lv/0/{ZID}/0/10/{code}/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{HASH}/{qos}"
            )
        };
        for (kind, code, qos, text) in [
            (Kind::Subscription, "MS", Qos::reliable(10), "::,10:,:,:,,"),
            (Kind::Publisher, "MP", Qos::best_effort(5), "2::,5:,:,:,,"),
            (Kind::Server, "SS", Qos::reliable(10), "::,10:,:,:,,"),
            (Kind::Client, "SC", Qos::latched(1), ":1:,1:,:,:,,"),
        ] {
            assert_eq!(token(kind, qos), expected(code, text));
        }
    }

    #[test]
    fn tokens_are_read_as_they_are_written() {
        let qos = Qos::latched(7);
        let text = session().endpoint_token(
            &node("/robot"),
            10,
            Kind::Publisher,
            &chatter("/robot/a"),
            &qos,
        );
        let read = read_token(&text).unwrap().unwrap();
        let expected = Token {
            kind: Kind::Publisher,
            zid: ZID.to_owned(),
            node: "/robot/listener".to_owned(),
            channel: chatter("/robot/a"),
            reliability: qos.reliability,
            durability: qos.durability,
        };
        assert_eq!(read, expected);
        let with_buffers = format!("{text}/backends:cpu:");
        assert_eq!(read_token(&with_buffers), Ok(Some(expected)));
        let of_node = session().node_token(&node("/"));
        assert_eq!(read_token(&of_node), Ok(None));
    }

    #[test]
    fn gids_are_the_hash_of_the_token() {
        // Of the reference implementation, the low half first, each in little-endian order.
        for (text, expected) in [
            ("", "7f498d4624c30160d8984701d306aa99"),
            ("a", "1f4e961eb632c6e63468f15a70af6fa9"),
        ] {
            assert_eq!(gid(text).hex(), expected);
        }
    }

    #[test]
    fn whatever_is_no_token_is_refused() {
        let whole = format!(
            "@ros2_lv/0/{ZID}/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{HASH}/::,7:,:,:,,"
        );
        assert!(read_token(&whole).unwrap().is_some());
        for cut in 0..whole.len() {
            // Cut in its last part it may still be whole.
            let text = &whole[..cut];
            let is_whole = text.contains("/::,7:,:,:");
            assert_eq!(read_token(text).is_ok(), is_whole, "{text}");
        }
        let long = format!("{whole}/{}", "x".repeat(MAX_TOKEN_BYTES));
        for wrong in [
            whole.replace("MP", "XX"),
            whole.replace("/10/", "/ten/"),
            whole.replace("::,7", "9::,7"),
            whole.replace("::,7", ":9:,7"),
            whole.replace("/%/%/", "///"),
            whole.replace("@ros2_lv", "@other"),
            long,
            "\u{e4}/\u{e4}".to_owned(),
        ] {
            assert!(read_token(&wrong).is_err(), "{wrong}");
        }
    }
}
