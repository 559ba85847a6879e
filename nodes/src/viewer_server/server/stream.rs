//! Client stream: records the client's last progress, and yields between reads.

use std::cell::Cell;
use std::io;
use std::net::TcpStream;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};

use futures::{AsyncRead, AsyncWrite};
use smol::future::or;
use smol::{Async, Timer};

/// Time without progress after which a client is closed.
pub const STALL_TIME: Duration = Duration::from_secs(20);
/// Reads before the thread's other connections have a turn: 2 MB in WebSocket reads
/// of 128 KiB. Empty frames are read in a loop within one poll.
const READS_PER_TURN: u32 = 16;

/// Completes an operation within a time limit.
pub async fn within<T>(
    limit: Duration,
    work: impl Future<Output = io::Result<T>>,
) -> io::Result<T> {
    let late = async {
        Timer::after(limit).await;
        Err(io::ErrorKind::TimedOut.into())
    };
    or(work, late).await
}

/// Time of the client's last progress.
#[derive(Clone)]
pub struct Progress(Rc<Cell<Instant>>);

impl Progress {
    /// Completes a send operation.
    ///
    /// # Errors
    /// [`io::ErrorKind::TimedOut`] once the client has taken nothing for [`STALL_TIME`].
    pub async fn sent<T>(&self, work: impl Future<Output = io::Result<T>>) -> io::Result<T> {
        self.0.set(Instant::now());
        let stalled = async {
            loop {
                let left = STALL_TIME.saturating_sub(self.0.get().elapsed());
                if left.is_zero() {
                    return Err(io::ErrorKind::TimedOut.into());
                }
                Timer::after(left).await;
            }
        };
        or(work, stalled).await
    }
}

/// The stream.
pub struct ClientStream {
    inner: Async<TcpStream>,
    progress: Progress,
    reads: u32,
}

impl ClientStream {
    pub fn new(inner: Async<TcpStream>) -> Self {
        Self {
            inner,
            progress: Progress(Rc::new(Cell::new(Instant::now()))),
            reads: 0,
        }
    }

    /// First byte of the client, which stays to be read.
    pub async fn first_byte(&self) -> io::Result<u8> {
        let mut first = [0];
        match self.inner.peek(&mut first).await? {
            0 => Err(io::ErrorKind::UnexpectedEof.into()),
            _ => Ok(first[0]),
        }
    }

    /// Progress of its client.
    pub fn progress(&self) -> Progress {
        self.progress.clone()
    }
}

impl AsyncRead for ClientStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &mut [u8],
    ) -> Poll<io::Result<usize>> {
        if self.reads == READS_PER_TURN {
            self.reads = 0;
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        let read = Pin::new(&mut self.inner).poll_read(context, bytes);
        self.reads = match read.is_ready() {
            true => self.reads + 1,
            false => 0,
        };
        read
    }
}

impl AsyncWrite for ClientStream {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.inner).poll_write(context, bytes));
        if written.as_ref().is_ok_and(|bytes| *bytes > 0) {
            self.progress.0.set(Instant::now());
        }
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_flush(context)
    }

    fn poll_close(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_close(context)
    }
}
