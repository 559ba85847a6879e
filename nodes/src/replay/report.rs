//! Report of a run over a log: input, losses and one row for each lattice.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::enu_transformer::TransformerReport;
use crate::lattice_mapper::MapperReport;
use crate::voxel_marker_publisher::MarkerReport;

/// Map and markers of one lattice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LatticeReport {
    /// The map.
    pub map: MapperReport,
    /// Its markers.
    pub markers: MarkerReport,
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
    /// One for each lattice.
    pub lattices: Vec<LatticeReport>,
    /// Wall time.
    pub wall_s: f64,
}

impl RunReport {
    /// One line per loss, empty when nothing was lost.
    pub fn losses(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let counts = &self.transformer.counts;
        let refused = self.transformer.clouds_inbox_full + self.transformer.undecodable;
        let missing = self
            .clouds_in_log
            .saturating_sub(counts.clouds_in + refused);
        if missing > 0 {
            lines.push(format!(
                "{missing} of {} clouds of the log did not reach the transformer",
                self.clouds_in_log
            ));
        }
        for (reason, count) in self.transformer.dropped() {
            lines.push(format!("{count} of {} clouds: {reason}", counts.clouds_in));
        }
        for LatticeReport { map, .. } in &self.lattices {
            let arrived = map.counts.clouds_in;
            if arrived < counts.clouds_out {
                let lost = counts.clouds_out - arrived;
                lines.push(format!(
                    "{lost} of {} transformed clouds did not reach the {} map",
                    counts.clouds_out, map.lattice
                ));
            }
            let lost = [
                (
                    "clouds",
                    "not in the map frame",
                    map.counts.clouds_wrong_frame,
                ),
                ("clouds", "malformed", map.counts.clouds_malformed),
                (
                    "clouds",
                    "without sensor positions, so that they clear nothing",
                    map.counts.clouds_no_viewpoint,
                ),
                (
                    "clouds",
                    "lost on the way or inbox full",
                    map.clouds_inbox_full,
                ),
                ("samples", "undecodable", map.undecodable),
                ("points", "not finite", map.counts.points_not_finite),
                (
                    "points",
                    "beyond the reach of keys",
                    map.counts.points_out_of_range,
                ),
                (
                    "points",
                    "more voxels than max_voxels",
                    map.counts.points_list_full,
                ),
            ];
            for (what, reason, count) in lost.into_iter().filter(|(_, _, count)| *count > 0) {
                lines.push(format!(
                    "{count} {what} of the {} map: {reason}",
                    map.lattice
                ));
            }
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
            "marker bytes"
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
                map.map_bytes,
                markers.marker_bytes
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
        let mut mapper = LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap();
        let mut report = RunReport {
            source: "log".into(),
            clouds_in_log: 10,
            transformer: TransformerReport::default(),
            lattices: vec![LatticeReport {
                map: MapperReport::of(&mut mapper),
                markers: MarkerReport::default(),
            }],
            wall_s: 1.0,
        };
        let counts = &mut report.transformer.counts;
        (counts.clouds_in, counts.clouds_out) = (10, 10);
        report.lattices[0].map.counts.clouds_in = 10;
        report
    }

    #[test]
    fn every_kind_of_loss_is_shown() {
        assert!(report().losses().is_empty());
        assert!(report().to_string().contains("dropped: none"));
        type Change<'a> = (&'a str, &'a dyn Fn(&mut RunReport));
        let changes: [Change; 9] = [
            ("reach the transformer", &|r| {
                r.transformer.counts.clouds_in = 9
            }),
            ("pose_gap", &|r| r.transformer.counts.clouds_pose_gap = 1),
            ("inbox_full", &|r| r.transformer.clouds_inbox_full = 1),
            ("undecodable", &|r| r.transformer.undecodable = 1),
            ("reach the fcc map", &|r| {
                r.lattices[0].map.counts.clouds_in = 9
            }),
            ("malformed", &|r| {
                r.lattices[0].map.counts.clouds_malformed = 1
            }),
            ("inbox full", &|r| r.lattices[0].map.clouds_inbox_full = 1),
            ("max_voxels", &|r| {
                r.lattices[0].map.counts.points_list_full = 1
            }),
            ("reach of keys", &|r| {
                r.lattices[0].map.counts.points_out_of_range = 1
            }),
        ];
        for (words, change) in changes {
            let mut report = report();
            change(&mut report);
            let shown = report.to_string();
            assert!(shown.contains(words), "{words}: {shown}");
            assert!(!shown.contains("dropped: none"), "{words}");
        }
    }
}
