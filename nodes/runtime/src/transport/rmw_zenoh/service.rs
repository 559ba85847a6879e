//! Services: a server is a queryable, a call a query that carries the request.

use std::collections::VecDeque;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use futures::future::BoxFuture;
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Queryable};
use zenoh::sample::Locality;

use super::attachment::{attachment, read};
use super::graph::Place;
use super::publisher::{InTurn, payload};
use super::subscriber::{Inbox, InboxReader};
use crate::sync::lock;
use crate::transport::port::{
    Bytes, ClientEnds, EndpointId, Origin, SampleId, SampleWriter, ServerEnds, ServiceForm,
    ServiceQos, WriteRefusal,
};

/// Timeout of a query, as in rmw_zenoh; callers have their own timeout.
const QUERY_TIMEOUT: Duration = Duration::from_secs(600);

/// Limit of requests without reply; beyond it the oldest are dropped.
const MAX_PENDING: usize = 4096;

/// Liveliness token and graph entry of an endpoint.
type Announced = (LivelinessToken, Place);

/// Server of a key.
struct Server {
    id: EndpointId,
    key: String,
    pending: Arc<Pending>,
    queue: InTurn,
    _announced: Announced,
    _queryable: Queryable<()>,
}

/// Queries without reply so far.
#[derive(Default)]
struct Pending {
    queries: Mutex<VecDeque<(SampleId, Query)>>,
}

impl Pending {
    /// Adds a query. True: an older one was dropped for it.
    fn add(&self, request: SampleId, query: Query) -> bool {
        let mut queries = lock(&self.queries);
        let full = queries.len() >= MAX_PENDING;
        if full {
            let _ = queries.pop_front();
        }
        queries.push_back((request, query));
        full
    }

    fn take(&self, request: &SampleId) -> Option<Query> {
        let mut queries = lock(&self.queries);
        let place = queries.iter().position(|(known, _)| known == request)?;
        queries.remove(place).map(|(_, query)| query)
    }
}

/// Identity of the second end of an endpoint with one token.
fn other_end(id: EndpointId) -> EndpointId {
    EndpointId(id.0.map(|byte| !byte))
}

/// Creates both ends of a server.
pub(super) fn serve(
    session: &zenoh::Session,
    (id, key): (EndpointId, String),
    qos: &ServiceQos,
    announce: impl FnOnce() -> zenoh::Result<Announced>,
) -> zenoh::Result<ServerEnds> {
    let inbox = Inbox::new(qos.reader.depth, qos.max_bytes);
    let pending = Arc::new(Pending::default());
    let (to, asked) = (Arc::clone(&inbox), Arc::clone(&pending));
    let queryable = session
        .declare_queryable(&key)
        // The server handles every key that matches its own.
        .complete(true)
        .allowed_origin(Locality::Remote)
        .callback(move |query| ask(query, &to, &asked))
        .wait()?;
    let server = Arc::new(Server {
        id,
        key,
        pending,
        queue: InTurn::default(),
        _announced: announce()?,
        _queryable: queryable,
    });
    Ok(ServerEnds {
        form: ServiceForm::Queries,
        requests: Box::new(InboxReader {
            id,
            inbox,
            _source: Arc::clone(&server),
        }),
        replies: Arc::new(Replies(server)),
    })
}

fn ask(query: Query, inbox: &Inbox, pending: &Pending) {
    let payload = query.payload().cloned().unwrap_or_default();
    let origin = read(query.attachment()).map(|sample| Origin {
        sample,
        related: None,
    });
    if let Ok(origin) = &origin
        && pending.add(origin.sample, query)
    {
        inbox.losses().overrun.fetch_add(1, Relaxed);
    }
    inbox.push(payload, origin);
}

struct Replies(Arc<Server>);

impl SampleWriter for Replies {
    fn id(&self) -> EndpointId {
        other_end(self.0.id)
    }

    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        let found = related.and_then(|request| Some((request, self.0.pending.take(&request)?)));
        let key = self.0.key.clone();
        self.0.queue.write(body, move |body| {
            move || match found {
                Some((request, query)) => query
                    .reply(key, payload(body))
                    .attachment(attachment(request))
                    .wait(),
                None => Err("the request is no longer known".into()),
            }
        })
    }

    fn wait_for_acknowledgments(&self, patience: Duration) -> bool {
        self.0.queue.wait(patience)
    }
}

/// Client of a key.
struct Client {
    id: EndpointId,
    session: zenoh::Session,
    key: String,
    inbox: Arc<Inbox>,
    queue: InTurn,
    _announced: Announced,
}

/// Creates both ends of a client.
pub(super) fn call(
    session: &zenoh::Session,
    (id, key): (EndpointId, String),
    qos: &ServiceQos,
    announce: impl FnOnce() -> zenoh::Result<Announced>,
) -> zenoh::Result<ClientEnds> {
    let inbox = Inbox::new(qos.reader.depth, qos.max_bytes);
    let client = Arc::new(Client {
        id,
        session: session.clone(),
        key,
        inbox: Arc::clone(&inbox),
        queue: InTurn::default(),
        _announced: announce()?,
    });
    Ok(ClientEnds {
        form: ServiceForm::Queries,
        requests: Arc::new(Calls(Arc::clone(&client))),
        answers: Box::new(InboxReader {
            id: other_end(id),
            inbox,
            _source: client,
        }),
    })
}

struct Calls(Arc<Client>);

impl SampleWriter for Calls {
    fn id(&self) -> EndpointId {
        self.0.id
    }

    fn write(
        &self,
        body: Bytes,
        related: Option<SampleId>,
    ) -> BoxFuture<'_, Result<(), WriteRefusal>> {
        let client = Arc::clone(&self.0);
        self.0.queue.write(body, move |body| {
            let request = SampleId {
                writer: client.id,
                number: related.map_or(0, |request| request.number),
            };
            let to = Arc::clone(&client.inbox);
            // A Zenoh error is not a reply; the call ends by timeout.
            let hear = move |reply: zenoh::query::Reply| {
                if let Ok(sample) = reply.into_result() {
                    let origin = Origin {
                        sample: request,
                        related,
                    };
                    to.push(sample.payload().clone(), Ok(origin));
                }
            };
            move || {
                client
                    .session
                    .get(&client.key)
                    .payload(payload(body))
                    .attachment(attachment(request))
                    .target(QueryTarget::AllComplete)
                    .consolidation(ConsolidationMode::None)
                    .timeout(QUERY_TIMEOUT)
                    .callback(hear)
                    .wait()
            }
        })
    }

    fn wait_for_acknowledgments(&self, patience: Duration) -> bool {
        self.0.queue.wait(patience)
    }
}
