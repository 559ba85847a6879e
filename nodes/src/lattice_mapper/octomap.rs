//! Services of octomap_server for its clients; `docs/octomap.md` lists further compatibility.

use lattice_msgs::lattice::ClearBoxRequest;
use lattice_msgs::octomap_msgs::BoundingBoxQuery;
use lattice_msgs::std_srvs::{Empty, EmptyResponse};

use super::services::Call;
use crate::compute::Inbox;
use lattice_runtime::{Node, RuntimeError, Server};

/// Serves `~/clear_bbox` and `~/reset` with their types. Their replies cannot report a full inbox, which
/// leaves the map unchanged: it is logged.
pub(super) fn serve<E: Send + 'static>(
    node: &Node,
    inbox: &Inbox<E>,
    wrap: fn(Call) -> E,
    reset: fn() -> E,
) -> Result<[Server; 3], RuntimeError> {
    let clear = |name: &str| {
        let to = inbox.clone();
        node.service_later::<BoundingBoxQuery>(name, move |request, reply| {
            let (min, max) = (request.min, request.max);
            let busy = reply.clone();
            if !to.send(
                wrap(Call::ClearBoundingBox(ClearBoxRequest { min, max }, reply)),
                0,
            ) {
                log::warn!("the inbox is full: the box is not cleared");
                busy.send(Default::default());
            }
        })
    };
    let to = inbox.clone();
    let emptied = node.service::<Empty>("~/reset", move |_| {
        if !to.send(reset(), 0) {
            log::warn!("the inbox is full: the map is not reset");
        }
        EmptyResponse::default()
    })?;
    Ok([clear("~/clear_bbox")?, clear("~/clear_bbx")?, emptied])
}
