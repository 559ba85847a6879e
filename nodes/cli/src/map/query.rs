//! `lattice map query`.

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

use clap::Args;
use lattice_core::lattice::MortonKey;
use lattice_core::navigation::GroundPathOptions;
use lattice_core::query::{PathOptions, Query as Questions, Segment, Steps};
use lattice_core::voxels::VoxelStore;
use lattice_core::voxels::file::read_occupancy;
use nalgebra::Vector3;
use serde::Serialize;

use super::read;
use super::robot::RobotOptions;
use crate::CliResult;

/// Options of `lattice map query`.
#[derive(Args)]
#[command(group = clap::ArgGroup::new("question").required(true))]
pub struct Query {
    /// Map file
    map: PathBuf,
    /// Find the occupied cells with centres nearest to a point, map frame, in m
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, group = "question")]
    nearest: Option<Vec<f64>>,
    /// Number of cells
    #[arg(short, default_value_t = 1, requires = "nearest", value_parser = clap::value_parser!(u32).range(1..))]
    k: u32,
    /// Compute the distance from a point to the nearest occupied polyhedral cell, 0 inside one
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, group = "question")]
    clearance: Option<Vec<f64>>,
    /// Find a short path of a ball between two points, in free segments between centres of cells
    #[arg(
        long, num_args = 6, value_names = ["X", "Y", "Z", "X", "Y", "Z"], allow_negative_numbers = true,
        groups = ["question", "way"], requires = "radius",
    )]
    path: Option<Vec<f64>>,
    /// Radius of the ball, m
    #[arg(long, requires = "path")]
    radius: Option<f64>,
    /// Limit of expanded cells of a path search
    #[arg(long, default_value_t = 2_000_000, requires = "way")]
    max_cells: usize,
    /// Find a short path of a robot on the ground between two points, over slopes, low steps and floors
    #[arg(
        long, num_args = 6, value_names = ["X", "Y", "Z", "X", "Y", "Z"], allow_negative_numbers = true,
        groups = ["question", "ground", "way"],
    )]
    ground_path: Option<Vec<f64>>,
    /// Radius of the robot, m
    #[arg(
        long,
        value_name = "M",
        default_value_t = 0.3,
        requires = "ground_path"
    )]
    robot_radius: f64,
    /// Distance by which the ends may move to ground with room for the robot, m
    #[arg(
        long,
        value_name = "M",
        default_value_t = 0.5,
        requires = "ground_path"
    )]
    tolerance: f64,
    #[command(flatten)]
    robot: RobotOptions,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// An occupied cell and its distance.
#[derive(Serialize)]
struct Cell {
    key: u64,
    center_m: [f64; 3],
    distance_m: f64,
}

#[derive(Serialize)]
struct Way {
    length_m: f64,
    expanded: usize,
    centers_m: Vec<[f64; 3]>,
}

#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum Answer {
    Nearest(Vec<Cell>),
    /// `None` if no cell is occupied.
    Clearance(Option<Cell>),
    Path(Way),
}

impl Query {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let answer = match self.ground_path.as_deref().and_then(ends) {
            Some(ends) => self.on_ground(ends)?,
            None => self.in_cells()?,
        };
        if self.json {
            println!("{}", serde_json::to_string_pretty(&answer)?);
        } else {
            answer.print();
        }
        Ok(())
    }

    /// Answer from the occupied cells alone.
    fn in_cells(&self) -> CliResult<Answer> {
        let here = |e: &dyn std::fmt::Display| format!("{}: {e}", self.map.display());
        let file = File::open(&self.map).map_err(|e| here(&e))?;
        // The file size bounds the memory.
        let store = read_occupancy(BufReader::new(file), usize::MAX).map_err(|e| here(&e))?;
        self.answer(&Questions::new(&store))
    }

    /// Path on the ground, which needs the means of the points.
    fn on_ground(&self, [start, goal]: [Vector3<f64>; 2]) -> CliResult<Answer> {
        let list = read(&self.map)?.0.into_list(usize::MAX);
        let ground = self.robot.projector(&list)?.ground_map()?;
        let options = GroundPathOptions {
            robot_radius_m: self.robot_radius,
            tolerance_m: self.tolerance,
            max_expanded: self.max_cells,
        };
        let path = ground.path(&start, &goal, &options)?;
        Ok(Answer::Path(Way {
            length_m: path.length_m,
            expanded: path.expanded,
            centers_m: path.corners_m.into_iter().map(Into::into).collect(),
        }))
    }

    fn answer(&self, questions: &Questions<impl VoxelStore>) -> CliResult<Answer> {
        let cell = |key: MortonKey, distance_m| Cell {
            key: key.raw(),
            center_m: questions.store().center_m(key).into(),
            distance_m,
        };
        if let Some(point) = self.nearest.as_deref().and_then(first_point) {
            let found = questions.nearest(&point, self.k as usize)?.into_iter();
            return Ok(Answer::Nearest(
                found.map(|near| cell(near.key, near.distance_m)).collect(),
            ));
        }
        if let Some(point) = self.clearance.as_deref().and_then(first_point) {
            let found = questions.clearance(&Segment::point(point), f64::INFINITY)?;
            let found = found.map(|clearance| cell(clearance.key, clearance.distance_m));
            return Ok(Answer::Clearance(found));
        }
        let ends = self.path.as_deref().and_then(ends);
        let (Some([start, goal]), Some(radius_m)) = (ends, self.radius) else {
            return Err(
                "give --nearest, --clearance, --ground-path, or --path with --radius".into(),
            );
        };
        let options = PathOptions {
            radius_m,
            steps: Steps::Touching,
            bounds: None,
            max_expanded: self.max_cells,
        };
        let path = questions.straight_path(&start, &goal, &options)?;
        Ok(Answer::Path(Way {
            length_m: path.length_m,
            expanded: path.expanded,
            centers_m: path.centers_m.into_iter().map(Into::into).collect(),
        }))
    }
}

fn first_point(coordinates: &[f64]) -> Option<Vector3<f64>> {
    let point: [f64; 3] = *coordinates.first_chunk()?;
    Some(point.into())
}

fn ends(coordinates: &[f64]) -> Option<[Vector3<f64>; 2]> {
    let goal = coordinates.get(3..).and_then(first_point)?;
    Some([first_point(coordinates)?, goal])
}

impl Answer {
    fn print(&self) {
        match self {
            Self::Nearest(cells) if cells.is_empty() => println!("no cell is occupied"),
            Self::Clearance(None) => println!("no cell is occupied"),
            Self::Nearest(cells) => cells.iter().for_each(Cell::print),
            Self::Clearance(Some(cell)) => cell.print(),
            Self::Path(way) => {
                println!("{:.3} m, {} cells expanded", way.length_m, way.expanded);
                for [x, y, z] in &way.centers_m {
                    println!("  {x:.3} {y:.3} {z:.3}");
                }
            }
        }
    }
}

impl Cell {
    fn print(&self) {
        let [x, y, z] = self.center_m;
        println!(
            "{:.3} m to the cell at {x:.3} {y:.3} {z:.3}",
            self.distance_m
        );
    }
}
