//! `lattice calibrate mounts`: where a sensor sits with respect to the frame of the poses of a log.

mod answer;

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use lattice_bag::BagReader;
use lattice_core::registration::mounts::{MountError, MountOptions, estimate_mount};
use lattice_nodes::enu_transformer::ins::InsSource;
use lattice_nodes::replay::{self, Role, RunReport, Slice, TopicPlan};

use crate::progress::Progress;
use crate::replay::{Better, CHECK_POINTS, CHECK_S, Replay};
use crate::{CliResult, init_logging};
use answer::Answer;

/// Most points of an estimate.
const POINTS: usize = 300_000;

/// Find where a sensor sits on the machine, from a log with poses
///
/// Prints the correction of the stated mount (tf or parameters), its standard deviation, and which of its numbers the
/// motion does not show. The stated mount must be within 15 degrees and 1 m. The exit status is 0 if at least one
/// number is observable.
#[derive(Args)]
pub struct Mounts {
    /// rosbag2 directory, one mcap or db3 file of it, or a ROS 1 bag
    log: PathBuf,
    /// Topic of the sensor's clouds, needed if the log has several; given several times, these sensors are moved
    /// together, as for a wrong boresight of the INS
    #[arg(long, value_name = "TOPIC")]
    points: Vec<String>,
    /// Source of poses: odometry, inspvax, inspva, navsatfix_imu, pose, pose_with_covariance, or tf; by default
    /// detected in the log
    #[arg(long)]
    ins: Option<InsSource>,
    /// Topic of the INS; by default detected in the log
    #[arg(long, value_name = "TOPIC")]
    ins_topic: Option<String>,
    /// Parameter files of enu_transformer, as for `lattice replay`
    #[arg(long = "params", value_name = "FILE")]
    params: Vec<PathBuf>,
    /// One parameter, as in `-p ins.source:=odometry`
    #[arg(short = 'p', long = "param", value_name = "NAME:=VALUE")]
    param: Vec<String>,
    /// Use clouds from this time on, s of log time from its beginning
    #[arg(long, value_name = "SECONDS")]
    start: Option<f64>,
    /// Use clouds before this time, s of log time from its beginning
    #[arg(long, value_name = "SECONDS")]
    stop: Option<f64>,
    /// Read the first minute and fail if the stated mount is wrong
    #[arg(long)]
    check: bool,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Mounts {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let begin = Instant::now();
        let replay = self.as_replay();
        replay.check_names()?;
        let bag = BagReader::open(&self.log)?.past_cut();
        let plan = replay.plan(&bag)?;
        self.check_plan(&bag, &plan)?;
        let transformer = replay.transformer(&plan)?;
        let base_frame = plan.base_frame.clone();
        let limit = if self.check { CHECK_POINTS } else { POINTS };
        let progress = Progress::new("read");
        let tell = &mut |done| progress.set(done);
        let (log, report) =
            replay::mount_samples(&bag, &plan, &self.slice(), transformer, limit, tell)?;
        progress.done();
        if log.samples.points.is_empty() {
            return Err(cause_of_nothing(&report).into());
        }
        let estimate = estimate_mount(&log.samples, &MountOptions::default());
        let estimate = estimate.map_err(|error| self.explained(error))?;
        let answer = Answer::new(&estimate, &log, base_frame, begin.elapsed().as_secs_f64());
        if self.json {
            println!("{}", serde_json::to_string_pretty(&answer)?);
        } else if !self.check {
            print!("{answer}");
        }
        if self.check {
            return match Better::of(&estimate) {
                Some(Better { text, .. }) => {
                    let log = self.log.display();
                    Err(format!("clouds fit {text}: `lattice calibrate mounts {log}`").into())
                }
                None if self.json => Ok(()),
                None => {
                    println!("the stated mount fits: {}", answer.shown());
                    Ok(())
                }
            };
        }
        match answer.observable() {
            0 => Err(format!(
                "no number of the mount is observable: {}",
                answer.remedies()
            )
            .into()),
            _ => Ok(()),
        }
    }

    /// The replay whose topics, frames and parameters are used.
    fn as_replay(&self) -> Replay {
        Replay {
            bag: self.log.clone(),
            direct: true,
            rate: 1.0,
            params: self.params.clone(),
            param: self.param.clone(),
            points: self.points.clone(),
            ins: self.ins,
            ins_topic: self.ins_topic.clone(),
            ..Replay::default()
        }
    }

    fn slice(&self) -> Slice {
        let from_s = self.start.unwrap_or(Slice::WHOLE.from_s);
        let to_s = match self.check {
            true => from_s + CHECK_S,
            false => Slice::WHOLE.to_s,
        };
        Slice {
            from_s,
            to_s: self.stop.unwrap_or(to_s),
        }
    }

    /// Refuses logs without poses, and several sensors without a choice.
    fn check_plan(&self, bag: &BagReader, plan: &TopicPlan) -> CliResult {
        if plan.odometry.is_some() {
            return Err("the log has no poses: a mount is found against poses of an INS, of odometry or of /tf \
                        (lidar odometry takes its poses from the same clouds); record one of these beside the clouds"
                .into());
        }
        if !plan.cameras.is_empty() {
            return Err("a mount is found for topics of clouds, not of depth images: record the clouds of semantic_cloud".into());
        }
        let clouds = plan.topics(bag, Role::is_cloud);
        let names: Vec<&str> = clouds.map(|topic| topic.name.as_str()).collect();
        if self.points.is_empty() && names.len() > 1 {
            let [first, ..] = names.as_slice() else {
                return Ok(());
            };
            let all = names.join(" --points ");
            return Err(format!(
                "the log has clouds of {} sensors ({}): choose one, as --points {first}, or move them together by --points {all}",
                names.len(),
                names.join(", ")
            )
            .into());
        }
        Ok(())
    }

    /// Error with the remedy.
    fn explained(&self, error: MountError) -> String {
        let remedy = match error {
            MountError::FewPoints { .. } => "use a longer part of the log (--start, --stop)",
            MountError::NoMotion { .. } => {
                "use a part of the log in which the machine drives and turns (--start, --stop)"
            }
            MountError::FewPlanes { .. } => "use a part of the log beside walls (--start, --stop)",
            MountError::Stamps { offset_s } => {
                return format!("{error}: set `time.offset_s: {offset_s:.1}`");
            }
            MountError::NoFit { .. } => {
                "state the mount on tf or by parameters to within this range, or check the poses by `lattice replay`; \
                 a search from nothing, of permuted and mirrored axes too, is not supported"
            }
        };
        format!("{error}: {remedy}")
    }
}

/// Cause for which no point has a pose.
fn cause_of_nothing(report: &RunReport) -> String {
    let cause = report.transformer.cause_of_nothing();
    let cause = cause.unwrap_or_else(|| "no cloud in that part of the log".to_owned());
    format!("no points with poses: {cause}")
}
