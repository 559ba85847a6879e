//! Report of a run over a log: input, losses and one row for each lattice.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::camera_report::CameraReport;
use super::scan_poses::ScanPosesReport;
use crate::enu_transformer::{Refusal, TransformerReport};
use crate::lattice_mapper::MapperReport;
use crate::voxel_marker_publisher::MarkerReport;

/// Map and markers of one lattice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatticeReport {
    /// The map.
    pub map: MapperReport,
    /// Report of the markers, if they were drawn.
    pub markers: Option<MarkerReport>,
}

/// A run whose map stayed empty.
#[derive(Debug, Error)]
#[error("nothing was mapped: {cause}")]
pub struct NothingMapped {
    cause: String,
}

/// A whole run over a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// Source of the clouds.
    pub source: String,
    /// Clouds on the topics that were replayed.
    pub clouds_in_log: u64,
    /// From clouds of sensors to clouds in the map.
    pub transformer: TransformerReport,
    /// From depth images to clouds, one for each depth camera.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<CameraReport>,
    /// One for each lattice.
    pub lattices: Vec<LatticeReport>,
    /// Latitude and longitude in degrees and ellipsoidal height in m of the map's origin, where known.
    #[serde(default)]
    pub origin: Option<[f64; 3]>,
    /// Odometry of the scans, where the log has no poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub odometry: Option<ScanPosesReport>,
    /// Rows of the log that are no messages and were left out.
    #[serde(default)]
    pub implausible_rows: u64,
    /// Files of the log that end early, each with the number of its messages.
    #[serde(default)]
    pub cuts: Vec<String>,
    /// Corrections of mounts and stamps with which the first minute of the log fits better.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fit: Vec<String>,
    /// Topics that were taken for clouds, poses and transforms, and those that were not, with the reason.
    #[serde(default)]
    pub choices: Vec<String>,
    /// Wall time of the replay.
    pub wall_s: f64,
}

impl RunReport {
    fn has_markers(&self) -> bool {
        self.lattices
            .iter()
            .any(|lattice| lattice.markers.is_some())
    }

    /// Fails with the cause unless some cloud was mapped in every lattice.
    pub fn check(&self) -> Result<(), NothingMapped> {
        let lost = self.odometry.as_ref();
        if let Some(cause) = lost.and_then(ScanPosesReport::cause_of_nothing) {
            return Err(NothingMapped { cause });
        }
        let is_empty = |report: &LatticeReport| report.map.voxels == 0;
        if !self.lattices.iter().any(is_empty) {
            return Ok(());
        }
        let of_cameras = self.cameras.iter().map(CameraReport::cause_of_nothing);
        let of_cameras = of_cameras.collect::<Option<Vec<_>>>().unwrap_or_default();
        if !of_cameras.is_empty() && self.transformer.counts.points_in == 0 {
            let cause = of_cameras.join("; ");
            return Err(NothingMapped { cause });
        }
        let counts = &self.transformer.counts;
        let cause = match self.transformer.cause_of_nothing() {
            Some(_) if self.clouds_in_log == 0 => {
                "no cloud in the part of the log that was replayed".into()
            }
            Some(cause) => cause,
            None if counts.points_in == 0 => {
                format!("0 points in {} clouds", counts.clouds_out)
            }
            None if counts.points_out == 0 => format!(
                "of {} points {} are not finite, {} out of range (`min_range_m`, `max_range_m`), {} without time",
                counts.points_in,
                counts.points_not_finite,
                counts.points_out_of_range,
                counts.points_no_time
            ),
            None => self.losses().join("; "),
        };
        Err(NothingMapped { cause })
    }

    /// Attitudes with which the map is wrong, and the parameter that mends them.
    pub fn wrong_attitude(&self) -> Option<&str> {
        let attitude = self.transformer.attitude.as_ref();
        let attitude = attitude.filter(|attitude| attitude.is_impossible);
        attitude.map(|attitude| attitude.text.as_str())
    }

