//! Services that clients may call.

use std::time::Duration;

use lattice_msgs::lattice::{Calibrate, ClearBox, PlanPath, QueryMap, SaveMap};
use lattice_msgs::rosbag2_interfaces::{
    GetRate, IsPaused, Pause, PlayNext, Resume, Seek, SetRate, TogglePaused,
};
use lattice_msgs::std_srvs::Trigger;
use lattice_msgs::{RosMessage, RosService};
use lattice_runtime::{Client, Node, RuntimeError};

use super::options::BridgeOptions;
use super::replies::PATIENCE;
use crate::viewer_server::protocol::AdvertisedService;

/// Timeout of a calibration, which may include a search.
const CALIBRATION_PATIENCE: Duration = Duration::from_secs(120);

/// Service clients with their timeouts.
pub(super) type Clients = Vec<(Client, Duration)>;

/// Table under construction.
struct Table<'a> {
    node: &'a Node,
    of: &'a str,
    patience: Duration,
    services: Vec<AdvertisedService>,
    clients: Clients,
}

impl Table<'_> {
    fn add<S: RosService>(&mut self, name: &str) -> Result<(), RuntimeError> {
        let client = self.node.client::<S>(&format!("{}/{name}", self.of))?;
        self.services.push(AdvertisedService {
            id: self.services.len() as u32,
            name: client.name().to_owned(),
            type_name: S::TYPE,
            request_schema: S::Request::definition(),
            response_schema: S::Response::definition(),
        });
        self.clients.push((client, self.patience));
        Ok(())
    }
}

/// Services in the order of their ids; those that change state only if allowed.
pub(super) fn of(
    node: &Node,
    reach: &BridgeOptions,
) -> Result<(Vec<AdvertisedService>, Clients), RuntimeError> {
    let mut table = Table {
        node,
        of: &reach.mapper,
        patience: PATIENCE,
        services: Vec::new(),
        clients: Vec::new(),
    };
    table.add::<QueryMap>("query")?;
    table.add::<PlanPath>("plan_path")?;
    if reach.allow_write {
        table.add::<ClearBox>("clear_box")?;
        table.add::<Trigger>("reset")?;
        table.add::<SaveMap>("save_map")?;
    }
    table.of = &reach.player;
    table.add::<IsPaused>("is_paused")?;
    table.add::<GetRate>("get_rate")?;
    if reach.allow_write {
        table.add::<Pause>("pause")?;
        table.add::<Resume>("resume")?;
        table.add::<TogglePaused>("toggle_paused")?;
        table.add::<PlayNext>("play_next")?;
        table.add::<SetRate>("set_rate")?;
        table.add::<Seek>("seek")?;
    }
    if let Some(headset) = &reach.headset {
        table.of = &headset.calibrator;
        table.patience = CALIBRATION_PATIENCE;
        table.add::<Calibrate>("calibrate")?;
    }
    Ok((table.services, table.clients))
}
