//! Choice of the topics and frames of a replay: clouds, poses and transforms.

use std::collections::{BTreeMap, BTreeSet};

use lattice_bag::BagReader;
use lattice_msgs::RosMessage;
use lattice_msgs::tf2_msgs::TFMessage;

use super::cameras::{self, Cameras, DepthCamera};
use super::disorder;
use super::packets;
use super::poses::{Log, Poses};
use super::statics::LateStatics;
use super::survey::{self, CloudTopic, FrameTree};
use super::topic_plan::{TopicPlan, TopicWishes};
use super::topics::{Role, TopicError, listing};
use crate::cloud_input::CloudType;
use crate::enu_transformer::ins::InsSource;

/// Assigns roles to the topics in use, and finds the frames that the user does not name.
pub fn plan(bag: &BagReader, wishes: &TopicWishes) -> Result<TopicPlan, TopicError> {
    let mut clouds = survey::clouds(bag)?;
    let mut cameras = match wishes.lidar_odometry {
        true => Cameras::default(),
        false => Cameras::find(bag, &wishes.cameras)?,
    };
    if !wishes.points.is_empty() {
        let wanted = wishes.points.iter();
        let wanted = wanted.map(|name| find_cloud(bag, name, &cameras));
        let wanted: BTreeSet<usize> = wanted.collect::<Result<_, _>>()?;
        clouds.retain(|cloud| wanted.contains(&cloud.topic));
        cameras
            .all
            .retain(|found| wanted.contains(&found.camera.depth));
    } else if clouds.is_empty() {
        cameras.keep_one_per_sensor(bag);
    } else {
        cameras.leave_out(bag);
    }
    cameras.check()?;
    clouds.extend(cameras.all.iter().map(|found| CloudTopic {
        topic: found.camera.depth,
        cloud_type: None,
        frame: found.frame.clone(),
        labelled: found.camera.is_labelled(),
    }));
    if clouds.is_empty() {
        return Err(TopicError::NoClouds {
            types: type_names(),
            has: listing(bag),
            remedy: packets::remedy(bag) + &cameras.remedy,
        });
    }
    let transforms = transforms(bag, &clouds)?;
    let tree = FrameTree::read(bag, transforms.iter().copied())?;
    let mut log = Log {
        bag,
        wishes,
        clouds,
        tree,
        transforms: transforms.clone(),
        choices: cameras.lines,
    };
    let poses = log.poses()?;
    let map_frame = log.map_frame(&poses);
    let chosen = match poses.odometry {
        Some(topic) if wishes.points.is_empty() => vec![log.clouds_of(topic)],
        _ => log.chosen_clouds(&poses, &map_frame),
    };
    let mut roles = BTreeMap::new();
    let type_of = |topic: &usize| log.clouds.iter().find(|cloud| cloud.topic == *topic);
    let of_clouds = chosen.iter().filter_map(type_of);
    let of_clouds = of_clouds.filter_map(|cloud| Some((cloud.topic, cloud.cloud_type?)));
    roles.extend(of_clouds.map(|(topic, cloud_type)| (topic, Role::Cloud(cloud_type))));
    let cameras = cameras.all.into_iter().map(|found| found.camera);
    let cameras: Vec<_> = cameras
        .filter(|camera| chosen.contains(&camera.depth))
        .collect();
    roles.extend(cameras.iter().flat_map(DepthCamera::roles));
    roles.extend(
        poses
            .topics
            .iter()
            .map(|(topic, type_name)| (*topic, Role::Ins(type_name))),
    );
    if poses.odometry.is_none() && poses.source != InsSource::NavsatfixImu {
        let imu = log.gyroscope(&poses.base_frame)?;
        roles.extend(imu.map(|topic| (topic, Role::Imu)));
    }
    let transforms = transforms.into_iter();
    roles.extend(transforms.map(|(topic, is_static)| (topic, Role::Transforms(is_static))));
    let mut plan = TopicPlan {
        roles,
        cameras,
        source: poses.source,
        map_frame,
        base_frame: poses.base_frame,
        odometry: poses.odometry,
        imu: poses.imu,
        pose_delay_ns: 0,
        late_statics: TFMessage::default(),
        choices: Vec::new(),
    };
    let of_ins = plan.names(bag, |role| matches!(role, Role::Ins(_)));
    plan.pose_delay_ns = disorder::delay_ns(bag, of_ins)?;
    plan.choices = said(bag, &plan);
    plan.choices.extend(plan.planar_odometry(bag));
    plan.choices.extend(log.choices);
    let late = LateStatics::read(bag, &plan)?;
    plan.choices.extend(late.lines);
    plan.late_statics = late.message;
    Ok(plan)
}