    /// One line per loss, empty when nothing was lost.
    pub fn losses(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let counts = &self.transformer.counts;
        let refused = self.transformer.clouds_inbox_full
            + self.transformer.clouds_lost_on_network
            + self.transformer.undecodable;
        let arrived = counts.clouds_in + refused;
        let odometry = self.odometry.as_ref();
        let arrived = arrived + odometry.map_or(0, ScanPosesReport::left_out);
        let arrived = arrived + self.cameras.iter().map(CameraReport::left_out).sum::<u64>();
        let missing = self.clouds_in_log.saturating_sub(arrived);
        if missing > 0 {
            let all = self.clouds_in_log;
            lines.push(format!(
                "{missing} of {all} clouds of the log did not reach the transformer"
            ));
        }
        lines.extend(odometry.into_iter().flat_map(ScanPosesReport::losses));
        lines.extend(self.cameras.iter().flat_map(CameraReport::losses));
        for (reason, count) in self.transformer.dropped() {
            lines.push(format!("{count} of {} clouds: {reason}", counts.clouds_in));
        }
        // With value and remedy.
        for refusal in &self.transformer.refusals {
            let Refusal {
                topic,
                reason,
                count,
                text,
            } = refusal;
            lines.push(format!("{count} on {topic} ({reason}): {text}"));
        }
        lines.extend(self.cuts.iter().cloned());
        if self.implausible_rows > 0 {
            let rows = self.implausible_rows;
            lines.push(format!("{rows} rows of the log are no messages"));
        }
        let poses = self.transformer.poses_inbox_full;
        if poses > 0 {
            lines.push(format!("{poses} poses and transforms: inbox_full"));
        }
        let poses = self.transformer.poses_lost_on_network;
        if poses > 0 {
            lines.push(format!("{poses} poses and transforms: lost_on_network"));
        }
        for LatticeReport { map, .. } in &self.lattices {
            let (name, mapped, out) = (&map.lattice, &map.counts, counts.clouds_out);
            let lost = out.saturating_sub(mapped.clouds_in);
            if lost > 0 {
                lines.push(format!(
                    "{lost} of {out} transformed clouds did not reach the {name} map"
                ));
            }
            let mut add = |what: &str, count: u64, reason: &str| {
                if count > 0 {
                    lines.push(format!("{count} {what} of the {name} map: {reason}"));
                }
            };
            let blind = "without sensor positions, so that they clear nothing";
            add("clouds", mapped.clouds_wrong_frame, "not in the map frame");
            add("clouds", mapped.clouds_malformed, "malformed");
            let jump = "of another time than those before";
            add("clouds", mapped.clouds_stamp_jump, jump);
            add("clouds", mapped.clouds_no_viewpoint, blind);
            add("clouds", map.clouds_inbox_full, "inbox full");
            let on_network = map.clouds_lost_on_network;
            add("clouds", on_network, "lost on the network");
            add("samples", map.undecodable, "undecodable");
            add("points", mapped.points_not_finite, "not finite");
            add(
                "points",
                mapped.points_out_of_range,
                "beyond the reach of keys from the datum (`datum_m`)",
            );
            add(
                "points",
                mapped.points_list_full,
                "more voxels than max_voxels",
            );
        }
        lines
    }
}

