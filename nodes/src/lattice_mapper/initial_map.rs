//! The map of a mapper at its start: that of the last save, or of a file.

use std::io::ErrorKind;

use lattice_core::voxels::file::MapContents;
use lattice_core::voxels::{Payload, PointColumns, VoxelList};
use lattice_runtime::params::{ParamError, Params};
use nalgebra::Vector3;

use super::map_folder::{MapFolder, Refusal};
use super::state::LatticeMapper;
use crate::files::points::PointFile;
use crate::start::NodeError;

/// Relative rounding of the edge of a cell, which is the cube root of its volume.
const ROUNDING: f64 = 1e-9;

/// Files of the first map, below `map_dir`.
pub(super) struct InitialMap {
    /// File of the last save, if the node resumes.
    saved: Option<String>,
    /// File that is used where there is no save.
    file: Option<String>,
}

impl InitialMap {
    /// Reads the parameters `resume` and `map_file`, which is not the file of saves.
    pub(super) fn from_params(params: &Params, autosave_file: &str) -> Result<Self, ParamError> {
        let resumes = params.bool("resume", false)?;
        let file = params.string("map_file", "")?;
        if file == autosave_file {
            let problem = format!("{file:?} is `autosave_file`, which saves replace: rename one");
            return Err(params.invalid("map_file", problem));
        }
        Ok(Self {
            saved: resumes.then(|| autosave_file.to_owned()),
            file: (!file.is_empty()).then_some(file),
        })
    }

    /// Loads the map into an empty machine of at most `max_voxels`.
    pub(super) fn load(
        &self,
        maps: &MapFolder,
        machine: &mut LatticeMapper,
        max_voxels: usize,
    ) -> Result<(), NodeError> {
        if let Some(saved) = &self.saved
            && resume(maps, saved, machine, max_voxels)?
        {
            return Ok(());
        }
        let Some(file) = &self.file else {
            return Ok(());
        };
        let failed = |why: &dyn std::fmt::Display| format!("cannot begin with `map_file`: {why}");
        let contents = match maps.read(file, max_voxels) {
            Err(Refusal::NotAMap(_)) => {
                let points = maps.read_points(file).map_err(|refusal| failed(&refusal))?;
                voxels_of(&points, machine, max_voxels)
                    .map_err(|why| failed(&format!("{file:?} {why}")))?
            }
            contents => contents.map_err(|refusal| failed(&refusal))?,
        };
        let voxels = put(contents, machine).map_err(|why| failed(&format!("{file:?}: {why}")))?;
        log::info!("the map begins with {voxels} voxels of {file:?}");
        Ok(())
    }
}

/// Loads the last save; false if there is none.
fn resume(
    maps: &MapFolder,
    file: &str,
    machine: &mut LatticeMapper,
    max_voxels: usize,
) -> Result<bool, NodeError> {
    let contents = match maps.read(file, max_voxels) {
        Ok(contents) => contents,
        Err(Refusal::Io(_, error)) if error.kind() == ErrorKind::NotFound => {
            log::info!("{file:?} does not exist, so nothing is resumed");
            return Ok(false);
        }
        Err(refusal) => return Err(format!("cannot resume: {refusal}").into()),
    };
    let voxels = put(contents, machine);
    let voxels = voxels.map_err(|refusal| format!("cannot resume from {file:?}: {refusal}"))?;
    log::info!("resumed with {voxels} voxels of {file:?}");
    Ok(true)
}

fn put(contents: MapContents, machine: &mut LatticeMapper) -> Result<usize, String> {
    // The epoch has not been published yet.
    let (epoch, _) = machine.state();
    let voxels = machine.load(contents, epoch);
    voxels.map_err(|refusal| refusal.to_string())
}

