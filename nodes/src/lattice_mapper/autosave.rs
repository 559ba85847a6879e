//! Automatic saves of a changing map.

use std::thread::{self, JoinHandle};
use std::time::Duration;

use lattice_runtime::Shutdown;
use lattice_runtime::params::{ParamError, Params};

use super::map_folder::{MapFolder, Refusal};
use super::state::LatticeMapper;

/// Longest settable period between saves.
const MAX_PERIOD_S: f64 = 86_400.0;

/// File and period of automatic saves.
pub(super) struct AutosaveOptions {
    pub file: String,
    /// Zero: never.
    pub period: Duration,
}

impl AutosaveOptions {
    /// Reads the parameters `autosave_period_s` and `autosave_file`.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        let period_s = params.f64_in("autosave_period_s", 0.0, 0.0..=MAX_PERIOD_S)?;
        Ok(Self {
            file: params.string("autosave_file", "autosave.lattice")?,
            period: Duration::from_secs_f64(period_s),
        })
    }
}

/// State of a map as returned by [`LatticeMapper::state`].
type State = (u64, u64);

/// Automatic saves of one map to one file.
pub(super) struct Autosave {
    maps: MapFolder,
    file: String,
    /// Zero: never.
    pub period: Duration,
    /// State of the last saved map.
    saved: State,
    writing: Option<(JoinHandle<Result<(), Refusal>>, State)>,
    /// Reason for the last failed save.
    failed: Option<String>,
    shutdown: Shutdown,
}

impl Autosave {
    /// Creates the saves of a map, the first one after its next change.
    pub(super) fn new(
        options: AutosaveOptions,
        maps: &MapFolder,
        machine: &LatticeMapper,
        shutdown: Shutdown,
    ) -> Self {
        Self {
            maps: maps.clone(),
            file: options.file,
            period: options.period,
            saved: machine.state(),
            writing: None,
            failed: None,
            shutdown,
        }
    }

    /// Starts saving a changed map, unless a save is in progress.
    pub(super) fn save(&mut self, machine: &LatticeMapper) {
        let state = machine.state();
        self.look();
        if self.period.is_zero() || self.writing.is_some() || state == self.saved {
            return;
        }
        let (maps, file, contents) = (self.maps.clone(), self.file.clone(), machine.contents());
        let writing = self.shutdown.writing();
        let write = move || {
            let result = maps.write(&file, &contents);
            drop(writing);
            result
        };
        match thread::Builder::new()
            .name("autosave".to_owned())
            .spawn(write)
        {
            Ok(thread) => self.writing = Some((thread, state)),
            Err(error) => self.fail(error.to_string()),
        }
    }

    /// Saves unsaved changes and waits for completion.
    pub(super) fn finish(&mut self, machine: &LatticeMapper) {
        let _writing = self.shutdown.writing();
        self.wait();
        self.save(machine);
        self.wait();
    }

    /// Reason why the newest map is not saved; `None` if it is.
    pub(super) fn problem(&self) -> Option<String> {
        let reason = self.failed.as_ref()?;
        Some(format!("the map is not saved: {reason}"))
    }

    /// Handles a finished save.
    fn look(&mut self) {
        if self
            .writing
            .as_ref()
            .is_some_and(|(thread, _)| thread.is_finished())
        {
            self.wait();
        }
    }

    fn wait(&mut self) {
        let Some((thread, state)) = self.writing.take() else {
            return;
        };
        match thread.join() {
            Ok(Ok(())) => (self.saved, self.failed) = (state, None),
            Ok(Err(refusal)) => self.fail(refusal.to_string()),
            Err(_) => self.fail("its thread ended early".to_owned()),
        }
    }

