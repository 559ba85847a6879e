//! The noise-free truth beside a log.

use super::bobcat_options::BobcatOptions;
use super::facts::{
    BASE_FRAME, BOBCAT_GPS_WEEK, BOBCAT_GPS_WEEK_MS, BOBCAT_LEAP_SECONDS, BOBCAT_ORIGIN,
    BOBCAT_UNDULATION_M, IMU_FRAME, TURNTABLE_FRAME, bobcat_start_ns,
};
use crate::simulate::{
    BASE_FROM_TURNTABLE_M, INS_POSITION_RMS_M, InsSample, Laser, MAX_RANGE_M, MIN_RANGE_M,
    RANGE_NOISE_M, TURNTABLE_PERIOD_NS, base_from_imu,
};
use crate::{AnyError, at};
use lattice_nodes::files::atomic_write::{self, AtomicFile};
use lattice_nodes::files::export::ply_header;
use nalgebra::{Isometry3, Vector3};
use serde_yaml::{Mapping, Value};
use std::io::{Seek, SeekFrom, Write};
use std::path::PathBuf;

pub(super) const FOLDER: &str = "truth";
pub(super) const FILES: [&str; 3] = [SITE_FILE, POSES_FILE, POINTS_FILE];
const SITE_FILE: &str = "site.yaml";
const POSES_FILE: &str = "poses.csv";
const POINTS_FILE: &str = "points.ply";
/// The PLY header is padded to this length, since the number of points is known only at the end.
const PLY_HEADER_BYTES: usize = 256;

/// The open files of a truth folder.
pub(super) struct Truth {
    poses: (PathBuf, AtomicFile),
    points: (PathBuf, AtomicFile),
    point_count: u64,
}

impl Truth {
    /// Makes the folder, writes the site's facts and opens the other files.
    pub(super) fn create(options: &BobcatOptions) -> Result<Self, AnyError> {
        let folder = options.out.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(at(&folder))?;
        let site = folder.join(SITE_FILE);
        let facts = serde_yaml::to_string(&site_facts(options)).map_err(at(&site))?;
        atomic_write::write_text(&site, &facts)?;
        let open = |name: &str| {
            let path = folder.join(name);
            let file = AtomicFile::create(&path).map_err(at(&path))?;
            Ok::<_, AnyError>((path, file))
        };
        let (mut poses, mut points) = (open(POSES_FILE)?, open(POINTS_FILE)?);
        writeln!(poses.1, "stamp_ns,x,y,z,qx,qy,qz,qw").map_err(at(&poses.0))?;
        let written = points.1.write_all(&padded_header(0));
        written.map_err(at(&points.0))?;
        Ok(Self {
            poses,
            points,
            point_count: 0,
        })
    }

    /// Adds the true pose of `base_link` in the map.
    pub(super) fn pose(&mut self, sample: &InsSample) -> Result<(), AnyError> {
        let stamp_ns = bobcat_start_ns().saturating_add(sample.time_ns);
        let pose = sample.true_map_from_base;
        let (p, q) = (pose.translation.vector, pose.rotation.coords);
        let (path, file) = &mut self.poses;
        let words = p.iter().chain(&q).map(|value| format!(",{value}"));
        writeln!(file, "{stamp_ns}{}", words.collect::<String>()).map_err(at(path))
    }

    /// Adds the true points of a cloud.
    pub(super) fn points(&mut self, points_m: &[[f32; 3]]) -> Result<(), AnyError> {
        let coordinates = points_m.iter().flatten();
        let bytes: Vec<u8> = coordinates.flat_map(|v| v.to_le_bytes()).collect();
        let (path, file) = &mut self.points;
        file.write_all(&bytes).map_err(at(path))?;
        self.point_count = self.point_count.saturating_add(points_m.len() as u64);
        Ok(())
    }

    pub(super) fn finish(self) -> Result<(), AnyError> {
        let Self {
            poses: (poses_path, poses),
            points: (points_path, mut points),
            point_count,
        } = self;
        poses.finish().map_err(at(&poses_path))?;
        points
            .seek(SeekFrom::Start(0))
            .and_then(|_| points.write_all(&padded_header(point_count)))
            .and_then(|()| points.finish())
            .map_err(at(&points_path))
    }
}

/// Header of a binary PLY of float points, padded by a comment.
fn padded_header(points: u64) -> Vec<u8> {
    let vertices = [("vertex", points, &["float x", "float y", "float z"][..])];
    let comment = "true points in the map frame, m, in the order of the log ";
    let bare = ply_header(comment, &vertices);
    let padding = PLY_HEADER_BYTES.saturating_sub(bare.len());
    let comment = format!("{comment}{}", "-".repeat(padding));
    ply_header(&comment, &vertices).into_bytes()
}

/// A mapping in the order given.
fn mapping<const N: usize>(entries: [(&str, Value); N]) -> Value {
    let entries = entries.map(|(key, value)| (key.into(), value));
    Value::Mapping(Mapping::from_iter(entries))
}

/// Contents of `site.yaml`. A mount is `parent_from_child`; the turntable's is that at angle zero.
fn site_facts(options: &BobcatOptions) -> Value {
    let [latitude_deg, longitude_deg, ellipsoidal_height_m] = BOBCAT_ORIGIN;
    let turntable = Isometry3::from(Vector3::from(BASE_FROM_TURNTABLE_M));
    let mount = |parent: &str, child: &str, pose: &Isometry3<f64>| {
        mapping([
            ("parent", parent.into()),
            ("child", child.into()),
            ("translation_m", pose.translation.vector.as_slice().into()),
            ("rotation_xyzw", pose.rotation.coords.as_slice().into()),
        ])
    };
    let mounts = [
        mount(BASE_FRAME, IMU_FRAME, &base_from_imu()),
        mount(BASE_FRAME, Laser::Left.frame(), &Laser::Left.mount()),
        mount(BASE_FRAME, Laser::Right.frame(), &Laser::Right.mount()),
        mount(BASE_FRAME, TURNTABLE_FRAME, &turntable),
        mount(TURNTABLE_FRAME, Laser::Top.frame(), &Laser::Top.mount()),
    ];
    let origin = mapping([
        ("latitude_deg", latitude_deg.into()),
        ("longitude_deg", longitude_deg.into()),
        ("ellipsoidal_height_m", ellipsoidal_height_m.into()),
        ("undulation_m", BOBCAT_UNDULATION_M.into()),
    ]);
    mapping([
        ("simulation", "bobcat".into()),
        ("seed", options.seed.into()),
        ("duration_s", options.duration_s.into()),
        ("start_utc_ns", bobcat_start_ns().into()),
        ("start_gps_week", BOBCAT_GPS_WEEK.into()),
        ("start_gps_week_ms", BOBCAT_GPS_WEEK_MS.into()),
        ("leap_seconds", BOBCAT_LEAP_SECONDS.into()),
        ("origin", origin),
        ("mounts", mounts.to_vec().into()),
        (
            "turntable_period_s",
            (TURNTABLE_PERIOD_NS as f64 * 1e-9).into(),
        ),
        ("range_noise_m", RANGE_NOISE_M.into()),
        ("min_range_m", MIN_RANGE_M.into()),
        ("max_range_m", MAX_RANGE_M.into()),
        ("ins_position_rms_m", INS_POSITION_RMS_M.into()),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_keeps_its_length() {
        assert_eq!(padded_header(0).len(), PLY_HEADER_BYTES);
        assert_eq!(padded_header(u64::MAX).len(), PLY_HEADER_BYTES);
        assert!(padded_header(12).ends_with(b"\nend_header\n"));
    }
}
