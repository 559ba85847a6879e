//! Limit of connections that are not clients yet: in total, and per address.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::net::{IpAddr, Ipv6Addr};
use std::rc::Rc;

use smol::channel::{Receiver, Sender, bounded};
use smol::future::or;

/// Limit of connections.
pub const MAX_CONNECTIONS: usize = 64;
/// Limit per address: two pages, each with the six connections that browsers open, and a few more.
pub const MAX_PER_ADDRESS: usize = 16;

/// Set of connections. A new connection above the limit of its address displaces the oldest of that address; above
/// the total limit, the oldest of the address with the most.
#[derive(Default)]
pub struct ConnectionLimit(RefCell<Places>);

#[derive(Default)]
struct Places {
    /// Connections in the order of arrival.
    taken: VecDeque<Place>,
    next: u64,
    displaced: u64,
}

struct Place {
    id: u64,
    address: IpAddr,
    /// Dropping it ends the connection.
    _keep: Sender<()>,
}

/// A connection in the set; dropping it removes it.
pub struct ConnectionSlot {
    limit: Rc<ConnectionLimit>,
    id: u64,
    displaced: Receiver<()>,
}

impl ConnectionLimit {
    /// Adds a connection, displacing another one if needed.
    pub fn enter(self: &Rc<Self>, from: IpAddr) -> ConnectionSlot {
        let mut places = self.0.borrow_mut();
        let address = network(from);
        let mut counts = BTreeMap::<IpAddr, usize>::new();
        for place in &places.taken {
            *counts.entry(place.address).or_default() += 1;
        }
        let most = counts.iter().max_by_key(|(_, count)| **count);
        let full = match counts.get(&address) {
            Some(count) if *count >= MAX_PER_ADDRESS => Some(address),
            _ if places.taken.len() >= MAX_CONNECTIONS => most.map(|(address, _)| *address),
            _ => None,
        };
        if let Some(full) = full
            && let Some(oldest) = places.taken.iter().position(|of| of.address == full)
        {
            places.taken.remove(oldest);
            places.displaced += 1;
        }
        let (keep, displaced) = bounded(1);
        let id = places.next;
        places.next += 1;
        places.taken.push_back(Place {
            id,
            address,
            _keep: keep,
        });
        let limit = Rc::clone(self);
        ConnectionSlot {
            limit,
            id,
            displaced,
        }
    }

    /// Connections displaced since the last call.
    pub fn take_displaced(&self) -> u64 {
        std::mem::take(&mut self.0.borrow_mut().displaced)
    }
}

impl ConnectionSlot {
    /// Runs the work until the connection is displaced.
    pub async fn served<T>(&self, work: impl Future<Output = io::Result<T>>) -> io::Result<T> {
        let displaced = async {
            let _ = self.displaced.recv().await;
            Err(io::ErrorKind::ConnectionAborted.into())
        };
        or(work, displaced).await
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        let taken = &mut self.limit.0.borrow_mut().taken;
        taken.retain(|place| place.id != self.id);
    }
}

/// IPv4 address, or the /64 prefix of an IPv6 address, within which a host has many addresses.
fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V4(address) => address.into(),
        IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() >> 64 << 64).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_displaced(guest: &ConnectionSlot) -> bool {
        guest.displaced.is_closed()
    }

    #[test]
    fn the_oldest_of_an_address_that_has_too_many_gives_way() {
        let limit = Rc::new(ConnectionLimit::default());
        let from = |last: u8| limit.enter(IpAddr::from([10, 0, 0, last]));
        let (quiet, many) = (from(1), [(); MAX_PER_ADDRESS].map(|()| from(2)));
        assert!(!many.iter().any(is_displaced));
        let _more = [from(2), from(2)];
        assert_eq!(many.iter().filter(|guest| is_displaced(guest)).count(), 2);
        assert!(is_displaced(&many[0]) && is_displaced(&many[1]) && !is_displaced(&quiet));
        assert_eq!((limit.take_displaced(), limit.take_displaced()), (2, 0));
        drop(many);
        // Those who have left are no burden.
        let again = [(); MAX_PER_ADDRESS - 2].map(|()| from(2));
        assert!(!again.iter().any(is_displaced) && !is_displaced(&quiet));
    }

    #[test]
    fn in_a_full_room_the_address_with_most_gives_way() {
        let limit = Rc::new(ConnectionLimit::default());
        let from = |last: u8| limit.enter(IpAddr::from([10, 0, 0, last]));
        let greedy = [(); MAX_PER_ADDRESS].map(|()| from(0));
        let single: Vec<ConnectionSlot> = (1..=48).map(from).collect();
        assert_eq!(single.len() + greedy.len(), MAX_CONNECTIONS);
        let last = from(200);
        assert!(is_displaced(&greedy[0]) && !is_displaced(&greedy[1]));
        assert!(!single.iter().any(is_displaced) && !is_displaced(&last));
    }

    #[test]
    fn a_host_has_one_room_for_all_its_addresses() {
        let limit = Rc::new(ConnectionLimit::default());
        let first = limit.enter("2001:db8::1".parse().unwrap());
        let many: Vec<ConnectionSlot> = (2..18_u16)
            .map(|last| limit.enter(format!("2001:db8::{last}").parse().unwrap()))
            .collect();
        assert!(is_displaced(&first) && !many.iter().any(is_displaced));
        let mapped: IpAddr = "::ffff:10.0.0.1".parse().unwrap();
        assert_eq!(network(mapped), IpAddr::from([10, 0, 0, 1]));
    }
}
