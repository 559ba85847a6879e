//! Result of `lattice calibrate`, as text and JSON.

use std::fmt;

use lattice_core::registration::{
    Calibration, DirectionKind, Profile, Registration, describe_p_wrong,
};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde::Serialize;

use std::collections::BTreeMap;

/// Result for people and programs.
#[derive(Default, Serialize)]
pub struct Answer {
    /// `None` for a single registration, which has no verdict.
    verdict: Option<&'static str>,
    reason: String,
    method: String,
    converged: Option<bool>,
    map_from_cloud: Pose,
    /// Centroid of a cloud far from its origin, and its position in the map (m): covariance and sigmas refer to that
    /// point. `None` for a cloud near its origin, to which they refer.
    cloud_middle_m: Option<[f64; 3]>,
    middle_in_map_m: Option<[f64; 3]>,
    /// Row-major over x, y, z (m) and rotations about x, y, z (rad), map frame; `None` without a verdict.
    covariance: Option<Vec<f64>>,
    sigma_m: Option<[f64; 3]>,
    sigma_deg: Option<[f64; 3]>,
    /// `None` without a verdict.
    profile: Option<&'static str>,
    /// Ratio of lengths in the map and in the cloud, with its standard deviation; `None` if the points do not
    /// determine it.
    scale: Option<f64>,
    scale_sigma: Option<f64>,
    /// `None` if no alternative was found.
    log_margin: Option<f64>,
    /// Probability of error; `None` without a verdict.
    p_wrong: Option<f64>,
    inlier_fraction: f64,
    rmse_m: f64,
    /// Squared shift of parts of the cloud, relative to the expected one; `None` without a verdict.
    chi_square: Option<f64>,
    /// Fraction of points that float before a surface of the map.
    floating_fraction: Option<f64>,
    /// Fraction of lines of sight through a surface of the map.
    blocked_fraction: Option<f64>,
    /// Unexplained parts of the cloud, in descending order of points.
    unexplained: Vec<Part>,
    weak_directions: Vec<Weak>,
    classes: Vec<Class>,
    pub points: usize,
    pub map_points: usize,
    pub times: Times,
}

#[derive(Default, Serialize)]
struct Pose {
    translation_m: [f64; 3],
    rotation_xyzw: [f64; 4],
    yaw_deg: f64,
}

#[derive(Serialize)]
struct Weak {
    kind: &'static str,
    axis: [f64; 3],
    /// Standard deviation, metres or radians.
    sigma: f64,
}

#[derive(Serialize)]
struct Part {
    /// missing, floating, beside or hidden.
    kind: &'static str,
    /// Centroid of the region, metres.
    place_m: [f64; 3],
    points: usize,
    /// Distance from the surfaces of the map, metres.
    beside_m: f64,
}

#[derive(Serialize)]
struct Class {
    class: u16,
    name: Option<String>,
    /// Fraction of its observations with the same class in the map.
    agreement: f64,
    observations: f64,
}

/// Wall clock times, milliseconds.
#[derive(Clone, Copy, Default, Serialize)]
pub struct Times {
    pub read_ms: f64,
    /// Preparation of the map, done once for all calibrations.
    pub map_ms: f64,
    pub calibrate_ms: f64,
}

impl Answer {
    /// Result of a calibration.
    pub fn of_calibration(
        calibration: &Calibration,
        profile: Profile,
        names: &BTreeMap<u16, String>,
    ) -> Answer {
        let covariance = &calibration.covariance;
        let sigma = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        let weak = calibration.weak_directions.iter().map(|weak| Weak {
            kind: match weak.kind {
                DirectionKind::Translation => "translation",
                DirectionKind::Rotation => "rotation",
            },
            axis: weak.axis.into(),
            sigma: weak.sigma,
        });
        let classes = calibration.class_reliability.iter().map(|class| Class {
            class: class.source_class,
            name: names.get(&class.source_class).cloned(),
            agreement: class.agreement,
            observations: class.weight,
        });
        let fit = &calibration.fit;
        let unexplained = fit.unexplained.iter().map(|part| Part {
            kind: part.kind.name(),
            place_m: part.place_m.into(),
            points: part.points,
            beside_m: part.beside_m,
        });
        Answer {
            verdict: Some(calibration.verdict.name()),
            reason: calibration.reason.clone(),
            method: calibration.method.to_owned(),
            map_from_cloud: Pose::of(&calibration.target_from_source),
            // The matrix is symmetric, so column and row order agree.
            covariance: Some(covariance.iter().copied().collect()),
            sigma_m: Some([0, 1, 2].map(sigma)),
            sigma_deg: Some([3, 4, 5].map(|i| sigma(i).to_degrees())),
            profile: Some(profile.name()),
            scale: calibration.scale.map(|estimate| estimate.scale),
            scale_sigma: calibration.scale.map(|estimate| estimate.sigma),
            log_margin: Some(calibration.margin.log_ratio).filter(|margin| margin.is_finite()),
            p_wrong: Some(calibration.margin.p_wrong()),
            inlier_fraction: calibration.inlier_fraction,
            rmse_m: calibration.rmse_m,
            chi_square: Some(fit.chi_square),
            floating_fraction: Some(fit.floating),
            blocked_fraction: Some(fit.blocked),
            unexplained: unexplained.collect(),
            weak_directions: weak.collect(),
            classes: classes.collect(),
            ..Answer::default()
        }
    }

    /// Result of a single registration of a cloud with `points` points.
    pub fn of_registration(method: &str, (registration, points): &(Registration, usize)) -> Answer {
        let state = match registration.converged {
            true => "converged",
            false => "not converged",
        };
        Answer {
            reason: format!("{state} after {} searches", registration.iterations),
            method: method.to_owned(),
            converged: Some(registration.converged),
            map_from_cloud: Pose::of(&registration.target_from_source),
            inlier_fraction: registration.inliers as f64 / (*points).max(1) as f64,
            rmse_m: registration.rmse_m,
            ..Answer::default()
        }
    }

