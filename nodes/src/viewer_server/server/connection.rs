//! One connection: its request, then a response or a WebSocket.

use std::io;
use std::net::{IpAddr, TcpStream};
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_tungstenite::WebSocketStream;
use async_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use async_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use async_tungstenite::tungstenite::{self, Message};
use futures::stream::FuturesUnordered;
use futures::{AsyncReadExt, AsyncWriteExt, SinkExt, StreamExt};
use futures_rustls::TlsAcceptor;
use smol::Async;
use smol::channel::Receiver;
use smol::future::{or, pending, poll_once, yield_now};

use super::connection_limit::ConnectionLimit;
use super::handshake::{self, Stream};
use super::rate_limit::RateLimit;
use super::stream::{ClientStream, Progress, within};
use crate::viewer_server::broadcast::{Broadcaster, Outgoing};
use crate::viewer_server::http::{
    Decision, Head, HeadError, MAX_HEAD_BYTES, RequestAuth, Response,
};
use crate::viewer_server::protocol::message_data;
use crate::viewer_server::session::{
    ClientSession, Input, InputRefusal, MAX_MESSAGE_BYTES, MESSAGE_HEAD_BYTES, SessionAction,
};

/// Timeout of receiving a request.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Timeout of sending a response.
const ANSWER_TIME: Duration = Duration::from_secs(20);
/// Timeout of sending the close reason.
const LAST_TIME: Duration = Duration::from_secs(1);
/// Socket send buffer, bytes.
const SEND_BUFFER_BYTES: usize = 512 << 10;

/// Limits of connections before they become clients; clients are limited by [`Broadcaster`].
#[derive(Default)]
pub struct ConnectionLimits {
    /// Connections with an incomplete request.
    asking: Rc<ConnectionLimit>,
    /// Connections whose response is being sent.
    answered: Rc<ConnectionLimit>,
}

/// Serves a connection until it ends.
pub async fn serve(
    stream: TcpStream,
    from: IpAddr,
    auth: Arc<RequestAuth>,
    tls: Option<TlsAcceptor>,
    broadcaster: Arc<Broadcaster>,
    limits: &ConnectionLimits,
) -> io::Result<()> {
    rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER_BYTES)?;
    stream.set_nodelay(true)?;
    let stream = ClientStream::new(Async::new(stream)?);
    let progress = stream.progress();
    let asking = limits.asking.enter(from);
    broadcaster.count_displaced(limits.asking.take_displaced());
    let asked = async {
        let (mut stream, lacks_tls) = handshake::open(stream, tls, &broadcaster).await?;
        let head = within(HEAD_TIME, read_head(&mut stream)).await?;
        Ok((stream, lacks_tls, head))
    };
    let (mut stream, lacks_tls, head) = asking.served(asked).await?;
    drop(asking);
    let decide = |head| match lacks_tls {
        true => auth.decide_without_tls(&head),
        false => auth.decide(&head),
    };
    let answer = match head.map(decide) {
        Ok(Decision::Upgrade(head)) => match broadcaster.enter() {
            Some((id, woken)) => {
                let done = talk(stream, progress, head, id, woken, &broadcaster).await;
                if matches!(&done, Err(error) if error.kind() == io::ErrorKind::TimedOut) {
                    broadcaster.count_stalled();
                }
                broadcaster.leave(id);
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
    let answered = limits.answered.enter(from);
    broadcaster.count_displaced(limits.answered.take_displaced());
    let answer = async {
        stream.write_all(&answer.bytes()).await?;
        stream.close().await
    };
    answered.served(within(ANSWER_TIME, answer)).await
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
            // Clients send nothing more before the response.
            Ok(Some((head, _))) => return Ok(Ok(head)),
            Err(error) => return Ok(Err(error)),
        }
    }
}

