//! Parameters of the merger.

use std::time::Duration;

use super::options::{MergedLabels, MergerOptions};
use crate::compute::ComputeLimits;
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "robots" fixed(options::TOPIC): "Names of the robots: their maps are /NAME/voxel_map and /NAME/voxel_map_updates.";
    "datum_m" fixed("keys are counted from it"): "Origin of the keys of the merged map: the lattice point nearest to this position in the map frame. Keys reach a million cells in every direction.";
    "max_voxels": "Voxel limit of the merged map, and of each robot's.";
    "labels" fixed("the map is made with it"): "Labels of the merged map: own (those of the maps; of each robot only the most frequent one of a voxel is known), robots (the robots themselves, with their names on label_info), or none.";
    "chunk_bytes": "Largest message of voxel_map and voxel_map_updates, bytes.";
};

const MAX_ROBOTS: usize = 1000;

const LABELS: [(&str, MergedLabels); 3] = [
    ("own", MergedLabels::Own),
    ("robots", MergedLabels::Robots),
    ("none", MergedLabels::None),
];

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub merger: MergerOptions,
    pub limits: ComputeLimits,
    pub period: Duration,
    /// Name of the mappers in the robots' namespaces.
    pub mapper: String,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        let robots = params.string_array("robots", &["robot1", "robot2"])?;
        let mut names: Vec<_> = robots
            .iter()
            .map(|name| name.trim_matches('/').to_owned())
            .collect();
        names.sort();
        names.dedup();
        if names.len() != robots.len() || names.is_empty() || names.contains(&String::new()) {
            return Err(params.invalid("robots", "expected names of robots, each once"));
        }
        if robots.len() > MAX_ROBOTS {
            let problem = format!("expected at most {MAX_ROBOTS}");
            return Err(params.invalid("robots", problem));
        }
        let robots = robots.iter().map(|name| name.trim_matches('/').to_owned());
        Ok(Self {
            merger: MergerOptions {
                robots: robots.collect(),
                map_frame: options::frame(params, "map_frame", "map")?,
                datum_m: options::place_m(params, "datum_m")?,
                max_voxels: params.positive("max_voxels", 10_000_000)?,
                labels: options::one_of(params, "labels", &LABELS)?,
                chunk_bytes: options::chunk_bytes(params, 60_000)?,
            },
            limits: options::compute_limits(params, 4096, 64 << 20, options::threads(params, 1)?)?,
            period: options::period(params, "update_period_s", 1.0)?,
            mapper: params.string("mapper", "lattice_mapper")?,
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
