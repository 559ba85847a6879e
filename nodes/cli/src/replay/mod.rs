//! `lattice replay`: maps from a log.

mod arguments;
mod check;
mod dds_replay;
mod depth;
mod map_files;
pub mod node_process;
mod params;
mod processes;

use std::ffi::OsString;
use std::path::Path;

use lattice_core::lattice::Lattice;
use lattice_core::voxels::file::WriteOptions;

use super::progress::Progress;
use super::{CliResult, Lattices, fleet, init_logging};
pub use arguments::Replay;
pub use check::{Better, CHECK_POINTS, CHECK_S, WRONG_S};
use lattice_bag::BagReader;
use lattice_nodes::enu_transformer::TransformerOptions;
use lattice_nodes::files::atomic_write;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::replay::{
    self, CameraWishes, DepthClouds, Pipeline, RunReport, Slice, TopicPlan, TopicWishes,
};
use lattice_nodes::voxel_marker_publisher::MarkerOptions;
use lattice_runtime::LoopbackDomain;
pub use map_files::map_file;
use processes::DdsReplay;
pub use processes::{param, quoted, yaml_text};

/// Participants on loopback beside the player and the transformer: a lattice needs two of them, a depth camera one.
const MAX_LOOPBACK_NODES: usize = 10;

impl Replay {
    /// Replay of a log in this process with default parameters, which writes the map.
    #[cfg(feature = "viewer")]
    pub fn of_log(bag: &std::path::Path, map_out: &std::path::Path) -> Self {
        Self {
            bag: bag.to_owned(),
            direct: true,
            rate: 1.0,
            map_out: Some(map_out.to_owned()),
            ..Self::default()
        }
    }

    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let report = self.replay()?;
        // Warnings were logged when they occurred.
        for note in report
            .transformer
            .notes
            .iter()
            .filter(|note| !note.is_warning)
        {
            eprintln!("{}: {}", note.topic, note.text);
        }
        if self.json {
            println!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            println!("{report}");
        }
        report.check()?;
        if let Some(text) = self.refused(&report) {
            let kept = "no map was written; --trust-attitude writes it";
            return Err(format!("{text} ({kept})").into());
        }
        Ok(())
    }

    /// Reason for which the map of a report is not written.
    fn refused<'a>(&self, report: &'a RunReport) -> Option<&'a str> {
        report.wrong_attitude().filter(|_| !self.trust_attitude)
    }

    /// Runs the replay and returns its report; the map may be empty.
    pub fn replay(&self) -> CliResult<RunReport> {
        self.check_names()?;
        if self.direct {
            return self.replay_direct();
        }
        for (option, given) in [
            ("--out-table", self.out_table.is_some()),
            ("--markers", self.markers),
            ("--start", self.start.is_some()),
            ("--stop", self.stop.is_some()),
        ] {
            if given {
                return Err(format!("{option} needs --direct").into());
            }
        }
        let bag = BagReader::open(&self.bag)?.past_cut();
        let plan = self.plan(&bag)?;
        if plan.odometry.is_some() {
            eprintln!(
                "replayed directly (--direct), as poses come from lidar odometry over the whole log"
            );
            return self.replay_planned(&bag, &plan);
        }
        let fit = self.checked_poses(&bag, &plan)?;
        let lattices: Vec<_> = self.maps()?.into_iter().map(|map| map.lattice).collect();
        let cameras = plan.cameras.len();
        let most = MAX_LOOPBACK_NODES.saturating_sub(cameras) / 2;
        if lattices.len() > most {
            let count = lattices.len();
            return Err(format!(
                "{count} lattices over DDS on loopback: at most {most} are possible with {cameras} depth cameras; \
                 use --direct"
            )
            .into());
        }
        // Separate from robots and other replays, regardless of ROS_DOMAIN_ID.
        let domain = LoopbackDomain::take()?;
        let report = processes::run(&DdsReplay {
            options: self,
            reader: &bag,
            plan: &plan,
            lattices,
            domain,
        })?;
        Ok(RunReport { fit, ..report })
    }

    fn replay_direct(&self) -> CliResult<RunReport> {
        let bag = BagReader::open(&self.bag)?.past_cut();
        let plan = self.plan(&bag)?;
        self.replay_planned(&bag, &plan)
    }

    /// Options of the transformer with the topics and frames of a plan.
    pub fn transformer(&self, plan: &TopicPlan) -> CliResult<TransformerOptions> {
        let mut transformer = TransformerOptions::from_params(&self.params_of("enu_transformer")?)?;
        transformer.ins.source = plan.source;
        transformer.map_frame.clone_from(&plan.map_frame);
        transformer.map_frame_is_given = true;
        transformer.base_frame.clone_from(&plan.base_frame);
        transformer.ins.base_frame.clone_from(&plan.base_frame);
        if let Some(name) = transformer.ins.ignored() {
            return Err(format!("parameter {name}: the source {} ignores it", plan.source).into());
        }
        Ok(transformer)
    }

    fn replay_planned(&self, bag: &BagReader, plan: &TopicPlan) -> CliResult<RunReport> {
        let fit = self.checked_poses(bag, plan)?;
        let transformer = self.transformer(plan)?;
        let mut maps = self.maps()?;
        for map in &mut maps {
            map.map_frame.clone_from(&plan.map_frame);
        }
        let markers = MarkerOptions::from_params(&self.params_of("voxel_marker_publisher")?)?;
        let mut pipeline = Pipeline::new(transformer, maps, self.markers.then_some(&markers))?;
        if !plan.cameras.is_empty() {
            let params = self.params_of("semantic_cloud")?;
            pipeline.set_depth_clouds(DepthClouds::new(bag, plan, &params)?);
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            .build()?;
        let progress = Progress::new("replay");
        let source = self.bag.display().to_string();
        let report = pool.install(|| {
            let tell = &mut |done| progress.set(done);
            replay::run(bag, plan, &self.slice(), &mut pipeline, &source, tell)
        })?;
        let report = RunReport { fit, ..report };
        progress.done();
        if self.refused(&report).is_some() {
            return Ok(report);
        }
        if let Some(path) = &self.map_out {
            write_maps(path, &pipeline)?;
        }
        if let Some(tables) = &self.out_table {
            self.add_to_tables(tables, &pipeline, &report)?;
        }
        Ok(report)
    }

    /// Chooses topics and frames, and logs them.
    pub fn plan(&self, bag: &BagReader) -> CliResult<TopicPlan> {
        let plan = replay::plan(bag, &self.wishes()?)?;
        for line in &plan.choices {
            eprintln!("{line}");
        }
        if plan.cameras.is_empty() {
            self.check_names_of_clouds()?;
        }
        Ok(plan)
    }

    /// Time range of mapped clouds.
    fn slice(&self) -> Slice {
        Slice {
            from_s: self.start.unwrap_or(Slice::WHOLE.from_s),
            to_s: self.stop.unwrap_or(Slice::WHOLE.to_s),
        }
    }

    /// Writes each map to a file, which `lattice-fleet` adds to the tables.
    fn add_to_tables(&self, tables: &Path, pipeline: &Pipeline, report: &RunReport) -> CliResult {
        let folder = tempfile::tempdir()?;
        write_maps(&folder.path().join("map.lat"), pipeline)?;
        let mut arguments: Vec<OsString> = vec!["to-table".into(), "-o".into(), tables.into()];
        if let Some(origin) = report.origin {
            arguments.push("--origin".into());
            arguments.extend(origin.map(|value| value.to_string().into()));
        } else {
            arguments.push("--own-frame".into());
        }
        for file in std::fs::read_dir(folder.path())? {
            arguments.push(file?.path().into());
        }
        fleet::run(arguments)
    }

    /// Mapper options per lattice.
    fn maps(&self) -> CliResult<Vec<MapperOptions>> {
        let params = self.params_of("lattice_mapper")?;
        let given = MapperOptions::from_params(&params)?;
        if params.bool("resume", false)? || !params.string("map_file", "")?.is_empty() {
            eprintln!(
                "resume and map_file of lattice_mapper are not used: the map of a replay in one process begins empty; \
                 `lattice map merge` joins two maps"
            );
        }
        let orientation = match self.orientation {
            Some(orientation) => orientation,
            None => MapperOptions::orientation_from(&params)?,
        };
        let kinds = match &self.lattice {
            Some(Lattices(kinds)) => kinds.clone(),
            None => vec![given.lattice.kind()],
        };
        let volume_m3 = self
            .cells
            .volume_m3()
            .unwrap_or(given.lattice.cell_volume_m3());
        let map = |kind| {
            Ok(MapperOptions {
                lattice: Lattice::new(kind, volume_m3)?.with_orientation(orientation)?,
                ..given.clone()
            })
        };
        kinds.into_iter().map(map).collect()
    }

    fn wishes(&self) -> CliResult<TopicWishes> {
        let params = self.params_of("enu_transformer")?;
        let mut points = self.points.clone();
        if points.is_empty() {
            points = params.string_array("points_topics", &[])?;
        }
        let given = params.string("ins.source", "")?;
        let source = match (self.ins, given.as_str()) {
            (Some(source), _) => Some(source),
            (None, "") => None,
            (None, name) => Some(name.parse()?),
        };
        // The topic parameter belongs to the source parameter.
        let topic = match self.ins {
            Some(_) => String::new(),
            None => params.string("ins.topic", "")?,
        };
        let ins = self.ins_topic.clone();
        let ins = ins.or(Some(topic).filter(|topic| !topic.is_empty()));
        let frame = |name| -> CliResult<Option<String>> {
            let frame = params.string(name, "")?.trim_start_matches('/').to_owned();
            Ok((!frame.is_empty()).then_some(frame))
        };
        Ok(TopicWishes {
            points,
            source,
            ins,
            map_frame: frame("map_frame")?,
            base_frame: frame("base_frame")?,
            cameras: CameraWishes::from_params(&self.params_of("semantic_cloud")?)?,
            ..TopicWishes::default()
        })
    }
}

/// Writes the map of each mapper.
fn write_maps(path: &Path, pipeline: &Pipeline) -> CliResult {
    let several = pipeline.mappers().count() > 1;
    for mapper in pipeline.mappers() {
        let path = map_file(path, mapper.list().lattice().kind(), several);
        let map = mapper.contents();
        atomic_write::write(&path, |file| map.write(file, &WriteOptions::default()))?;
    }
    Ok(())
}
