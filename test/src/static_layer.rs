//! Rules by which Nav2's static layer takes occupancy grids and updates.

use lattice_msgs::map_msgs::OccupancyGridUpdate;
use lattice_msgs::nav_msgs::OccupancyGrid;

/// Cost of a cell that the map says nothing of.
pub const NO_INFORMATION: u8 = 255;
/// Cost of an obstacle.
pub const LETHAL: u8 = 254;
/// Cost of a cell without obstacle.
pub const FREE: u8 = 0;

/// Parameters of the layer.
#[derive(Clone, Copy, Debug)]
pub struct StaticLayerOptions {
    /// `trinary_costmap`.
    pub trinary: bool,
    /// `lethal_cost_threshold`.
    pub lethal_threshold: u8,
    /// `unknown_cost_value`.
    pub unknown_value: u8,
    /// `track_unknown_space`.
    pub track_unknown: bool,
}

impl Default for StaticLayerOptions {
    fn default() -> Self {
        Self {
            trinary: true,
            lethal_threshold: 100,
            unknown_value: 255,
            track_unknown: true,
        }
    }
}

/// Costmap of one static layer, with what it complains of.
#[derive(Clone, Debug, Default)]
pub struct StaticLayer {
    options: StaticLayerOptions,
    /// Frame of the last grid.
    pub frame: String,
    /// Edge of a cell, as read from the grid, metres.
    pub resolution_m: f64,
    /// Corner of the first cell, metres.
    pub origin_m: [f64; 2],
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Costs, row by row.
    pub costs: Vec<u8>,
    /// Times that all layers were resized.
    pub resizes: usize,
    /// Warnings so far.
    pub warnings: Vec<String>,
}

impl StaticLayer {
    /// An empty layer.
    pub fn new(options: StaticLayerOptions) -> Self {
        Self {
            options,
            ..Self::default()
        }
    }

    /// Cost of a value of a grid, which the layer reads as a byte without sign.
    pub fn cost(&self, value: i8) -> u8 {
        let (value, options) = (value as u8, &self.options);
        if value == options.unknown_value {
            return match options.track_unknown {
                true => NO_INFORMATION,
                false => FREE,
            };
        }
        if value >= options.lethal_threshold {
            return LETHAL;
        }
        match options.trinary {
            true => FREE,
            false => {
                let scale = f64::from(value) / f64::from(options.lethal_threshold);
                (scale * f64::from(LETHAL)) as u8
            }
        }
    }

    /// Takes a grid.
    pub fn on_grid(&mut self, grid: &OccupancyGrid) {
        let info = &grid.info;
        let resolution_m = f64::from(info.resolution);
        let origin_m = [info.origin.position.x, info.origin.position.y];
        for (axis, origin) in ["x", "y"].into_iter().zip(origin_m) {
            let cells = origin / resolution_m;
            if (cells - cells.round()).abs() > 1e-6 {
                self.warnings
                    .push(format!("origin {axis} {origin} is not aligned"));
            }
        }
        let (width, height) = (info.width as usize, info.height as usize);
        if grid.data.len() != width * height {
            self.warnings
                .push(format!("{} values for {width} x {height}", grid.data.len()));
            return;
        }
        let is_same = (self.width, self.height) == (width, height)
            && self.resolution_m == resolution_m
            && self.origin_m == origin_m;
        self.resizes += usize::from(!is_same);
        (self.width, self.height) = (width, height);
        (self.resolution_m, self.origin_m) = (resolution_m, origin_m);
        self.frame.clone_from(&grid.header.frame_id);
        self.costs = grid.data.iter().map(|value| self.cost(*value)).collect();
    }

    /// Takes an update.
    pub fn on_update(&mut self, update: &OccupancyGridUpdate) {
        let (x, y) = (i64::from(update.x), i64::from(update.y));
        let (width, height) = (i64::from(update.width), i64::from(update.height));
        let outside =
            x < 0 || y < 0 || x + width > self.width as i64 || y + height > self.height as i64;
        if outside {
            self.warnings
                .push("an update exceeds the bounds of the layer".to_owned());
            return;
        }
        if update.header.frame_id != self.frame {
            let frame = &update.header.frame_id;
            self.warnings.push(format!("an update in frame {frame}"));
            return;
        }
        if update.data.len() as i64 != width * height {
            self.warnings
                .push(format!("{} values of an update", update.data.len()));
            return;
        }
        for (i, value) in update.data.iter().enumerate() {
            let (dx, dy) = (i % update.width as usize, i / update.width as usize);
            let at = (y as usize + dy) * self.width + x as usize + dx;
            self.costs[at] = self.cost(*value);
        }
    }

    /// Cost at a position of the map, metres; no information outside.
    pub fn at_m(&self, x_m: f64, y_m: f64) -> u8 {
        let [x, y] = [x_m - self.origin_m[0], y_m - self.origin_m[1]]
            .map(|offset_m| (offset_m / self.resolution_m).floor());
        if x < 0.0 || y < 0.0 || x >= self.width as f64 || y >= self.height as f64 {
            return NO_INFORMATION;
        }
        self.costs[y as usize * self.width + x as usize]
    }
}
