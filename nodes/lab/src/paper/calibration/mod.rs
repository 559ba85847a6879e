//! Nakamura et al. 2019, "Calibration System Using Semantic-ICP for Visualization of Robot Spatial Perception Through
//! Mixed Reality", computed anew.

mod context;
mod equations;
mod label_maps;
mod trials;

use crate::evaluate::{Results, Settings, Testbed, Trial, read_house};
use crate::paper::command;
use crate::paper::sections::{Part, in_order};
use crate::report::{Report, Section};
use crate::{AnyError, at};
use context::Context;
use std::path::PathBuf;
use std::slice;

/// Options of the report.
#[derive(Clone, Debug)]
pub struct Options {
    /// The same seed gives the same bytes.
    pub seed: u64,
    /// Fewer trials.
    pub quick: bool,
    /// PLY of a house and YAML with the names of its classes; else a house of our own.
    pub mesh: Option<(PathBuf, PathBuf)>,
    /// Folder of an evaluation whose trials are taken; else they are run.
    pub results: Option<PathBuf>,
    /// Trials at once.
    pub threads: usize,
}

/// Seeds of trials that each seed of a report has for itself.
const SEEDS_EACH: u64 = 1000;
/// Views of the robot's survey in a quick run.
const QUICK_VIEWS: usize = 192;

type Make = fn(&Context, &mut dyn FnMut(f64)) -> Result<Vec<Section>, AnyError>;

/// Sections in the order of the report.
const SECTIONS: [Part<Make>; 3] = [
    ("equations", 8.0, equations::sections),
    ("Table 1", 85.0, trials::sections),
    ("Figs. 3 and 4", 5.0, label_maps::sections),
];

/// Computes all sections; `progress` gets the share done and the name of the next section.
pub fn run(options: &Options, progress: &mut dyn FnMut(f64, &str)) -> Result<Report, AnyError> {
    progress(0.0, "house");
    let context = context(options)?;
    let sections = in_order(&SECTIONS, progress, |make, tell| make(&context, tell))?;
    let title = "Nakamura, El Hafi, Hagiwara and Taniguchi 2019, Calibration System Using Semantic-ICP for Visualization of Robot \
                 Spatial Perception Through Mixed Reality";
    let command = command(options);
    Ok(Report::of_paper(title, command, options.quick, sections))
}

fn context(options: &Options) -> Result<Context, AnyError> {
    let (house, mesh_crc32) = read_house(options.mesh.as_ref(), options.seed)?;
    let (settings, evaluated) = evaluated(options, mesh_crc32)?;
    Ok(Context {
        testbed: Testbed::new(house, &settings)?,
        evaluated,
        seed: options.seed,
        first_seed: options.seed.wrapping_sub(1).wrapping_mul(SEEDS_EACH),
        quick: options.quick,
        threads: options.threads.max(1),
        cell_side_m: settings.cell_side_m,
    })
}

/// Settings of the trials, and the trials if they were run before.
fn evaluated(
    options: &Options,
    mesh_crc32: Option<u32>,
) -> Result<(Settings, Option<Vec<Trial>>), AnyError> {
    let Some(folder) = &options.results else {
        let default = Settings::default();
        let (map_seeds, survey_views) = match options.quick {
            true => (1, QUICK_VIEWS),
            false => (default.map_seeds, default.survey_views),
        };
        let settings = Settings {
            mesh_crc32,
            map_seeds,
            survey_views,
            ..default
        };
        return Ok((settings, None));
    };
    let (settings, trials) = Results::read(folder)?;
    if settings.mesh_crc32 != mesh_crc32 {
        let article = settings.mesh_crc32.map_or("", |_| "a ");
        let mesh = settings.mesh_name();
        let words = "give the same --mesh and --classes, if any";
        let words = format!("these trials are of {article}{mesh}; {words}");
        return Err(at(folder)(words));
    }
    Ok((settings, Some(trials)))
}

/// The command line, with the names of files.
fn command(options: &Options) -> String {
    let mesh = options.mesh.iter();
    let mesh = mesh.flat_map(|(mesh, classes)| [("mesh", mesh), ("classes", classes)]);
    let files = mesh.chain(options.results.iter().map(|folder| ("results", folder)));
    let files = files.map(|(option, path)| (option, slice::from_ref(path)));
    command::command("calibration", (options.seed, options.quick), files)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(results: Option<PathBuf>) -> Options {
        Options {
            seed: 4,
            quick: true,
            mesh: Some(("a/b/house.ply".into(), "a/classes.yaml".into())),
            results,
            threads: 1,
        }
    }

    #[test]
    fn the_command_names_files_but_not_where_they_are() {
        assert_eq!(
            command(&options(Some("/tmp/x/trials".into()))),
            "lattice paper calibration --seed 4 --quick --mesh house.ply --classes classes.yaml --results trials"
        );
    }

    #[test]
    fn sections_do_not_depend_on_threads() {
        let options = Options {
            mesh: None,
            ..options(None)
        };
        let on = |threads: usize| {
            let all = || {
                let context = context(&options).unwrap();
                // Trials take most of the time; their loop has a test of its own.
                let quick = SECTIONS.iter().filter(|(name, ..)| *name != "Table 1");
                let make = |(_, _, make): &Part<Make>| make(&context, &mut |_| {}).unwrap();
                let sections: Vec<Section> = quick.flat_map(make).collect();
                assert_eq!(sections.len(), 6);
                // With the pictures, which JSON leaves out.
                format!("{sections:?}")
            };
            crate::pool(threads).unwrap().install(all)
        };
        assert!(on(1) == on(3));
    }

    #[test]
    fn trials_of_another_house_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings {
            mesh_crc32: Some(7),
            ..Settings::default()
        };
        drop(Results::open(folder.path(), &settings).unwrap());
        let options = options(Some(folder.path().to_owned()));
        let (found, trials) = evaluated(&options, Some(7)).unwrap();
        assert_eq!((found, trials), (settings, Some(Vec::new())));
        let fault = evaluated(&options, None).unwrap_err().to_string();
        let words = "these trials are of a mesh with CRC-32 00000007; give";
        assert!(fault.contains(words), "{fault}");
    }
}