/// Sends queued messages and handles received ones until either side closes.
async fn talk(
    mut stream: Stream,
    progress: Progress,
    head: String,
    id: u64,
    woken: Receiver<()>,
    broadcaster: &Broadcaster,
) -> io::Result<()> {
    let upgraded = async {
        stream.write_all(head.as_bytes()).await?;
        stream.flush().await
    };
    progress.sent(upgraded).await?;
    let offer = broadcaster.offer_of_bridge();
    let longest = Some(offer.max_message_bytes());
    let config = WebSocketConfig::default()
        .max_message_size(longest)
        .max_frame_size(longest);
    let mut socket = WebSocketStream::from_raw_socket(stream, Role::Server, Some(config)).await;
    let mut session = ClientSession::new(offer);
    let mut rate_limit = RateLimit::new(offer.stream_bytes_per_s, Instant::now());
    let mut asked = FuturesUnordered::new();
    loop {
        // Received messages first, so that an unsubscription takes effect at once.
        let event = match poll_once(socket.next()).await {
            Some(come) => Event::Come(come),
            None => match broadcaster.next(id) {
                Some(next) => {
                    send(&mut socket, &progress, next).await?;
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
        if matches!(event, Event::Come(_)) {
            // A client that sends continuously must not block the others of this thread.
            yield_now().await;
        }
        let step = match event {
            Event::Woken => SessionAction::Done,
            Event::Answered(messages) => {
                session.answered();
                messages
                    .into_iter()
                    .for_each(|message| broadcaster.enqueue(id, message));
                SessionAction::Done
            }
            // Rate limited before parsing.
            Event::Come(Some(Ok(message))) if !is_paced(&mut rate_limit, message.len()) => {
                let refusal = InputRefusal::TooMuch;
                if let Some(bridge) = broadcaster.bridge() {
                    bridge.inputs().refused(refusal);
                }
                broadcaster.refuse(id, refusal);
                SessionAction::Done
            }
            Event::Come(Some(Ok(Message::Text(text)))) => session.on_text(&text),
            Event::Come(Some(Ok(Message::Binary(bytes)))) => session.on_binary(&bytes),
            Event::Come(Some(Ok(Message::Close(_))) | None) => return Ok(()),
            // Flushed before reading more: continuous pings would fill the memory with pongs.
            Event::Come(Some(Ok(Message::Ping(_)))) => {
                let answer = async { socket.flush().await.map_err(io::Error::other) };
                progress.sent(answer).await?;
                SessionAction::Done
            }
            Event::Come(Some(Ok(_))) => SessionAction::Done,
            Event::Come(Some(Err(error))) => {
                if matches!(error, tungstenite::Error::Capacity(_)) {
                    too_long(&mut socket, broadcaster).await;
                }
                return Err(io::Error::other(error));
            }
        };
        match step {
            SessionAction::Subscribe(wishes) => {
                for wish in wishes {
                    broadcaster.subscribe(id, wish.id, wish.channel_id);
                }
            }
            SessionAction::Watch(names, watch) => broadcaster.watch(id, names, watch),
            SessionAction::Graph(follow) => broadcaster.follow_graph(id, follow),
            SessionAction::Unsubscribe(subscriptions) => {
                broadcaster.unsubscribe(id, &subscriptions)
            }
            SessionAction::Request(request) => match broadcaster.bridge() {
                Some(bridge) => asked.push(bridge.request(request)),
                None => session.answered(),
            },
            SessionAction::Input(input) => {
                if let Some(refusal) = take(broadcaster, id, &mut rate_limit, input) {
                    broadcaster.refuse(id, refusal);
                }
            }
            SessionAction::Reply(text) => broadcaster.enqueue(id, Outgoing::Text(text)),
            SessionAction::Done => {}
        }
    }
}

/// Event of a connection.
enum Event {
    Come(Option<Result<Message, tungstenite::Error>>),
    Answered(Vec<Outgoing>),
    Woken,
}

/// True for a short message, or one within the rate limit of headsets.
fn is_paced(rate_limit: &mut RateLimit, bytes: usize) -> bool {
    bytes <= MAX_MESSAGE_BYTES || rate_limit.admits(bytes, Instant::now())
}

/// Passes a headset message to the bridge within the client's rate limit; rejected ones are counted.
fn take(
    broadcaster: &Broadcaster,
    id: u64,
    rate_limit: &mut RateLimit,
    input: Input,
) -> Option<InputRefusal> {
    let bridge = broadcaster.bridge()?;
    // A long message was charged on reception.
    let head_and_message = input.bytes.len() + MESSAGE_HEAD_BYTES;
    let is_long = head_and_message > MAX_MESSAGE_BYTES;
    let taken = match is_long || rate_limit.admits(input.bytes.len(), Instant::now()) {
        true => bridge.take(id, input),
        false => Err(InputRefusal::TooMuch),
    };
    let refusal = taken.err()?;
    bridge.inputs().refused(refusal);
    Some(refusal)
}

/// Closes the connection with a reason: the rest of an oversized message cannot be skipped.
async fn too_long(socket: &mut WebSocketStream<Stream>, broadcaster: &Broadcaster) {
    let has_headset = broadcaster.offer_of_bridge().stream_bytes_per_s > 0;
    if let Some(bridge) = broadcaster.bridge().filter(|_| has_headset) {
        bridge.inputs().refused(InputRefusal::TooLong);
    }
    let close = CloseFrame {
        code: CloseCode::Size,
        reason: match has_headset {
            true => InputRefusal::TooLong.words().into(),
            false => "the message exceeds the size limit".into(),
        },
    };
    let closed = async {
        let sent = socket.send(Message::Close(Some(close))).await;
        sent.map_err(io::Error::other)?;
        // Closing a socket with unread bytes resets it, which would lose the reason.
        let mut rest = vec![0; 1 << 16];
        while socket.get_mut().read(&mut rest).await? > 0 {}
        Ok(())
    };
    // The client may be gone.
    let _ = within(LAST_TIME, closed).await;
}

/// Sends one message; [`Outgoing::Close`] is an error.
async fn send(
    socket: &mut WebSocketStream<Stream>,
    progress: &Progress,
    next: Outgoing,
) -> io::Result<()> {
    let message = match next {
        Outgoing::Text(text) => Message::Text(text.into()),
        Outgoing::Binary(bytes) => Message::Binary(bytes.into()),
        Outgoing::Data(id, entry) => {
            Message::Binary(message_data(id, entry.stamp_ns, &entry.cdr).into())
        }
        Outgoing::Close => return Err(io::ErrorKind::TimedOut.into()),
    };
    let sent = async { socket.send(message).await.map_err(io::Error::other) };
    progress.sent(sent).await
}
