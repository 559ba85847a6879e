//! One connection: its request, then nothing more or a WebSocket.

use std::io;
use std::net::TcpStream;
use std::sync::Arc;
use std::time::Duration;

use async_tungstenite::WebSocketStream;
use async_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};
use async_tungstenite::tungstenite::{self, Message};
use futures::stream::FuturesUnordered;
use futures::{AsyncReadExt, AsyncWriteExt, StreamExt};
use smol::channel::Receiver;
use smol::future::{or, pending, poll_once};
use smol::{Async, Timer};

use super::desk::{Desk, Step};
use super::http::{Decision, Gate, Head, HeadError, MAX_HEAD_BYTES, Response};
use super::hub::Hub;
use super::outbox::Outgoing;
use super::protocol::message_data;

/// Time for a request to come.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Time for one message, or one file, to be taken.
const SEND_TIME: Duration = Duration::from_secs(20);
/// Longest message of a client, bytes.
const MAX_INBOUND_BYTES: usize = 64 << 10;
/// Bytes that the kernel keeps until a client takes them.
const SEND_BUFFER_BYTES: usize = 512 << 10;

type Stream = Async<TcpStream>;

/// Serves a connection to its end.
pub async fn serve(stream: TcpStream, gate: Arc<Gate>, hub: Arc<Hub>) -> io::Result<()> {
    rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER_BYTES)?;
    stream.set_nodelay(true)?;
    let mut stream = Async::new(stream)?;
    let head = within(HEAD_TIME, read_head(&mut stream)).await?;
    let answer = match head.map(|head| gate.decide(&head)) {
        Ok(Decision::Upgrade(head)) => match hub.enter() {
            Some((id, woken)) => {
                let done = talk(stream, head, id, woken, &hub).await;
                hub.leave(id);
                return done;
            }
            None => Response::full(),
        },
        Ok(Decision::Answer(answer)) => answer,
        Err(error) => {
            log::debug!("refused: {error}");
            Response::bad_request()
        }
    };
    within(SEND_TIME, stream.write_all(&answer.bytes())).await?;
    within(SEND_TIME, stream.close()).await
}

async fn read_head(stream: &mut Stream) -> io::Result<Result<Head, HeadError>> {
    let mut bytes = vec![0; MAX_HEAD_BYTES + 1];
    let mut length = 0;
    loop {
        let Some(free) = bytes.get_mut(length..).filter(|free| !free.is_empty()) else {
            return Ok(Err(HeadError::TooLong));
        };
        let read = stream.read(free).await?;
        if read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        length += read;
        match Head::parse(bytes.get(..length).unwrap_or_default()) {
            Ok(None) => {}
            // Nobody who speaks the protocol sends more before the answer.
            Ok(Some((head, _))) => return Ok(Ok(head)),
            Err(error) => return Ok(Err(error)),
        }
    }
}

/// Sends what waits and takes what comes until either side ends it.
async fn talk(
    mut stream: Stream,
    head: String,
    id: u64,
    woken: Receiver<()>,
    hub: &Hub,
) -> io::Result<()> {
    within(SEND_TIME, stream.write_all(head.as_bytes())).await?;
    let config = WebSocketConfig::default()
        .max_message_size(Some(MAX_INBOUND_BYTES))
        .max_frame_size(Some(MAX_INBOUND_BYTES));
    let mut socket = WebSocketStream::from_raw_socket(stream, Role::Server, Some(config)).await;
    let mut desk = Desk::new(hub.offer_of_bridge());
    let mut asked = FuturesUnordered::new();
    loop {
        // What has come goes first: who unsubscribes gets no more.
        let event = match poll_once(socket.next()).await {
            Some(come) => Event::Come(come),
            None => match hub.next(id) {
                Some(next) => {
                    send(&mut socket, next).await?;
                    continue;
                }
                None => {
                    let woken = async {
                        let _ = woken.recv().await;
                        Event::Woken
                    };
                    let answered = async {
                        match asked.next().await {
                            Some(messages) => Event::Answered(messages),
                            None => pending().await,
                        }
                    };
                    let come = async { Event::Come(socket.next().await) };
                    or(answered, or(come, woken)).await
                }
            },
        };
        let step = match event {
            Event::Woken => Step::Done,
            Event::Answered(messages) => {
                desk.answered();
                messages
                    .into_iter()
                    .for_each(|message| hub.tell(id, message));
                Step::Done
            }
            Event::Come(Some(Ok(Message::Text(text)))) => desk.text(&text),
            Event::Come(Some(Ok(Message::Binary(bytes)))) => desk.data(&bytes),
            Event::Come(Some(Ok(Message::Close(_))) | None) => return Ok(()),
            Event::Come(Some(Ok(_))) => Step::Done,
            Event::Come(Some(Err(error))) => return Err(io::Error::other(error)),
        };
        match step {
            Step::Subscribe(wishes) => {
                for wish in wishes {
                    hub.subscribe(id, wish.id, wish.channel_id);
                }
            }
            Step::Watch(names, watch) => hub.watch(id, names, watch),
            Step::Graph(follow) => hub.follow_graph(id, follow),
            Step::Unsubscribe(subscriptions) => hub.unsubscribe(id, &subscriptions),
            Step::Ask(ask) => match hub.bridge() {
                Some(bridge) => asked.push(bridge.ask(ask)),
                None => desk.answered(),
            },
            Step::Tell(text) => hub.tell(id, Outgoing::Text(text)),
            Step::Done => {}
        }
    }
}

/// Event of a connection.
enum Event {
    Come(Option<Result<Message, tungstenite::Error>>),
    Answered(Vec<Outgoing>),
    Woken,
}

/// Sends one message; an error after the last.
async fn send(socket: &mut WebSocketStream<Stream>, next: Outgoing) -> io::Result<()> {
    let message = match next {
        Outgoing::Text(text) => Message::Text(text.into()),
        Outgoing::Binary(bytes) => Message::Binary(bytes.into()),
        Outgoing::Data(id, entry) => {
            Message::Binary(message_data(id, entry.stamp_ns, &entry.cdr).into())
        }
        Outgoing::Close => return Err(io::Error::other("too many answers wait")),
    };
    let sent = async { socket.send(message).await.map_err(io::Error::other) };
    within(SEND_TIME, sent).await
}

async fn within<T>(limit: Duration, work: impl Future<Output = io::Result<T>>) -> io::Result<T> {
    let late = async {
        Timer::after(limit).await;
        Err(io::ErrorKind::TimedOut.into())
    };
    or(work, late).await
}
