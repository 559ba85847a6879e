//! Result of `lattice calibrate mounts`, as text and JSON.

use std::fmt;

use lattice_core::registration::mounts::{MOUNT_NUMBERS, MountEstimate, MountFit};
use lattice_nodes::enu_transformer::{LogSamples, StatedMount};
use nalgebra::Isometry3;
use serde::Serialize;

use crate::replay::WRONG_S;

/// Result of a calibration of mounts.
#[derive(Serialize)]
pub struct Answer {
    /// Frame of the poses.
    base_frame: String,
    numbers: Vec<Number>,
    sensors: Vec<Sensor>,
    /// Parameters of enu_transformer, in place of new transforms; `None` if the source of poses ignores them.
    parameters: Option<Parameters>,
    before: Fit,
    after: Fit,
    points: usize,
    planes: usize,
    wall_s: f64,
}

/// One of the seven numbers.
#[derive(Serialize)]
struct Number {
    name: &'static str,
    unit: &'static str,
    correction: f64,
    sigma: f64,
    verdict: &'static str,
    /// Motion that shows the number.
    #[serde(skip_serializing_if = "Option::is_none")]
    remedy: Option<&'static str>,
}

/// Mount of a sensor, stated and found, in its parent frame.
#[derive(Serialize)]
struct Sensor {
    topic: String,
    parent_frame: String,
    frame: String,
    is_moving: bool,
    stated: Place,
    found: Place,
}

/// Translation and fixed-axis angles.
#[derive(Clone, Copy, Serialize)]
struct Place {
    translation_m: [f64; 3],
    rpy_deg: [f64; 3],
    rpy_rad: [f64; 3],
}

#[derive(Serialize)]
struct Parameters {
    #[serde(rename = "ins.lever_arm_m")]
    lever_arm_m: [f64; 3],
    #[serde(rename = "ins.boresight_rpy_rad")]
    boresight_rpy_rad: [f64; 3],
}

#[derive(Serialize)]
struct Fit {
    voxels: usize,
    thickness_m: f64,
}

impl Place {
    fn of(pose: &Isometry3<f64>) -> Place {
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        let rpy_rad = [roll, pitch, yaw];
        Place {
            translation_m: pose.translation.vector.into(),
            rpy_deg: rpy_rad.map(f64::to_degrees),
            rpy_rad,
        }
    }
}

impl Fit {
    fn of(fit: MountFit) -> Fit {
        Fit {
            voxels: fit.voxels,
            thickness_m: fit.thickness_m,
        }
    }
}

/// Unit of a number, and its value for the user in that of the core.
fn unit(number: usize) -> (&'static str, f64) {
    match number {
        0..3 => ("deg", 1_f64.to_degrees()),
        3..6 => ("m", 1.0),
        _ => ("s", 1.0),
    }
}

/// Motion that shows a number.
fn remedy(number: usize) -> &'static str {
    match number {
        0..3 => "drive turns of 90 degrees and more past walls, both ways",
        3 | 4 => "drive turns of 90 degrees and more, as narrow as the machine can",
        5 => {
            "drive over a ramp or kerbs, so that the machine rolls or pitches by 5 degrees and more near walls"
        }
        _ => "drive fast turns both ways",
    }
}

impl Answer {
    /// Answer of an estimate.
    pub fn new(
        estimate: &MountEstimate,
        log: &LogSamples,
        base_frame: String,
        wall_s: f64,
    ) -> Answer {
        let correction = estimate.correction.base_from_stated();
        let numbers = estimate.numbers.iter().zip(MOUNT_NUMBERS).enumerate();
        let numbers = numbers.map(|(i, (number, name))| {
            let (unit, scale) = unit(i);
            Number {
                name,
                unit,
                correction: number.value * scale,
                sigma: number.sigma * scale,
                verdict: match number.is_observable {
                    true => "OK",
                    false => "not observable",
                },
                remedy: (!number.is_observable).then(|| remedy(i)),
            }
        });
        let sensor = |mount: &StatedMount| {
            let parent_frame = mount.parent.clone();
            let (parent_frame, base_from_parent) = match parent_frame {
                Some(parent) if !mount.is_moving => (parent, mount.base_from_parent),
                _ => (base_frame.clone(), Isometry3::identity()),
            };
            let found = correction * mount.base_from_sensor;
            Sensor {
                topic: mount.topic.clone(),
                frame: mount.frame.clone(),
                is_moving: mount.is_moving,
                stated: Place::of(&base_from_parent.inv_mul(&mount.base_from_sensor)),
                found: Place::of(&base_from_parent.inv_mul(&found)),
                parent_frame,
            }
        };
        let parameters = log.base_from_ins.map(|base_from_ins| {
            let place = Place::of(&correction.inv_mul(&base_from_ins));
            Parameters {
                lever_arm_m: place.translation_m,
                boresight_rpy_rad: place.rpy_rad,
            }
        });
        Answer {
            numbers: numbers.collect(),
            sensors: log.mounts.iter().map(sensor).collect(),
            parameters,
            before: Fit::of(estimate.before),
            after: Fit::of(estimate.after),
            points: estimate.points,
            planes: estimate.planes,
            wall_s,
            base_frame,
        }
    }

