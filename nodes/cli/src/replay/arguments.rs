//! Arguments of a replay.

use std::path::PathBuf;

use clap::Args;
use lattice_core::lattice::Orientation;
use lattice_nodes::enu_transformer::ins::InsSource;

use crate::Lattices;
use crate::cell_size::CellSize;

/// Map a rosbag2 log
#[derive(Args, Clone, Debug, Default)]
pub struct Replay {
    /// rosbag2 directory, one mcap or db3 file of it, or a ROS 1 bag
    pub bag: PathBuf,
    /// Run the nodes' state machines in this process, as fast as possible, instead of playing
    /// the log over DDS to one process per node
    #[arg(long)]
    pub direct: bool,
    /// cubic, bcc, fcc, mcc, hex, hexopt, several separated by commas, paper, or all; by default from the parameters
    #[arg(long)]
    pub lattice: Option<Lattices>,
    #[command(flatten)]
    pub cells: CellSize,
    /// Orientation of the cells: paper, ground (flattest), or a crystal direction that points up, such as
    /// 110-up; by default from the parameters (paper)
    #[arg(long)]
    pub orientation: Option<Orientation>,
    /// Parameter files of the nodes; later ones override earlier ones
    #[arg(long = "params", value_name = "FILE")]
    pub params: Vec<PathBuf>,
    /// One parameter, as in `-p ins.source:=odometry`
    #[arg(short = 'p', long = "param", value_name = "NAME:=VALUE")]
    pub param: Vec<String>,
    /// Topics of clouds or depth images; by default detected in the log
    #[arg(long, value_name = "TOPIC")]
    pub points: Vec<String>,
    /// Source of poses: odometry, inspvax, inspva, navsatfix_imu, pose, pose_with_covariance, or tf (transforms
    /// only); by default detected in the log, in this order
    #[arg(long)]
    pub ins: Option<InsSource>,
    /// Topic of the INS; by default detected in the log
    #[arg(long, value_name = "TOPIC")]
    pub ins_topic: Option<String>,
    /// Threads of the direct replay; 0: all cores
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Playback rate over DDS, 1 is real time
    #[arg(long, default_value_t = 1.0)]
    pub rate: f64,
    /// Map only clouds from this time on, s of log time from its beginning; needs --direct
    #[arg(long, value_name = "SECONDS")]
    pub start: Option<f64>,
    /// Map only clouds before this time, s of log time from its beginning; needs --direct
    #[arg(long, value_name = "SECONDS")]
    pub stop: Option<f64>,
    /// File for the map, for `lattice map`; with several lattices their names precede the extension
    #[arg(long, value_name = "FILE")]
    pub map_out: Option<PathBuf>,
    /// Folder of tables to add the map to, for `lattice fleet`; needs --direct and the program lattice-fleet
    #[arg(long, value_name = "DIR")]
    pub out_table: Option<PathBuf>,
    /// Draw the markers of each map as well, and count their bytes; needs --direct, without which a node draws them
    #[arg(long)]
    pub markers: bool,
    /// Map although the attitudes contradict the way of the machine, or gravity and turning rates of an Imu
    #[arg(long)]
    pub trust_attitude: bool,
    /// Map without the check of stamps and mounts against the poses, on the first minute
    #[arg(long)]
    pub trust_stamps: bool,
    /// Print the report as JSON
    #[arg(long)]
    pub json: bool,
    /// Port of a viewer for the FCC map, or else the first; `None`: no viewer.
    #[arg(skip)]
    pub viewer: Option<u16>,
}