/// Cells of all points of a file in the map frame; the error continues a sentence about the file.
fn voxels_of(
    file: &PointFile,
    machine: &LatticeMapper,
    max_voxels: usize,
) -> Result<MapContents, String> {
    if let Some(voxel_m) = file.voxel_m
        && machine.list().lattice().cell_volume_m3().cbrt() < (2.0 - ROUNDING) * voxel_m
    {
        return Err(format!(
            "has voxels of {voxel_m} m, whose centres leave holes among smaller cells than twice that: set \
             `cell_size_m` to {} or more",
            2.0 * voxel_m
        ));
    }
    let list = machine.list();
    let payload = Payload {
        labels: !file.labels.is_empty(),
        ..Payload::default()
    };
    let list = VoxelList::new(list.lattice().clone(), list.datum_m(), max_voxels);
    let mut list = list
        .map_err(|error| error.to_string())?
        .with_payload(payload);
    let columns = PointColumns {
        labels: &file.labels,
        ..PointColumns::default()
    };
    let report = list.insert_points(Vector3::zeros(), &file.points_m, columns);
    if report.out_of_range > 0 {
        return Err(format!(
            "has {} points more than a million cells from {:?}: set `datum_m` near them",
            report.out_of_range,
            list.datum_m().as_slice()
        ));
    }
    if report.list_full > 0 {
        return Err(format!(
            "has points in more than {max_voxels} cells: raise `max_voxels`"
        ));
    }
    if report.inserted == 0 {
        return Err("has no points".to_owned());
    }
    Ok(MapContents::from_list(&list))
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::path::Path;

    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::file::WriteOptions;
    use lattice_runtime::ros_args::RosArgs;

    use super::*;
    use crate::files::export::write_octree;
    use crate::lattice_mapper::MapperOptions;
    use crate::octree::OctreeForm;

    /// Voxels of points in a row, 1 m apart.
    fn row(kind: LatticeKind, cell_volume_m3: f64, length: usize) -> VoxelList {
        let lattice = Lattice::new(kind, cell_volume_m3).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 1000).unwrap();
        let points: Vec<_> = (0..length).map(|x| [x as f64, 2.0, -3.0]).collect();
        list.insert_points(Vector3::zeros(), &points, PointColumns::default());
        list
    }

    fn write(folder: &Path, name: &str, list: &VoxelList) {
        let file = File::create(folder.join(name)).unwrap();
        let map = MapContents::from_list(list);
        map.write(file, &WriteOptions::default()).unwrap();
    }

    /// The map of a mapper with cells of 0.5 m that was started with these parameters, or the reason against it.
    fn begin(folder: &Path, kind: LatticeKind, options: &str) -> Result<VoxelList, String> {
        let arguments = options.split(' ').flat_map(|option| ["-p", option]);
        let arguments = ["--ros-args"].into_iter().chain(arguments);
        let args = RosArgs::parse(arguments.map(str::to_owned)).unwrap();
        let params = Params::load(&args, "/lattice_mapper").unwrap();
        let options = MapperOptions::new(Lattice::new(kind, 0.125).unwrap());
        let mut machine = LatticeMapper::new(options, 1).unwrap();
        let maps = MapFolder::new(&folder.display().to_string()).unwrap();
        let initial = InitialMap::from_params(&params, "autosave.lattice");
        let initial = initial.map_err(|error| error.to_string())?;
        let begun = initial.load(&maps, &mut machine, 1000);
        begun.map_err(|error| error.to_string())?;
        Ok(machine.list().clone())
    }

    fn keys(list: &VoxelList) -> Vec<[i32; 3]> {
        let voxels = list.sorted();
        voxels.iter().map(|(key, _)| key.unpack()).collect()
    }

    #[test]
    fn a_map_begins_with_a_file_unless_there_is_a_later_save() {
        let folder = tempfile::tempdir().unwrap();
        let both = "map_file:=site.lattice resume:=true";
        write(
            folder.path(),
            "site.lattice",
            &row(LatticeKind::Bcc, 0.125, 100),
        );
        let begin = |kind, options: &str| begin(folder.path(), kind, options);
        assert_eq!(begin(LatticeKind::Bcc, both).unwrap().len(), 100);
        write(
            folder.path(),
            "autosave.lattice",
            &row(LatticeKind::Bcc, 0.125, 50),
        );
        assert_eq!(begin(LatticeKind::Bcc, both).unwrap().len(), 50);
        for (file, kind, reason) in [
            ("nowhere.lattice", LatticeKind::Bcc, "nowhere.lattice"),
            ("../site.lattice", LatticeKind::Bcc, "map_dir"),
            ("site.lattice", LatticeKind::Fcc, "set `lattice`"),
            ("autosave.lattice", LatticeKind::Bcc, "`autosave_file`"),
        ] {
            let message = begin(kind, &format!("map_file:={file}")).unwrap_err();
            assert!(
                message.contains("`map_file`") && message.contains(reason),
                "{message}"
            );
        }
    }

    #[test]
    fn points_and_octrees_become_cells() {
        let folder = tempfile::tempdir().unwrap();
        let begin = |name: &str, bytes: &[u8]| {
            fs::write(folder.path().join(name), bytes).unwrap();
            begin(
                folder.path(),
                LatticeKind::Cubic,
                &format!("map_file:={name}"),
            )
        };
        let points = begin("points.xyz", b"0 0 0\n3 0 0\n3 0.001 0\n").unwrap();
        let counts: Vec<_> = points
            .sorted()
            .iter()
            .map(|(_, voxel)| voxel.count)
            .collect();
        assert_eq!(counts, [1, 2]);
        let octree = |list: &VoxelList| {
            let mut bytes = Vec::new();
            write_octree(list, OctreeForm::Binary, &mut bytes).unwrap();
            bytes
        };
        let list = row(LatticeKind::Cubic, 0.125, 9);
        assert_eq!(
            keys(&begin("site.bt", &octree(&list)).unwrap()),
            keys(&list)
        );
        let coarse = octree(&row(LatticeKind::Cubic, 1.0, 9));
        for (name, bytes, reason) in [
            ("coarse.bt", &coarse[..], "set `cell_size_m` to 1 or more"),
            ("far.xyz", b"700000 6000000 30\n", "set `datum_m`"),
            ("empty.xyz", b"", "empty.xyz"),
            ("cut.bt", &coarse[..coarse.len() - 1], "cut.bt"),
        ] {
            let message = begin(name, bytes).unwrap_err();
            assert!(
                message.contains("`map_file`") && message.contains(reason),
                "{message}"
            );
        }
    }
}
