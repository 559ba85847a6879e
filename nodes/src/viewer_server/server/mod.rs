//! Server thread: accepts connections until it is finished.

mod connection;
pub(super) mod connection_limit;
mod handshake;
mod rate_limit;
pub(super) mod stream;

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::rc::Rc;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use futures_rustls::TlsAcceptor;
use lattice_runtime::logging::Throttle;
use rustls::ServerConfig;
use smol::channel::{Sender, bounded};
use smol::{Async, LocalExecutor, Timer};

use self::connection::ConnectionLimits;
use super::broadcast::Broadcaster;
use super::http::RequestAuth;

/// Time for clients to read the last messages.
const LAST_TIME: Duration = Duration::from_secs(1);

/// A running server.
pub struct Server {
    broadcaster: Arc<Broadcaster>,
    address: SocketAddr,
    stop: Sender<()>,
    thread: JoinHandle<()>,
}

impl Server {
    /// Listens on an address, for TLS alone if there is a configuration of it.
    pub fn start(
        address: SocketAddr,
        auth: RequestAuth,
        tls: Option<Arc<ServerConfig>>,
        broadcaster: Arc<Broadcaster>,
    ) -> io::Result<Self> {
        let taken = |error: io::Error| {
            io::Error::new(
                error.kind(),
                format!(
                    "{address}: {error}; another viewer may have the port: choose one by `port`"
                ),
            )
        };
        let listener = TcpListener::bind(address).map_err(taken)?;
        let address = listener.local_addr()?;
        let listener = Async::new(listener)?;
        let (stop, stopped) = bounded::<()>(1);
        let served = Arc::clone(&broadcaster);
        let auth = RequestAuth {
            secure: tls.is_some(),
            ..auth
        };
        let tls = tls.map(TlsAcceptor::from);
        let thread = std::thread::Builder::new()
            .name("viewer".to_owned())
            .spawn(move || {
                let executor = LocalExecutor::new();
                let accept = accept(&executor, listener, Arc::new(auth), tls, broadcaster);
                let ended = async {
                    // Ends when the sender closes.
                    let _ = stopped.recv().await;
                };
                smol::future::block_on(executor.run(smol::future::or(accept, ended)));
            })?;
        Ok(Self {
            broadcaster: served,
            address,
            stop,
            thread,
        })
    }

    /// Listening address.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Lets clients read queued messages, for at most a second, and closes all connections.
    pub fn finish(self) {
        let late = Instant::now() + LAST_TIME;
        while !self.broadcaster.is_drained() && Instant::now() < late {
            std::thread::sleep(Duration::from_millis(10));
        }
        self.stop.close();
        if self.thread.join().is_err() {
            log::error!("the viewer's thread panicked");
        }
    }
}

async fn accept(
    executor: &LocalExecutor<'_>,
    listener: Async<TcpListener>,
    auth: Arc<RequestAuth>,
    tls: Option<TlsAcceptor>,
    broadcaster: Arc<Broadcaster>,
) {
    let limits = Rc::new(ConnectionLimits::default());
    let warnings = Throttle::new(Duration::from_secs(5));
    loop {
        let (stream, from) = match accepted(&listener).await {
            Ok(stream) => stream,
            Err(error) => {
                // Such as a lack of descriptors, which may pass.
                if let Some(more) = warnings.check() {
                    log::warn!("connection not accepted: {error} ({more} more like it)");
                }
                Timer::after(Duration::from_millis(100)).await;
                continue;
            }
        };
        let (auth, tls, broadcaster, limits) = (
            Arc::clone(&auth),
            tls.clone(),
            Arc::clone(&broadcaster),
            Rc::clone(&limits),
        );
        executor
            .spawn(async move {
                if let Err(error) =
                    connection::serve(stream, from, auth, tls, broadcaster, &limits).await
                {
                    log::debug!("a connection ended: {error}");
                }
            })
            .detach();
    }
}

async fn accepted(listener: &Async<TcpListener>) -> io::Result<(TcpStream, IpAddr)> {
    let (stream, from) = listener.accept().await?;
    Ok((stream.into_inner()?, from.ip()))
}
