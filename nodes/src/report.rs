//! What a run took in, dropped and made: written by nodes at their end, shown as one table.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io;
use std::path::Path;

use lattice_core::voxels::Distortion;
use serde::{Deserialize, Serialize};

use crate::enu_transformer::TransformerCounts;
use crate::lattice_mapper::{LatticeMapper, MapperCounts};
use crate::voxel_marker_publisher::MarkerCounts;
use lattice_msgs::cdr;

/// The end of an `enu_transformer`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformerReport {
    /// Everything counted by the state machine.
    pub counts: TransformerCounts,
    /// Clouds that were sent and lost on the way, or that found the inbox full.
    pub clouds_inbox_full: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Clouds that could not be given to the publisher.
    pub clouds_not_published: u64,
}

impl TransformerReport {
    /// Clouds lost by reason, zeros left out.
    pub fn dropped(&self) -> BTreeMap<String, u64> {
        let own = [
            ("inbox_full", self.clouds_inbox_full),
            ("undecodable", self.undecodable),
            ("not_published", self.clouds_not_published),
        ];
        let reasons = self.counts.reasons().into_iter().chain(own);
        reasons
            .filter(|(_, count)| *count > 0)
            .map(|(reason, count)| (reason.to_owned(), count))
            .collect()
    }
}

/// The end of a `lattice_mapper`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapperReport {
    /// Name of the lattice.
    pub lattice: String,
    /// Volume of one cell.
    pub cell_volume_m3: f64,
    /// Everything counted by the state machine.
    pub counts: MapperCounts,
    /// Clouds that were sent and lost on the way, or that found the inbox full.
    pub clouds_inbox_full: u64,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Updates that could not be given to the publisher; a keyframe followed.
    pub updates_not_published: u64,
    /// Voxels in the map.
    pub voxels: usize,
    /// Points that the statistics are of.
    pub points: u64,
    /// Mean squared error per dimension.
    pub mse_per_dimension_m2: f64,
    /// Ryde & Brünig eq. (13).
    pub mean_distance_m: f64,
    /// Root of the mean squared distance.
    pub rms_m: f64,
    /// Largest distance.
    pub max_distance_m: f64,
    /// Bytes of a whole keyframe as CDR.
    pub map_bytes: usize,
    /// CRC-32 of the voxel keys and payloads of that keyframe.
    pub map_crc32: u32,
}

impl MapperReport {
    /// Sums up a mapper; makes one keyframe to count its bytes.
    pub fn of(mapper: &mut LatticeMapper) -> Self {
        let Distortion {
            points,
            mse_per_dimension_m2,
            mean_distance_m,
            rms_m,
            max_distance_m,
        } = mapper.distortion();
        let counts = mapper.counts().clone();
        let mut crc = crc32fast::Hasher::new();
        let mut map_bytes = 0;
        for chunk in mapper.keyframe() {
            map_bytes += cdr::to_vec(&chunk).map_or(0, |bytes| bytes.len());
            crc.update(&chunk.keys);
            for count in &chunk.counts {
                crc.update(&count.to_le_bytes());
            }
            for offset in &chunk.mean_offsets {
                crc.update(&offset.to_le_bytes());
            }
        }
        let lattice = mapper.list().lattice();
        Self {
            lattice: lattice.kind().name().to_owned(),
            cell_volume_m3: lattice.cell_volume_m3(),
            counts,
            clouds_inbox_full: 0,
            undecodable: 0,
            updates_not_published: 0,
            voxels: mapper.list().len(),
            points,
            mse_per_dimension_m2,
            mean_distance_m,
            rms_m,
            max_distance_m,
            map_bytes,
            map_crc32: crc.finalize(),
        }
    }
}

/// The end of a `voxel_marker_publisher`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerReport {
    /// Everything counted by the state machine.
    pub counts: MarkerCounts,
    /// Voxels of the map that it followed.
    pub voxels: usize,
    /// Bytes of all current markers as CDR: what a viewer that joins now receives.
    pub marker_bytes: usize,
    /// Bytes given out over the whole run.
    pub published_bytes: u64,
    /// Arrays that could not be given to the publisher.
    pub arrays_not_published: u64,
}

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
    /// Where the clouds came from.
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

/// The numbers of a report as diagnostics show them, one level.
pub fn key_values(report: &impl Serialize) -> Vec<(String, String)> {
    fn walk(name: &str, value: &serde_json::Value, out: &mut Vec<(String, String)>) {
        match value {
            serde_json::Value::Object(fields) => {
                for (key, value) in fields {
                    walk(key, value, out);
                }
            }
            value => out.push((name.to_owned(), value.to_string())),
        }
    }
    let mut out = Vec::new();
    if let Ok(value) = serde_json::to_value(report) {
        walk("", &value, &mut out);
    }
    out
}

/// Writes a report as JSON where a path is given.
pub fn write(path: &str, report: &impl Serialize) -> io::Result<()> {
    if path.is_empty() {
        return Ok(());
    }
    let text = serde_json::to_string_pretty(report).map_err(io::Error::other)?;
    // Readers see the whole report or none.
    let partial = format!("{path}.partial");
    fs::write(&partial, text + "\n")?;
    fs::rename(partial, path)
}

/// Reads a report that [`write()`] wrote.
pub fn read<T: for<'de> Deserialize<'de>>(path: &Path) -> io::Result<T> {
    let text = fs::read_to_string(path)?;
    serde_json::from_str(&text).map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice_mapper::MapperOptions;
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
