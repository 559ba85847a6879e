//! Parameters of the mapper.

use std::time::Duration;

use super::autosave::AutosaveOptions;
use super::free_options::FreeSpaceMethod;
use super::initial_map::InitialMap;
use super::map_folder::MapFolder;
use super::options::MapperOptions;
use crate::compute::ComputeLimits;
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "lattice" fixed(MAP): "cubic, bcc, fcc, mcc, hex or hexopt.";
    "lattice_orientation" fixed(MAP): "Orientation of the cells: paper (axes as printed by Ryde & Bruenig), ground (flattest), or a crystal direction that points up, such as 110-up.";
    "cell_volume_m3" fixed(MAP): "Volume of one cell: 0.125 is that of a cube of 0.5 m.";
    "cell_size_m" fixed(MAP): "Edge of the cube with the volume of one cell, in place of cell_volume_m3; 0.0: use cell_volume_m3.";
    "map_frame" fixed(options::FRAME): "Required frame of clouds.";
    "follow_corrections" fixed(MAP): "Whether clouds are in the frame of an odometry, which the topic corrections of lidar_odometry places in map_frame: clouds are kept, one point in each quarter of a cell's edge and segment of the drive, and mapped anew where loops move them. Not with free_space.";
    "max_kept_bytes" fixed(MAP): "Memory limit for the clouds that are kept; beyond it the map grows without being corrected.";
    "datum_m" fixed(MAP): "Origin of the voxel keys: the lattice point nearest to this position in the map frame. Keys reach a million cells in every direction. If not set, the origin, or near the first point if that is out of range, as in UTM.";
    "payload" fixed(MAP): "centroid: count and mean of the points of each voxel; occupancy: 2 to 3 bytes a voxel, without count, mean, labels and stamps.";
    "free_space" fixed(MAP): "Use of rays from the sensor: off (voxels stay), clear (rays clear voxels), or evidence (voxels that are probably free by the hits and misses of all scans are removed). Needs viewpoints of enu_transformer. In quotes: YAML parses a bare off as false.";
    "rays.sweep_s": "Duration of the clouds of one scan; 0: each cloud is a scan. Cells hit by any of them are not cleared by the others. A laser on a turntable needs one revolution.";
    "rays.max_range_m": "Length limit of rays; 0: no limit.";
    "rays.misses": "Consecutive scans that must miss a voxel before it is cleared (clear).";
    "rays.keep_m": "Length of the end of each ray that clears nothing; this or keep_ratio, whichever is longer. For poses that are worse than a cell.";
    "rays.keep_ratio": "Length of that end as a fraction of the ray.";
    "rays.spare_touching": "Whether voxels that the scan grazes are kept: those that touch a hit cell, and those whose surface no ray passes through.";
    "rays.max_bytes" fixed(MAP): "Memory limit for rays and evidence, bytes.";
    "evidence.hit": "Probability that a cell is occupied after one hit.";
    "evidence.miss": "Probability that a cell is occupied after one miss.";
    "evidence.least": "Lower bound of the occupancy probability.";
    "evidence.most": "Upper bound of the occupancy probability.";
    "evidence.threshold": "Smallest probability of an occupied cell.";
    "free_level" fixed(MAP): "Level of published free cells: 2^free_level as wide as voxels, 1 to 3; 0: not published (evidence).";
    "max_voxels": "Most voxels.";
    "max_map_bytes" fixed(MAP): "Memory limit for voxels, bytes, at the worst 330 for each; 0: limited by max_voxels only.";
    "when_full": "Policy for a full map: refuse (points in new cells are rejected and counted) or forget_oldest (an eighth of the voxels is removed, those without points for longest).";
    "forget_after_s": "Age limit of voxels since their last point, by the stamps of the clouds; 0: none, not settable at run time. Costs 16 bytes a voxel and insertion time. Clouds whose stamps jump by more than half of it, and a second, are rejected and counted until five in a row agree on the new time.";
    "keep_labels" fixed(MAP): "Whether labels are counted in each voxel: voxel_map, voxel_map_updates and map_centers then contain the most frequent one. Costs 24 bytes a voxel, 8 for each of its labels, and insertion time.";
    "keep_color" fixed(MAP): "Whether colours of points (rgb, rgba or r, g, b) are summed in each voxel: voxel_map, voxel_map_updates, map_centers and map files then contain the mean. Programs from before it do not read such messages. Costs 20 bytes a voxel and insertion time.";
    "chunk_bytes": "Largest message of voxel_map and voxel_map_updates, bytes. Above 60 kB reliable messages are fragmented, and repair is slow.";
    "centers_period_s": "Period of map_centers, octomap_binary and octomap_full.";
    "free_period_s": "Period of free.";
    "map_dir" fixed("it names outputs"): "Folder of the files of ~/save_map and ~/load_map; by default the working directory. Only map files are replaced.";
    "autosave_period_s": "Period of saves of a changing map, which is also saved at the end; 0: never.";
    "autosave_file" fixed("it names an output"): "File of these saves, below map_dir.";
    "octomap_services" fixed("services are made with it"): "Whether ~/reset and ~/clear_bbox have the types of octomap_server (std_srvs/Empty, octomap_msgs/BoundingBoxQuery), and octomap_binary and octomap_full are topics and services. With free_space: evidence and free_level 0 all cells that rays pass keep their log-odds then.";
    "resume" fixed("it is done at the start"): "Whether the map is loaded from that file at the start, if it exists, instead of starting empty.";
    "map_file" fixed("it is read at the start"): "Map at the start, below map_dir: a map file of the same cells, or a point file (.bt, .ot, .ply, .pcd, .las, .xyz) in map_frame. It is not written. With resume, a saved map is used instead. Empty: none.";
};