    /// Converts the pose of a cloud about its centroid to that of its frame; `scaled` for the pose of the scaled
    /// cloud.
    pub fn place_origin(&mut self, middle_m: &Vector3<f64>, scaled: bool) {
        if *middle_m == Vector3::zeros() {
            return;
        }
        let pose = &mut self.map_from_cloud;
        let rotation = UnitQuaternion::new_unchecked(pose.rotation_xyzw.into());
        let scale = self.scale.filter(|_| scaled).unwrap_or(1.0);
        let middle_in_map = Vector3::from(pose.translation_m);
        pose.translation_m = (middle_in_map - rotation * middle_m * scale).into();
        self.cloud_middle_m = Some((*middle_m).into());
        self.middle_in_map_m = Some(middle_in_map.into());
    }

    /// Reason not to use the pose, if any.
    pub fn refusal(&self) -> Option<String> {
        match (self.verdict, self.converged) {
            (Some("OK"), _) | (None, Some(true)) => None,
            (Some(verdict), _) => Some(format!("{verdict}: {}", self.reason)),
            (None, _) => Some(format!("{}: {}", self.method, self.reason)),
        }
    }
}

impl Pose {
    fn of(pose: &Isometry3<f64>) -> Pose {
        let forward = pose.rotation * nalgebra::Vector3::x();
        Pose {
            translation_m: pose.translation.vector.into(),
            rotation_xyzw: pose.rotation.coords.into(),
            yaw_deg: forward.y.atan2(forward.x).to_degrees(),
        }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(verdict) = self.verdict {
            writeln!(f, "verdict        {verdict}: {}", self.reason)?;
            let profile = self.profile.unwrap_or_default();
            writeln!(f, "method         {}, profile {profile}", self.method)?;
        } else {
            writeln!(f, "method         {}, {}", self.method, self.reason)?;
        }
        let [x, y, z] = self.map_from_cloud.translation_m;
        writeln!(f, "translation    {x:.4} {y:.4} {z:.4} m")?;
        let [qx, qy, qz, qw] = self.map_from_cloud.rotation_xyzw;
        let yaw_deg = self.map_from_cloud.yaw_deg;
        // An error of a millionth rotates a position in UTM by metres.
        let digits = if self.cloud_middle_m.is_some() { 12 } else { 6 };
        writeln!(
            f,
            "rotation       {qx:.digits$} {qy:.digits$} {qz:.digits$} {qw:.digits$} (x y z w), yaw {yaw_deg:.3} deg"
        )?;
        if let (Some([x, y, z]), Some([mx, my, mz])) = (self.cloud_middle_m, self.middle_in_map_m) {
            writeln!(
                f,
                "middle         {x:.0} {y:.0} {z:.0} m in the cloud is {mx:.4} {my:.4} {mz:.4} m; sigma is of this point"
            )?;
        }
        if let (Some([x, y, z]), Some([rx, ry, rz])) = (self.sigma_m, self.sigma_deg) {
            writeln!(
                f,
                "sigma          {x:.4} {y:.4} {z:.4} m, {rx:.3} {ry:.3} {rz:.3} deg"
            )?;
        }
        if let (Some(scale), Some(sigma)) = (self.scale, self.scale_sigma) {
            writeln!(f, "scale          {scale:.4}, sigma {sigma:.4}")?;
        }
        if let (Some(margin), Some(p_wrong)) = (self.log_margin, self.p_wrong) {
            writeln!(
                f,
                "log-margin     {margin:.1}, {}",
                describe_p_wrong(p_wrong)
            )?;
        }
        writeln!(
            f,
            "on the map     {:.1} % of the points, {:.4} m RMS",
            100.0 * self.inlier_fraction,
            self.rmse_m
        )?;
        if let (Some(chi_square), Some(floating), Some(blocked)) = (
            self.chi_square,
            self.floating_fraction,
            self.blocked_fraction,
        ) {
            writeln!(
                f,
                "shift          {chi_square:.2} of what is expected, squared; {:.0} % floating, {:.0} % hidden",
                100.0 * floating,
                100.0 * blocked
            )?;
        }
        for part in &self.unexplained {
            let [x, y, z] = part.place_m;
            let beside = match part.kind {
                "beside" => format!(" by {:.2} m", part.beside_m),
                _ => String::new(),
            };
            writeln!(
                f,
                "not explained  {}{beside} at {x:.2} {y:.2} {z:.2}: {} points",
                part.kind, part.points
            )?;
        }
        for weak in &self.weak_directions {
            let [x, y, z] = weak.axis;
            let sigma = match weak.kind {
                "rotation" => format!("{:.3} deg", weak.sigma.to_degrees()),
                _ => format!("{:.4} m", weak.sigma),
            };
            writeln!(
                f,
                "weak           {} along {x:.2} {y:.2} {z:.2}: {sigma}",
                weak.kind
            )?;
        }
        for class in &self.classes {
            let name = class.name.as_deref().unwrap_or("class");
            writeln!(
                f,
                "label          {name} ({}): map agrees {:.0} % of {:.0}",
                class.class,
                100.0 * class.agreement,
                class.observations
            )?;
        }
        let Times {
            read_ms,
            map_ms,
            calibrate_ms,
        } = self.times;
        writeln!(
            f,
            "points         {} in a map of {}",
            self.points, self.map_points
        )?;
        writeln!(
            f,
            "time           {read_ms:.0} ms to read, {map_ms:.0} ms for the map, {calibrate_ms:.0} ms to calibrate"
        )
    }
}