/// Topics and frames that were taken, in a line each.
fn said(bag: &BagReader, plan: &TopicPlan) -> Vec<String> {
    let names = |wanted: fn(Role) -> bool| {
        let topics = plan.topics(bag, wanted);
        let names =
            topics.map(|topic| format!("{} ({} messages)", topic.name, topic.message_count));
        let names: Vec<String> = names.collect();
        match names.is_empty() {
            true => "none".to_owned(),
            false => names.join(", "),
        }
    };
    let tf = names(|role| matches!(role, Role::Transforms(_)));
    let scans = plan.odometry.and_then(|topic| bag.topics().get(topic));
    let poses = match plan.source {
        InsSource::Tf => tf.clone(),
        _ => names(|role| matches!(role, Role::Ins(_))),
    };
    let poses = match scans {
        Some(scans) => {
            let imu = plan.imu.and_then(|topic| bag.topics().get(topic));
            let imu = imu.map_or(String::new(), |imu| {
                format!(" with the gyroscope of {}", imu.name)
            });
            format!("none in the log; lidar odometry on {}{imu}", scans.name)
        }
        None => poses,
    };
    let TopicPlan {
        source,
        map_frame,
        base_frame,
        ..
    } = plan;
    let cameras = plan.cameras.iter().map(|camera| camera.line(bag));
    let mut lines = vec![
        format!("clouds: {}", names(Role::is_cloud)),
        format!("poses: {poses}, as {source}, of {base_frame} in {map_frame}"),
        format!("transforms: {tf}"),
    ];
    lines.extend(cameras);
    lines
}

impl Log<'_> {
    /// The topic of lidar odometry alone: while it is lost, other clouds have no place.
    fn clouds_of(&mut self, topic: usize) -> usize {
        let others = self.clouds.iter().filter(|cloud| cloud.topic != topic);
        let lines = others.map(|cloud| {
            let (name, taken) = (self.name(cloud.topic), self.name(topic));
            format!("not taken: {name} (poses are those of {taken}; --points {taken} --points {name} takes both)")
        });
        let lines: Vec<String> = lines.collect();
        self.choices.extend(lines);
        topic
    }

    /// The cloud topics to map: one for each frame of a sensor. Clouds of the machine's own frame, and of
    /// frames that are fixed in the world, are made of those of the sensors: they are taken where there
    /// are no others that transforms connect.
    fn chosen_clouds(&mut self, poses: &Poses, map_frame: &str) -> Vec<usize> {
        let base = &poses.base_frame;
        let is_world = |frame: &str| {
            frame == map_frame || frame == poses.frame || self.tree.is_world_of(frame, base)
        };
        if !self.wishes.points.is_empty() {
            return self.clouds.iter().map(|cloud| cloud.topic).collect();
        }
        let connected = |frame: &str| self.tree.connects(base, frame);
        let is_sensor = |frame: &str| frame != base && !is_world(frame);
        let classes: [&dyn Fn(&str) -> bool; 4] = [
            &|frame| is_sensor(frame) && connected(frame),
            &|frame| frame == base,
            &|frame| is_world(frame),
            &|_| true,
        ];
        let has = |class: &dyn Fn(&str) -> bool| self.clouds.iter().any(|c| class(&c.frame));
        let class = classes.iter().position(|class| has(class)).unwrap_or(0);
        let is_taken = |frame: &str| match class {
            // Those that nothing connects are refused by name, one by one.
            0 => is_sensor(frame),
            class => classes.get(class).is_some_and(|class| class(frame)),
        };
        let mut best: BTreeMap<&str, &CloudTopic> = BTreeMap::new();
        let rank = |cloud: &CloudTopic| {
            let count = self.count(cloud.topic);
            (
                cloud.labelled,
                cloud.cloud_type,
                u64::MAX - count,
                cloud.topic,
            )
        };
        for cloud in self.clouds.iter().filter(|cloud| is_taken(&cloud.frame)) {
            let best = best.entry(&cloud.frame).or_insert(cloud);
            if rank(cloud) < rank(best) {
                *best = cloud;
            }
        }
        let mut lines = Vec::new();
        for cloud in &self.clouds {
            let (name, frame) = (self.name(cloud.topic), cloud.frame.as_str());
            let why = match best.get(frame) {
                Some(taken) if taken.topic == cloud.topic => continue,
                Some(taken) => format!("of {frame} as {}", self.name(taken.topic)),
                None if is_world(frame) => {
                    format!("in {frame}, fixed in the world: made of other clouds")
                }
                None if frame == base => format!("in {frame}: made of other clouds"),
                None => format!("no transform {base} <- {frame}"),
            };
            lines.push(format!(
                "not taken: {name} ({why}; --points {name} takes it)"
            ));
        }
        let chosen = best.into_values().map(|cloud| cloud.topic).collect();
        self.choices.extend(lines);
        chosen
    }
}

