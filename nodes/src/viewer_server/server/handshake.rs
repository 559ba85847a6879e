//! Start of a connection: a TLS handshake, if the server has a certificate.

use std::io;
use std::time::Duration;

use futures::future::Either;
use futures_rustls::TlsAcceptor;
use futures_rustls::server::TlsStream;

use super::stream::{ClientStream, within};
use crate::viewer_server::broadcast::Broadcaster;

/// Timeout of the first byte, and of the handshake after it.
const TIME: Duration = Duration::from_secs(5);
/// First byte of a TLS connection: a record of the handshake.
const TLS_HANDSHAKE: u8 = 0x16;

/// Stream of a client, with or without TLS. TLS is above the limits of [`ClientStream`], so that they hold for its records too.
pub type Stream = Either<ClientStream, Box<TlsStream<ClientStream>>>;

/// Opens a connection; the flag is true if it has no TLS where the server has.
pub async fn open(
    stream: ClientStream,
    tls: Option<TlsAcceptor>,
    broadcaster: &Broadcaster,
) -> io::Result<(Stream, bool)> {
    let Some(tls) = tls else {
        return Ok((Either::Left(stream), false));
    };
    let first = within(TIME, stream.first_byte()).await;
    if first.inspect_err(|_| broadcaster.count_tls_failed())? != TLS_HANDSHAKE {
        broadcaster.count_tls_plain();
        return Ok((Either::Left(stream), true));
    }
    let shaken = within(TIME, tls.accept(stream)).await;
    let stream = shaken.inspect_err(|_| broadcaster.count_tls_failed())?;
    Ok((Either::Right(Box::new(stream)), false))
}
