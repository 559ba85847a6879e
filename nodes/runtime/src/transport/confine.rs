//! Restriction of a transport's sockets to the loopback interface. Cyclone binds receiving sockets to all
//! addresses, regardless of its configured interfaces.

use std::collections::BTreeSet;
use std::fs;
use std::os::fd::{BorrowedFd, RawFd};
use std::path::PathBuf;

use socket2::{SockRef, Type};

const LOOPBACK: &[u8] = b"lo";

/// Runs `make` and binds the datagram sockets opened by it to the loopback interface.
pub(crate) fn to_loopback<T>(make: impl FnOnce() -> T) -> T {
    let before = open_files();
    let made = make();
    for (file, _) in open_files().difference(&before) {
        // SAFETY: borrowed for two calls, each of which fails if it has been closed meanwhile.
        let file = unsafe { BorrowedFd::borrow_raw(*file) };
        let socket = SockRef::from(&file);
        if socket.r#type().is_ok_and(|kind| kind == Type::DGRAM)
            && let Err(error) = socket.bind_device(Some(LOOPBACK))
        {
            log::warn!(
                "a socket listens beyond loopback, though nothing else is asked for: {error}"
            );
        }
    }
    made
}

/// Open files of the process, number and target: numbers are reused.
fn open_files() -> BTreeSet<(RawFd, PathBuf)> {
    let files = fs::read_dir("/proc/self/fd").into_iter().flatten();
    let files = files.filter_map(|file| {
        let path = file.ok()?.path();
        let number = path.file_name()?.to_str()?.parse().ok()?;
        Some((number, fs::read_link(path).ok()?))
    });
    files.collect()
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    #[test]
    fn datagram_sockets_that_are_opened_are_bound_and_no_others() {
        let open = || UdpSocket::bind("0.0.0.0:0").unwrap();
        let (before, made) = (open(), to_loopback(open));
        let device = |socket: &UdpSocket| SockRef::from(socket).device().unwrap();
        assert_eq!(
            (device(&before), device(&made)),
            (None, Some(LOOPBACK.to_vec()))
        );
    }
}
