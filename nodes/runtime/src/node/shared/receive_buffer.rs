//! Receive buffer that the kernel grants to sockets.

use socket2::{Domain, Socket, Type};

use crate::config::env::TransportKind;
use crate::transport::port::RECEIVE_BUFFER_BYTES;

/// Smallest sufficient receive buffer: twice the largest message; with less, bursts of large messages are lost.
pub(super) const ENOUGH_BYTES: usize = 16 << 20;

/// Receive buffer that the kernel grants a socket, probed once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReceiveBuffer {
    pub(super) bytes: Option<usize>,
}

impl ReceiveBuffer {
    pub(crate) fn probe(transport: TransportKind) -> Self {
        let bytes = match transport {
            TransportKind::Dds => granted_receive_buffer(RECEIVE_BUFFER_BYTES),
            // TCP has flow control.
            #[cfg(feature = "zenoh")]
            TransportKind::Zenoh => None,
        };
        Self { bytes }
    }

    pub(super) fn is_short(self) -> bool {
        self.bytes.is_some_and(|bytes| bytes < ENOUGH_BYTES)
    }

    /// Logs the command that enlarges a short buffer.
    pub(crate) fn warn_if_short(self) {
        if let Some(bytes) = self.bytes.filter(|_| self.is_short()) {
            log::warn!(
                "sockets get a receive buffer of {bytes} bytes; clouds above {} bytes may be lost. \
                 Run: sudo sysctl -w net.core.rmem_max={ENOUGH_BYTES}",
                bytes / 2,
            );
        }
    }
}

/// Receive buffer (bytes) granted by the kernel for a request of `bytes`. `None`: unknown.
pub(super) fn granted_receive_buffer(bytes: usize) -> Option<usize> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, None).ok()?;
    // The kernel reduces the size without an error.
    socket.set_recv_buffer_size(bytes).ok()?;
    socket.recv_buffer_size().ok()
}
