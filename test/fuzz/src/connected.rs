//! Bodies of the targets of what clients of the viewer send: heads of requests, messages of the protocol.

use lattice_nodes::viewer_server::{
    AdvertisedService, ClientSession, Head, Offer, OpenTopic, RequestAuth, SessionAction,
};

/// Reads the head of a request, and decides on it.
pub fn http_head(bytes: &[u8]) {
    if let Ok(Some((head, length))) = Head::parse(bytes) {
        assert!(length <= bytes.len());
        let token = Some("secret".to_owned());
        for auth in [
            RequestAuth::default(),
            RequestAuth {
                token,
                ..RequestAuth::default()
            },
        ] {
            auth.decide(&head);
        }
        // The same once more, whatever follows it.
        let again = Head::parse(&[&bytes[..length], b"more"].concat());
        assert_eq!(again, Ok(Some((head, length))));
    }
}

/// Gives one client's messages to a session that offers all, and to one that offers nothing: kind, length (two
/// bytes), message, and so on.
pub fn client_message(bytes: &[u8]) {
    let service = AdvertisedService {
        id: 0,
        name: "/lattice_mapper/reset".to_owned(),
        type_name: "std_srvs/srv/Trigger",
        request_schema: String::new(),
        response_schema: String::new(),
    };
    let topic = OpenTopic {
        name: "/goal_pose".to_owned(),
        type_name: "geometry_msgs/msg/PoseStamped",
        stream_bytes: None,
    };
    let stream = OpenTopic {
        name: "/headset/pose".to_owned(),
        type_name: "geometry_msgs/msg/PoseStamped",
        stream_bytes: Some(100_000),
    };
    let (all, nothing) = (
        Offer {
            services: vec![service],
            topics: vec![topic, stream],
            parameters: true,
            graph: true,
            stream_bytes_per_s: 1_000_000,
        },
        Offer::default(),
    );
    for (offer, may_ask) in [(&all, true), (&nothing, false)] {
        let mut session = ClientSession::new(offer);
        let mut asked = 0_usize;
        let mut rest = bytes;
        while let [kind, low, high, tail @ ..] = rest {
            let length = usize::from(u16::from_le_bytes([*low, *high])).min(tail.len());
            let (body, tail) = tail.split_at(length);
            rest = tail;
            let step = match kind % 3 {
                0 => session.on_text(&String::from_utf8_lossy(body)),
                1 => session.on_binary(body),
                _ => {
                    session.answered();
                    asked = asked.saturating_sub(1);
                    SessionAction::Done
                }
            };
            match step {
                SessionAction::Request(_) => {
                    asked += 1;
                    assert!(may_ask && asked <= 16);
                }
                SessionAction::Input(input) => assert!(may_ask && input.topic == 1),
                _ => {}
            }
        }
    }
}

/// Seeds of [`http_head`].
pub fn head_seeds() -> Vec<Vec<u8>> {
    [
        "GET / HTTP/1.1\r\nHost: localhost:8765\r\n\r\n",
        "GET /main.js?token=secret HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: lattice=secret\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://localhost\r\nConnection: Upgrade\r\n\
         Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
         Sec-WebSocket-Protocol: foxglove.sdk.v1, foxglove.websocket.v1\r\n\r\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

/// Seeds of [`client_message`].
pub fn client_seeds() -> Vec<Vec<u8>> {
    let texts = [
        r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]}"#,
        r#"{"op":"unsubscribe","subscriptionIds":[0]}"#,
        r#"{"op":"advertise","channels":[{"id":1,"topic":"/goal_pose","encoding":"cdr","schemaName":"geometry_msgs/msg/PoseStamped"}]}"#,
        r#"{"op":"advertise","channels":[{"id":2,"topic":"/headset/pose","encoding":"json","schemaName":"geometry_msgs/msg/PoseStamped"}]}"#,
        r#"{"op":"getParameters","parameterNames":["/a.b"],"id":"x"}"#,
        r#"{"op":"setParameters","parameters":[{"name":"/a.b","value":3,"type":"float64"}]}"#,
        r#"{"op":"unadvertise","channelIds":[1]}"#,
        r#"{"op":"subscribeConnectionGraph"}"#,
        r#"{"op":"unsubscribeConnectionGraph"}"#,
    ];
    let call = [
        &[2, 0, 0, 0, 0, 9, 0, 0, 0, 3, 0, 0, 0][..],
        b"cdr",
        &[0, 1, 0, 0, 0],
    ]
    .concat();
    let message = vec![1, 1, 0, 0, 0, 0, 1, 0, 0];
    let input = vec![1, 2, 0, 0, 0, b'{', b'}'];
    let texts = texts.map(|text| (0, text.as_bytes().to_vec()));
    let all = texts
        .into_iter()
        .chain([(1, call), (1, message), (1, input), (2, Vec::new())]);
    let one = |(kind, body): (u8, Vec<u8>)| {
        let length = u16::try_from(body.len()).unwrap().to_le_bytes();
        [&[kind][..], &length, &body].concat()
    };
    let each: Vec<Vec<u8>> = all.map(one).collect();
    [vec![each.concat()], each].concat()
}