    /// Number of observable numbers.
    pub fn observable(&self) -> usize {
        let observable = self.numbers.iter().filter(|number| number.remedy.is_none());
        observable.count()
    }

    /// Names of the observable numbers with their corrections.
    pub fn shown(&self) -> String {
        let observable = self.numbers.iter().filter(|number| number.remedy.is_none());
        let texts = observable.map(|number| {
            let Number {
                name,
                unit,
                correction,
                sigma,
                ..
            } = number;
            format!("{name} {correction:+.3} ± {sigma:.3} {unit}")
        });
        let texts: Vec<String> = texts.collect();
        match texts.is_empty() {
            true => "the motion shows none of its numbers".to_owned(),
            false => texts.join(", "),
        }
    }

    /// Drives to be made, for the numbers that are not observable.
    pub fn remedies(&self) -> String {
        let mut texts: Vec<String> = Vec::new();
        for number in &self.numbers {
            if let Some(remedy) = number.remedy
                && !texts.iter().any(|text| text == remedy)
            {
                texts.push(remedy.to_owned());
            }
        }
        texts.join("; ")
    }
}

fn list(values: &[f64; 3]) -> String {
    let [x, y, z] = values;
    format!("[{x:.5}, {y:.5}, {z:.5}]")
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let base = &self.base_frame;
        writeln!(f, "correction     about and along the axes of {base}")?;
        for number in &self.numbers {
            let Number {
                name,
                unit,
                correction,
                sigma,
                verdict,
                ..
            } = number;
            match number.remedy {
                None => writeln!(
                    f,
                    "  {name:<12} {correction:+.4} {unit}, sigma {sigma:.4} {unit}: {verdict}"
                )?,
                Some(remedy) => writeln!(f, "  {name:<12} {verdict}, kept as stated: {remedy}")?,
            }
        }
        for sensor in &self.sensors {
            let Sensor {
                topic,
                parent_frame,
                frame,
                ..
            } = sensor;
            writeln!(f, "mount          {frame} in {parent_frame} ({topic})")?;
            for (name, place) in [("before", &sensor.stated), ("after", &sensor.found)] {
                let [roll, pitch, yaw] = place.rpy_deg;
                let [x, y, z] = place.translation_m;
                writeln!(
                    f,
                    "  {name:<12} roll {roll:.3} pitch {pitch:.3} yaw {yaw:.3} deg, lever arm {x:.4} {y:.4} {z:.4} m"
                )?;
            }
        }
        let (before, after) = (&self.before, &self.after);
        writeln!(
            f,
            "fit            {} occupied voxels before, {} after; surfaces {:.4} m thick before, {:.4} m after",
            before.voxels, after.voxels, before.thickness_m, after.thickness_m
        )?;
        writeln!(
            f,
            "evidence       {} points in {} flat cells, {:.1} s",
            self.points, self.planes, self.wall_s
        )?;
        let fixed = (self.sensors.iter()).filter(|one| !one.is_moving && one.frame != *base);
        for sensor in fixed {
            let Sensor {
                parent_frame,
                frame,
                ..
            } = sensor;
            let [x, y, z] = sensor.found.translation_m;
            let [roll, pitch, yaw] = sensor.found.rpy_rad;
            writeln!(
                f,
                "tf             ros2 run tf2_ros static_transform_publisher --x {x:.5} --y {y:.5} --z {z:.5} --roll {roll:.6} --pitch {pitch:.6} --yaw {yaw:.6} --frame-id {parent_frame} --child-frame-id {frame}"
            )?;
        }
        if let Some(parameters) = &self.parameters {
            writeln!(
                f,
                "or parameters  of enu_transformer, which move all sensors:\n  ins.lever_arm_m: {}\n  ins.boresight_rpy_rad: {}",
                list(&parameters.lever_arm_m),
                list(&parameters.boresight_rpy_rad)
            )?;
        }
        let time = self.numbers.iter().find(|number| number.unit == "s");
        if let Some(time) = time.filter(|time| time.correction.abs() > WRONG_S) {
            let by_s = time.correction;
            writeln!(
                f,
                "time           stamps of the clouds are {:.4} s too {}: correct them in the driver or by PTP, or set\n  time.offset_s: {by_s:.4}",
                by_s.abs(),
                if by_s > 0.0 { "early" } else { "late" }
            )?;
        }
        Ok(())
    }
}