    fn fail(&mut self, reason: String) {
        // Logged once per reason, not in each period.
        if self.failed.as_ref() != Some(&reason) {
            log::error!("the map is not saved: {reason}");
        }
        self.failed = Some(reason);
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use lattice_core::cloud::Cloud;
    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::VoxelList;
    use lattice_core::voxels::file::MapContents;
    use nalgebra::Vector3;

    use super::*;
    use crate::lattice_mapper::MapperOptions;
    use crate::lattice_mapper::initial_map::InitialMap;
    use crate::start::NodeError;

    fn machine(kind: LatticeKind) -> LatticeMapper {
        let lattice = Lattice::new(kind, 0.125).unwrap();
        LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap()
    }

    /// Another map for each length.
    fn contents(length: usize) -> MapContents {
        let lattice = machine(LatticeKind::Bcc).list().lattice().clone();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 1000).unwrap();
        list.insert(&Cloud {
            stamp_ns: 5,
            datum_m: Vector3::zeros(),
            offsets_m: (0..length).map(|x| [x as f32, 0.0, 0.0]).collect(),
        });
        MapContents::from_list(&list)
    }

    fn start(
        folder: &std::path::Path,
        kind: LatticeKind,
        options: &str,
    ) -> Result<(LatticeMapper, Autosave), NodeError> {
        let arguments = options.split(' ').flat_map(|option| ["-p", option]);
        let arguments = ["--ros-args"].into_iter().chain(arguments);
        let args = lattice_runtime::ros_args::RosArgs::parse(arguments.map(str::to_owned)).unwrap();
        let params = Params::load(&args, "/lattice_mapper").unwrap();
        let maps = MapFolder::new(&folder.display().to_string()).unwrap();
        let mut machine = machine(kind);
        let options = AutosaveOptions::from_params(&params)?;
        InitialMap::from_params(&params, &options.file)?.load(&maps, &mut machine, 1000)?;
        let autosave = Autosave::new(options, &maps, &machine, Shutdown::default());
        Ok((machine, autosave))
    }

    #[test]
    fn a_killed_mapper_goes_on_from_the_last_save() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("autosave.lattice");
        let both = "autosave_period_s:=1.0 resume:=true";
        let (mut first, mut autosave) = start(folder.path(), LatticeKind::Bcc, both).unwrap();
        autosave.save(&first);
        autosave.wait();
        assert!(!file.exists(), "nothing has changed");
        first.load(contents(100), 4).unwrap();
        autosave.save(&first);
        autosave.wait();
        // Killed here: what came after the save is lost, and no more.
        first.load(contents(200), 5).unwrap();
        let (second, _) = start(folder.path(), LatticeKind::Bcc, both).unwrap();
        assert_eq!(second.list().len(), 100);
        // Ended instead, it loses nothing.
        autosave.finish(&first);
        let (third, _) = start(folder.path(), LatticeKind::Bcc, both).unwrap();
        assert_eq!(third.list().sorted(), first.list().sorted());
        let (empty, _) = start(folder.path(), LatticeKind::Bcc, "resume:=false").unwrap();
        assert!(empty.list().is_empty());
    }

    #[test]
    fn what_cannot_be_resumed_or_saved_is_said_and_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("autosave.lattice");
        let (mut machine, mut autosave) =
            start(folder.path(), LatticeKind::Bcc, "autosave_period_s:=1.0").unwrap();
        machine.load(contents(10), 4).unwrap();
        fs::write(&file, "not a map").unwrap();
        autosave.finish(&machine);
        let problem = autosave.problem().unwrap();
        assert!(problem.contains("not replaced"), "{problem}");
        let refused = start(folder.path(), LatticeKind::Bcc, "resume:=true").map(drop);
        assert!(refused.unwrap_err().to_string().contains("not a map file"));
        fs::remove_file(&file).unwrap();
        autosave.finish(&machine);
        assert_eq!(autosave.problem(), None);
        let refused = start(folder.path(), LatticeKind::Fcc, "resume:=true").map(drop);
        assert!(
            refused
                .unwrap_err()
                .to_string()
                .contains("autosave.lattice")
        );
        for options in ["autosave_period_s:=-1.0", "autosave_period_s:=.nan"] {
            assert!(start(folder.path(), LatticeKind::Bcc, options).is_err());
        }
    }
}