/// The transform topics of the robot whose clouds these are, each with whether it is static.
///
/// Topics in the namespace of the clouds come first, then those of the root, then any.
fn transforms(bag: &BagReader, clouds: &[CloudTopic]) -> Result<Vec<(usize, bool)>, TopicError> {
    let name = |topic: usize| bag.topics().get(topic).map_or("", |t| t.name.as_str());
    let mut found = Vec::new();
    for (end, is_static) in [("/tf", false), ("/tf_static", true)] {
        let all = survey::topics_of(bag, TFMessage::TYPE);
        let all: Vec<(usize, &str)> = all
            .filter_map(|topic| Some((topic, name(topic).strip_suffix(end)?)))
            .collect();
        let is_above = |space: &str, cloud: &CloudTopic| {
            let rest = name(cloud.topic).strip_prefix(space);
            !space.is_empty() && rest.is_some_and(|rest| rest.starts_with('/'))
        };
        let beside: Vec<&(usize, &str)> = all
            .iter()
            .filter(|(_, space)| clouds.iter().any(|cloud| is_above(space, cloud)))
            .collect();
        if beside.len() > 1 {
            let robots = beside.iter().map(|(topic, space)| {
                let of_it = clouds.iter().filter(|cloud| is_above(space, cloud));
                let of_it: Vec<&str> = of_it.map(|cloud| name(cloud.topic)).collect();
                format!("{} with {}", of_it.join(", "), name(*topic))
            });
            return Err(TopicError::Robots {
                robots: robots.collect::<Vec<_>>().join("; "),
            });
        }
        let root = all.iter().find(|(_, space)| space.is_empty());
        let chosen = beside.first().copied().or(root).or(all.first());
        found.extend(chosen.map(|(topic, _)| (*topic, is_static)));
    }
    Ok(found)
}

/// Place of a topic of clouds that the user names.
fn find_cloud(bag: &BagReader, name: &str, cameras: &Cameras) -> Result<usize, TopicError> {
    let is_depth = |topic| { cameras.all.iter() }.any(|found| found.camera.depth == topic);
    let mut topics = bag.topics().iter().enumerate();
    let found = topics.find(|(i, topic)| {
        topic.name == name && (CloudType::of(&topic.type_name).is_some() || is_depth(*i))
    });
    found
        .map(|(i, _)| i)
        .ok_or_else(|| TopicError::MissingClouds {
            name: name.to_owned(),
            types: type_names(),
            has: listing(bag),
            remedy: packets::remedy(bag) + &cameras.remedy,
        })
}

/// Types of clouds and of messages converted to clouds, for an error.
fn type_names() -> String {
    let clouds = CloudType::ALL.map(CloudType::name).join(", ");
    format!("{clouds}, or {}", cameras::type_names())
}
