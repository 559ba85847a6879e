//! Publishers of the node.

use std::time::{Duration, Instant};

use lattice_msgs::grid_map_msgs::GridMap;
use lattice_msgs::map_msgs::OccupancyGridUpdate;
use lattice_msgs::nav_msgs::OccupancyGrid;
use lattice_runtime::qos::Qos;
use lattice_runtime::{Node, Publisher, RuntimeError};

/// The topics of the node.
#[derive(Clone)]
pub(super) struct Outputs {
    pub(super) grid: Publisher<OccupancyGrid>,
    pub(super) updates: Publisher<OccupancyGridUpdate>,
    /// None with the rule without ground.
    pub(super) elevation: Option<Publisher<GridMap>>,
}

impl Outputs {
    pub(super) fn new(node: &Node, has_ground: bool) -> Result<Self, RuntimeError> {
        let elevation = has_ground.then(|| node.publisher("elevation", Qos::LATCHED));
        Ok(Self {
            grid: node.publisher("projected_map", Qos::LATCHED)?,
            updates: node.publisher("projected_map_updates", Qos::DEFAULT)?,
            elevation: elevation.transpose()?,
        })
    }

    /// Subscribers of elevation.
    pub(super) fn elevation_subscribers(&self) -> usize {
        self.elevation
            .as_ref()
            .map_or(0, Publisher::subscriber_count)
    }

    /// Subscribers of all topics.
    pub(super) fn subscribers(&self) -> usize {
        let grids = self.grid.subscriber_count() + self.updates.subscriber_count();
        grids + self.elevation_subscribers()
    }

    pub(super) fn publish_grid(&self, grid: OccupancyGrid) {
        if let Err(error) = self.grid.publish(grid) {
            log::debug!("grid not published: {error}");
        }
    }

    pub(super) fn publish_updates(&self, updates: Vec<OccupancyGridUpdate>) {
        for update in updates {
            if let Err(error) = self.updates.publish(update) {
                log::debug!("update not published: {error}");
            }
        }
    }

    pub(super) fn publish_elevation(&self, elevation: GridMap) {
        let publisher = self.elevation.as_ref();
        if let Some(Err(error)) = publisher.map(|publisher| publisher.publish(elevation)) {
            log::debug!("elevation not published: {error}");
        }
    }

    /// Messages that the publishers had no room for.
    pub(super) fn dropped(&self) -> u64 {
        let elevation = self.elevation.as_ref().map_or(0, Publisher::dropped);
        self.grid.dropped() + self.updates.dropped() + elevation
    }

    /// Waits until what was published has left.
    pub(super) fn flush(&self, within: Duration) {
        let begin = Instant::now();
        let left = || within.saturating_sub(begin.elapsed());
        self.grid.flush(left());
        self.updates.flush(left());
        if let Some(elevation) = &self.elevation {
            elevation.flush(left());
        }
    }
}
