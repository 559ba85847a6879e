//! Settings of an evaluation and the plan of its trials.

use crate::AnyError;
use crate::options::within;
use crate::simulate::house::Scene;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Version of trials and their seeds; old results are not continued with new ones.
pub const FORMAT: u32 = 1;

/// Settings that all results depend on, but for the times.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Settings {
    /// Version of the trials and their seeds.
    pub format: u32,
    /// Checksum of the mesh, or None for the house of our own making.
    pub mesh_crc32: Option<u32>,
    /// Checksum of the network that labels images, where one does.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub model_crc32: Option<u32>,
    /// Checksum of two given scans and of how they are calibrated.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub scans_crc32: Option<u32>,
    /// Side of a cubic cell of the robot's map, metres.
    pub cell_side_m: f64,
    /// Views of the robot's survey.
    pub survey_views: usize,
    /// Maps, each from a survey of its own; trial `seed` takes map `seed % map_seeds`.
    pub map_seeds: u64,
    /// Pictures that the headset takes.
    pub headset_scans: usize,
    /// Share of the points of each picture that is kept, from its left.
    #[serde(skip_serializing_if = "is_whole", default = "whole")]
    pub view_part: f64,
    /// Point at which starts are moved and turned.
    pub pivot: Pivot,
}

fn whole() -> f64 {
    1.0
}

fn is_whole(part: &f64) -> bool {
    *part == whole()
}

/// Point at which a start is moved and turned.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pivot {
    /// The midst of the seen points.
    #[default]
    View,
    /// The headset: the seen points then move farther than is said.
    Headset,
}

impl Settings {
    /// The mesh in words.
    pub(crate) fn mesh_name(&self) -> String {
        match self.mesh_crc32 {
            Some(crc) => format!("mesh with CRC-32 {crc:08x}"),
            None => "the house of our own making".to_owned(),
        }
    }
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            format: FORMAT,
            mesh_crc32: None,
            model_crc32: None,
            scans_crc32: None,
            cell_side_m: 0.05,
            survey_views: 384,
            map_seeds: 3,
            headset_scans: 1,
            view_part: whole(),
            pivot: Pivot::default(),
        }
    }
}

/// A start: what is known of the pose before.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Start {
    /// The truth, moved by metres and turned about the vertical by degrees, both at the [`Pivot`].
    Off {
        /// Metres.
        m: f64,
        /// Degrees.
        deg: f64,
    },
    /// No start.
    None,
}

impl fmt::Display for Start {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Start::Off { m, deg } => write!(f, "{m}/{deg}"),
            Start::None => f.write_str("none"),
        }
    }
}

impl FromStr for Start {
    type Err = String;

    fn from_str(text: &str) -> Result<Start, String> {
        let text = text.trim();
        if text == "none" {
            return Ok(Start::None);
        }
        let fault = || format!("{text:?} is neither none nor metres/degrees, as in 0.3/10");
        let (m, deg) = text.split_once('/').ok_or_else(fault)?;
        let number = |word: &str, most: f64| {
            let value = word.parse::<f64>().ok();
            value.filter(|v| (0.0..=most).contains(v)).ok_or_else(fault)
        };
        Ok(Start::Off {
            m: number(m, 100.0)?,
            deg: number(deg, 180.0)?,
        })
    }
}

/// Most seeds of one run: all of its trials are listed before the first.
const MAX_SEEDS: f64 = 100_000.0;

/// Checks the number of seeds; none at all makes the report of trials that are there.
pub(super) fn check_seeds(seeds: u64) -> Result<(), AnyError> {
    within("seeds", seeds as f64, 0.0, MAX_SEEDS)
}

/// The trials of one run.
#[derive(Clone, PartialEq, Debug)]
pub struct Plan {
    /// Scenes that are looked at.
    pub scenes: Vec<Scene>,
    /// Seed of the first trial of a cell.
    pub first_seed: u64,
    /// Trials of a cell; their seeds follow each other.
    pub seeds: u64,
    /// Shares of the view that are labelled wrongly.
    pub flips: Vec<f64>,
    /// Starts.
    pub starts: Vec<Start>,
    /// Names of the methods that are run; all of them if empty.
    pub methods: Vec<String>,
    /// Seeds of each scene whose times are measured with nothing else running.
    pub timed_seeds: u64,
    /// Folder to which the looks are written whose times are measured, for other programs.
    pub looks: Option<PathBuf>,
}

impl Default for Plan {
    /// Issue 4, acceptance 4.
    fn default() -> Plan {
        Plan {
            scenes: Scene::ALL.to_vec(),
            first_seed: 0,
            seeds: 30,
            flips: vec![0.0, 0.2, 0.4, 0.6, 0.8],
            starts: vec![
                Start::Off { m: 0.3, deg: 10.0 },
                Start::Off { m: 0.8, deg: 35.0 },
                Start::None,
            ],
            methods: Vec::new(),
            timed_seeds: 4,
            looks: None,
        }
    }
}

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Cell {
    pub scene: String,
    /// Seed of view, start and labels.
    pub seed: u64,
    /// Share of the view that is labelled wrongly.
    pub q: f64,
    /// Start, as [`Start`] is written.
    pub start: String,
}

impl Cell {
    pub fn key(&self) -> (&str, u64, u64, &str) {
        (&self.scene, self.seed, self.q.to_bits(), &self.start)
    }
}

impl Plan {
    pub(super) fn wants(&self, method: &str) -> bool {
        self.methods.is_empty() || self.methods.iter().any(|name| name == method)
    }

    /// All views, seed by seed, so that what is done first covers all scenes.
    pub fn views(&self) -> Vec<(u64, Scene)> {
        let of_seed = |seed| self.scenes.iter().map(move |&scene| (seed, scene));
        let seeds = (0..self.seeds).map(|i| self.first_seed.wrapping_add(i));
        seeds.flat_map(of_seed).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_read_as_they_are_written() {
        for start in Plan::default().starts {
            assert_eq!(start.to_string().parse(), Ok(start));
        }
        assert_eq!("0/0".parse(), Ok(Start::Off { m: 0.0, deg: 0.0 }));
        for text in ["", "0.3", "-1/5", "nan/5", "1/181", "some"] {
            assert!(text.parse::<Start>().is_err(), "{text}");
        }
    }

    #[test]
    fn the_first_views_cover_all_scenes() {
        let views = Plan::default().views();
        assert_eq!(views.len(), 120);
        assert!(views[..4].iter().all(|(seed, _)| *seed == 0));
        let later = Plan {
            first_seed: 7,
            seeds: 1,
            ..Plan::default()
        };
        assert!(later.views().iter().all(|(seed, _)| *seed == 7));
    }
}