impl fmt::Display for RunReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = &self.transformer.counts;
        writeln!(
            f,
            "{}: {} clouds, {} transformed, {} poses, {:.1} s",
            self.source, self.clouds_in_log, counts.clouds_out, counts.poses_in, self.wall_s
        )?;
        writeln!(
            f,
            "points: {} in, {} transformed, left out: {} not finite, {} out of range, {} without time",
            counts.points_in,
            counts.points_out,
            counts.points_not_finite,
            counts.points_out_of_range,
            counts.points_no_time
        )?;
        for camera in &self.cameras {
            writeln!(f, "{camera}")?;
        }
        if let Some(odometry) = &self.odometry {
            writeln!(f, "{odometry}")?;
        }
        for note in self.transformer.notes.iter().filter(|note| note.is_warning) {
            writeln!(f, "note: {}: {}", note.topic, note.text)?;
        }
        for note in &self.fit {
            writeln!(f, "note: {note}")?;
        }
        let losses = self.losses();
        if losses.is_empty() {
            writeln!(f, "dropped: none")?;
        }
        for loss in losses {
            writeln!(f, "dropped: {loss}")?;
        }
        writeln!(
            f,
            "\n{:<8}{:>10}{:>10}{:>16}{:>12}{:>10}{:>10}{:>12}{:>13}",
            "lattice",
            "points",
            "voxels",
            "MSE/dim (m^2)",
            "mean (m)",
            "RMS (m)",
            "max (m)",
            "map bytes",
            if self.has_markers() {
                "marker bytes"
            } else {
                ""
            }
        )?;
        for LatticeReport { map, markers } in &self.lattices {
            writeln!(
                f,
                "{:<8}{:>10}{:>10}{:>16.6}{:>12.5}{:>10.5}{:>10.4}{:>12}{:>13}",
                map.lattice,
                map.points,
                map.voxels,
                map.mse_per_dimension_m2,
                map.mean_distance_m,
                map.rms_m,
                map.max_distance_m,
                map.map_bytes
                    .map_or_else(String::new, |bytes| bytes.to_string()),
                (markers.as_ref())
                    .map_or_else(String::new, |markers| markers.marker_bytes.to_string())
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice_mapper::{LatticeMapper, MapperOptions};
    use lattice_core::lattice::{Lattice, LatticeKind};

    fn report() -> RunReport {
        let lattice = Lattice::new(LatticeKind::Fcc, 0.125).unwrap();
        let mapper = LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap();
        let mut report = RunReport {
            source: "log".into(),
            clouds_in_log: 10,
            transformer: TransformerReport::default(),
            cameras: Vec::new(),
            lattices: vec![LatticeReport {
                map: MapperReport::of(&mapper),
                markers: None,
            }],
            origin: None,
            odometry: None,
            implausible_rows: 0,
            cuts: Vec::new(),
            fit: Vec::new(),
            choices: Vec::new(),
            wall_s: 1.0,
        };
        let counts = &mut report.transformer.counts;
        (counts.clouds_in, counts.clouds_out) = (10, 10);
        report.lattices[0].map.counts.clouds_in = 10;
        report
    }

    fn map(report: &mut RunReport) -> &mut MapperReport {
        &mut report.lattices[0].map
    }

    #[test]
    fn every_kind_of_loss_is_shown() {
        assert!(report().losses().is_empty());
        assert!(report().to_string().contains("dropped: none"));
        type Change = (&'static str, fn(&mut RunReport) -> &mut u64);
        let changes: [Change; 13] = [
            ("reach the transformer", |r| &mut r.clouds_in_log),
            ("pose_gap", |r| &mut r.transformer.counts.clouds_pose_gap),
            ("inbox_full", |r| &mut r.transformer.clouds_inbox_full),
            ("poses and", |r| &mut r.transformer.poses_inbox_full),
            ("lost_on_network", |r| {
                &mut r.transformer.clouds_lost_on_network
            }),
            ("lost_on_network", |r| {
                &mut r.transformer.poses_lost_on_network
            }),
            ("undecodable", |r| &mut r.transformer.undecodable),
            ("reach the fcc", |r| &mut r.transformer.counts.clouds_out),
            ("malformed", |r| &mut map(r).counts.clouds_malformed),
            ("inbox full", |r| &mut map(r).clouds_inbox_full),
            ("on the network", |r| &mut map(r).clouds_lost_on_network),
            ("max_voxels", |r| &mut map(r).counts.points_list_full),
            ("of keys", |r| &mut map(r).counts.points_out_of_range),
        ];
        for (words, change) in changes {
            let mut report = report();
            *change(&mut report) += 1;
            let shown = report.to_string();
            assert!(shown.contains(words), "{words}: {shown}");
            assert!(!shown.contains("dropped: none"), "{words}");
        }
    }
}