const MAP: &str = "the map is made with it";

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub mapper: MapperOptions,
    pub limits: ComputeLimits,
    pub maps: MapFolder,
    pub autosave: AutosaveOptions,
    pub initial_map: InitialMap,
    pub update_period: Duration,
    pub centers_period: Duration,
    /// Zero without free space to publish.
    pub free_period: Duration,
    pub octomap_services: bool,
    /// Memory limit for kept clouds, if corrections are followed.
    pub max_kept_bytes: Option<usize>,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        let mapper = MapperOptions::from_params(params)?;
        let free_period = options::period(params, "free_period_s", 1.0)?;
        let max_kept_bytes = params.positive("max_kept_bytes", 2 << 30)?;
        let follows = params.bool("follow_corrections", false)?;
        if follows && mapper.free_space.method != FreeSpaceMethod::Off {
            let problem = "kept clouds have no rays: needs `free_space: \"off\"`";
            return Err(params.invalid("follow_corrections", problem));
        }
        let has_free = mapper.free_space.free_level > 0;
        let autosave = AutosaveOptions::from_params(params)?;
        Ok(Self {
            limits: options::compute_limits(params, 4096, 256 << 20, options::threads(params, 0)?)?,
            maps: MapFolder::from_params(params)?,
            initial_map: InitialMap::from_params(params, &autosave.file)?,
            autosave,
            update_period: options::period(params, "update_period_s", 0.2)?,
            centers_period: options::period(params, "centers_period_s", 1.0)?,
            free_period: if has_free {
                free_period
            } else {
                Duration::ZERO
            },
            octomap_services: params.bool("octomap_services", false)?,
            max_kept_bytes: follows.then_some(max_kept_bytes),
            report_file: report::file(params)?,
            mapper,
        })
    }

    /// Reads the parameters of a node that runs with `old` options.
    pub(super) fn changed(params: &Params, old: &MapperOptions) -> Result<Self, ParamError> {
        let settings = Self::from_params(params)?;
        match settings.mapper.payload().stamps == old.payload().stamps {
            true => Ok(settings),
            false => {
                let problem = "stamps of voxels cannot be switched on or off at run time";
                Err(params.invalid("forget_after_s", problem))
            }
        }
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
