//! Services of this process by name: calls of its own clients do not go over DDS, which delivers nothing
//! inside a participant.

use std::collections::BTreeMap;
use std::sync::Mutex;

use smol::channel::{Receiver, Sender, bounded};

use crate::sync::lock;

/// Calls that wait for one server, at most.
const MAX_WAITING: usize = 64;

/// A call of a client in this process.
pub(crate) struct LocalCall {
    /// CDR, its encapsulation header first.
    pub request: Vec<u8>,
    /// For the answer, CDR too, or the reason why there is none.
    pub answered: Sender<Result<Vec<u8>, String>>,
}

/// The servers that clients here can call.
#[derive(Default)]
pub(crate) struct LocalServices(Mutex<BTreeMap<String, (&'static str, Sender<LocalCall>)>>);

impl LocalServices {
    /// Adds a server; the last one of a name counts.
    pub(crate) fn add(&self, name: &str, type_name: &'static str) -> Receiver<LocalCall> {
        let (sender, calls) = bounded(MAX_WAITING);
        let mut all = lock(&self.0);
        all.retain(|_, (_, sender)| !sender.is_closed());
        all.insert(name.to_owned(), (type_name, sender));
        calls
    }

    /// The entrance to a server of this type, if there is one.
    pub(crate) fn find(&self, name: &str, type_name: &str) -> Option<Sender<LocalCall>> {
        let all = lock(&self.0);
        let (found, sender) = all.get(name)?;
        (*found == type_name && !sender.is_closed()).then(|| sender.clone())
    }
}
