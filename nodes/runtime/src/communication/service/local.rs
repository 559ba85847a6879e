//! Services within the process, by name: calls of local clients bypass DDS, whose participant ignores its own
//! endpoints.

use std::collections::BTreeMap;
use std::sync::Mutex;

use smol::channel::{Receiver, Sender, bounded};

use crate::sync::lock;

/// Limit of calls queued at one server.
const MAX_WAITING: usize = 64;

/// Call of a client in this process.
pub(crate) struct LocalCall {
    /// CDR, its encapsulation header first.
    pub request: Vec<u8>,
    /// Receives the reply (CDR), or the reason for its absence.
    pub answered: Sender<Result<Vec<u8>, String>>,
}

/// Servers of this process.
#[derive(Default)]
pub(crate) struct LocalServices(Mutex<BTreeMap<String, (&'static str, Sender<LocalCall>)>>);

impl LocalServices {
    /// Adds a server; it replaces an earlier one of the same name.
    pub(crate) fn add(&self, name: &str, type_name: &'static str) -> Receiver<LocalCall> {
        let (sender, calls) = bounded(MAX_WAITING);
        let mut all = lock(&self.0);
        all.retain(|_, (_, sender)| !sender.is_closed());
        all.insert(name.to_owned(), (type_name, sender));
        calls
    }

    /// Call queue of a server of this type, if any.
    pub(crate) fn find(&self, name: &str, type_name: &str) -> Option<Sender<LocalCall>> {
        let all = lock(&self.0);
        let (found, sender) = all.get(name)?;
        (*found == type_name && !sender.is_closed()).then(|| sender.clone())
    }
}
