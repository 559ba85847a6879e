//! `lattice evaluate scans`.

use std::path::PathBuf;

use clap::Args;
use lattice_core::pose::Axes;
use lattice_lab::evaluate::{Scans, scans_report};
use lattice_lab::poses::read_pose;

use super::evaluate_many::Many;
use crate::CliResult;
use crate::calibrate::input::{self, Place};
use crate::calibrate::options::SearchOptions;
use crate::points::Columns;

/// Options of `lattice evaluate scans`.
#[derive(Args)]
pub struct OfScans {
    /// Map, of the kinds that `lattice calibrate` reads
    #[arg(long, value_name = "FILE")]
    map: PathBuf,
    /// Scan of the same place, whose parts are looks into it
    #[arg(long, value_name = "FILE")]
    cloud: PathBuf,
    /// Pose of the scan in the map: 16 numbers, row by row [default: as a calibration of all points finds it]
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Parts of the circle that looks see, degrees
    #[arg(long, value_delimiter = ',', default_values_t = [30.0, 60.0, 90.0, 180.0])]
    widths: Vec<f64>,
    /// Position of the scan's sensor, in its axes: "x y z" (m) [default: its origin]
    #[arg(long, allow_hyphen_values = true)]
    sensor: Option<Place>,
    /// Axes of the scan: ros_flu, unity_ruf (left-handed), winrt_rub or optical
    #[arg(long, default_value = "ros_flu")]
    axes: Axes,
    /// Side of the cells that points are thinned to, m [default: as `lattice calibrate`]
    #[arg(long)]
    cell: Option<f64>,
    /// Most points to read of a file
    #[arg(long, default_value_t = 20_000_000)]
    max_points: usize,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    many: Many,
    #[command(flatten)]
    search: SearchOptions,
}

impl OfScans {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let truth = self.truth.as_deref().map(read_pose).transpose()?;
        let files = [self.map.as_path(), &self.cloud];
        let reading = self.columns.options(self.max_points, &files)?;
        let map = input::map(&self.map, self.cell, &reading)?;
        let sensor_m = self.sensor.as_ref().map(|p| self.axes.point_to_ros(&p.0));
        let paths = std::slice::from_ref(&self.cloud);
        let clouds = input::headset_scans(paths, self.axes, sensor_m, &reading)?;
        let truth = truth.map(|truth| clouds.pose_of_middle(&truth));
        let scans = clouds.scans;
        let options = self.search.options(self.axes, self.max_points, &scans)?;
        let scan = scans.into_iter().next().ok_or("there is no scan")?;
        let scans = Scans::new(map, scan, truth, options)?;
        let parts = scans.parts(&self.widths)?;
        let results = self.many.measure(&parts, &scans.settings())?;
        self.many.show(&scans_report(&results.sorted()))
    }
}
