//! Parameters of the mapper.

use std::time::Duration;

use super::MapperOptions;
use super::autosave::AutosaveOptions;
use super::map_folder::MapFolder;
use crate::compute::ComputeLimits;
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "lattice" fixed(MAP): "cubic, bcc, fcc, mcc, hex or hexopt.";
    "lattice_orientation" fixed(MAP): "How its cells lie: paper (axes as Ryde & Bruenig print them), ground (flattest), or a crystal direction that points up, as 110-up.";
    "cell_volume_m3" fixed(MAP): "Volume of one cell: 0.125 is as much as a cube of 0.5 m.";
    "cell_size_m" fixed(MAP): "Edge of the cube with the volume of one cell, in place of cell_volume_m3; 0.0: as cell_volume_m3 says.";
    "map_frame" fixed(options::FRAME): "Frame that clouds must be in.";
    "datum_m" fixed(MAP): "Keys are counted from the lattice point next to this place in the map frame. They reach a million cells in every direction. If not set, the place is the origin, or near the first point where that is out of reach, as in UTM.";
    "payload" fixed(MAP): "centroid: count and mean of the points of each voxel; occupancy: 2 to 3 bytes a voxel, without count, mean, labels and stamps.";
    "free_space" fixed(MAP): "off: voxels stay; clear: voxels that rays from the sensor pass through go; evidence: those that are probably free by the hits and misses of all scans. Needs viewpoints of enu_transformer. In quotes: YAML reads a bare off as false.";
    "rays.sweep_s": "Clouds of this long are one scan; 0: each is one. What any of them hits, the others do not clear. A laser on a turntable needs a turn.";
    "rays.max_range_m": "Rays are followed to this range; 0: to their ends.";
    "rays.misses": "Scans that must pass through a voxel, with none between that hits it (clear).";
    "rays.keep_m": "The last part of each ray, which clears nothing; that or keep_ratio, whichever is longer. Ground at a flat angle needs the size of a cell over the height of the sensor.";
    "rays.keep_ratio": "The same as a fraction of the ray.";
    "rays.spare_touching": "Whether voxels that touch a cell which the scan hit are spared (clear).";
    "rays.max_bytes" fixed(MAP): "Most memory for rays and evidence, bytes.";
    "evidence.hit": "Probability that a cell is occupied after one hit.";
    "evidence.miss": "Probability that a cell is occupied after one miss.";
    "evidence.least": "The probability never becomes less than this.";
    "evidence.most": "The probability never becomes more than this.";
    "evidence.threshold": "Cells of at least this probability are occupied.";
    "free_level" fixed(MAP): "Free cells are published as free, 2^free_level as wide as voxels, 1 to 3; 0: not (evidence).";
    "max_voxels": "Most voxels.";
    "max_map_bytes" fixed(MAP): "Most memory for voxels, bytes, at the worst 330 for each; 0: as much as max_voxels takes.";
    "when_full": "refuse: points in new cells are refused and counted when the map is full; forget_oldest: an eighth of the voxels goes, those that no point has touched for longest.";
    "forget_after_s": "Voxels go when their last point is older than this by the stamps of the clouds; 0: never, from the start to the end. Costs 16 bytes a voxel, and inserting takes longer. Clouds whose stamps jump by more than half of it, and a second, are refused and counted until five in a row agree on the new time.";
    "max_cloud_points": "Clouds of more points are refused.";
    "keep_labels" fixed(MAP): "Whether labels are counted in each voxel: map, map_updates and map_centers then tell the most frequent one. Costs 24 bytes a voxel and 8 for each of its labels, and inserting takes longer.";
    "chunk_bytes": "Largest message of map and map_updates, bytes. Above 60 kB reliable messages are cut into fragments, whose repair is slow.";
    "update_period_s": "Time between two messages of map_updates.";
    "centers_period_s": "Time between two messages of map_centers.";
    "free_period_s": "Time between two messages of free.";
    "map_dir" fixed("it names outputs"): "Folder below which ~/save_map and ~/load_map take names of files; by default the one that the node was started in. Only maps are replaced.";
    "autosave_period_s": "Time between two saves of a map that changes, and at its end; 0: never.";
    "autosave_file" fixed("it names an output"): "File of these saves, below map_dir.";
    "octomap_services" fixed("services are made with it"): "Whether ~/reset and ~/clear_bbox are as octomap_server has them (std_srvs/Empty, octomap_msgs/BoundingBoxQuery).";
    "resume" fixed("it is done at the start"): "Whether to go on from that file, if it is there, instead of beginning with an empty map.";
};

const MAP: &str = "the map is made with it";

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub mapper: MapperOptions,
    pub limits: ComputeLimits,
    pub maps: MapFolder,
    pub autosave: AutosaveOptions,
    pub update_period: Duration,
    pub centers_period: Duration,
    /// Zero without free space to publish.
    pub free_period: Duration,
    pub octomap_services: bool,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        let mapper = MapperOptions::from_params(params)?;
        let free_period = options::period(params, "free_period_s", 1.0)?;
        let has_free = mapper.free_space.free_level > 0;
        Ok(Self {
            limits: ComputeLimits {
                events: options::inbox_events(params, 4096)?,
                bytes: options::inbox_bytes(params, 256 << 20)?,
                threads: options::threads(params, 0)?,
            },
            maps: MapFolder::from_params(params)?,
            autosave: AutosaveOptions::from_params(params)?,
            update_period: options::period(params, "update_period_s", 0.2)?,
            centers_period: options::period(params, "centers_period_s", 1.0)?,
            free_period: if has_free {
                free_period
            } else {
                Duration::ZERO
            },
            octomap_services: params.bool("octomap_services", false)?,
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
