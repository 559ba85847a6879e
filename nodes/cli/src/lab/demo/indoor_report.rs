//! The table at the end of `lattice demo --indoor`.

use std::fmt;

use lattice_lab::datasets::LabelAccuracy;
use serde::Serialize;

/// Numbers of an indoor demo.
#[derive(Clone, Debug, Serialize)]
pub struct IndoorReport {
    /// Origin of the labels.
    pub labels: &'static str,
    /// Images of the robot.
    pub images: usize,
    /// Clouds with labels that were made of them.
    pub clouds: u64,
    /// Points of these.
    pub points: u64,
    /// Messages dropped on the way, by topic and reason.
    pub dropped: std::collections::BTreeMap<String, u64>,
    /// Voxels of the map.
    pub voxels: usize,
    /// Voxels whose most frequent class is the true one.
    pub map_labels: LabelAccuracy,
    /// Share of these, 0 to 1.
    pub label_share: f64,
    /// Triangles of the headset's mesh.
    pub triangles: usize,
    /// Clouds of the headset.
    pub headset_clouds: u64,
    /// Points of these.
    pub headset_points: u64,
    /// Verdict of the last calibration.
    pub verdict: String,
    /// Reason that it gives.
    pub reason: String,
    /// Distance of the headset's origin from the truth, m; none without an answer.
    pub off_m: Option<f64>,
    /// Angle to the truth, degrees.
    pub off_deg: Option<f64>,
    /// Time of the search, s.
    pub search_s: f64,
    /// Time of the demo, s.
    pub wall_s: f64,
}

impl fmt::Display for IndoorReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let off = match (self.off_m, self.off_deg) {
            (Some(m), Some(deg)) => format!("{m:.3} m, {deg:.2} degrees"),
            _ => "no answer".to_owned(),
        };
        let dropped = self.dropped.iter();
        let dropped: Vec<_> = dropped.map(|(reason, n)| format!("{n} {reason}")).collect();
        let rows = [
            ("labels", self.labels.to_owned()),
            (
                "images of the robot",
                format!("{}, {} of them clouds", self.images, self.clouds),
            ),
            ("points", self.points.to_string()),
            ("voxels", self.voxels.to_string()),
            (
                "labels of voxels",
                format!(
                    "{:.1} % right of {}",
                    100.0 * self.label_share,
                    self.map_labels.compared
                ),
            ),
            (
                "headset",
                format!(
                    "mesh of {} triangles, {} clouds of {} points",
                    self.triangles, self.headset_clouds, self.headset_points
                ),
            ),
            (
                "dropped",
                if dropped.is_empty() {
                    "nothing".to_owned()
                } else {
                    dropped.join(", ")
                },
            ),
            ("verdict", format!("{} ({})", self.verdict, self.reason)),
            ("headset's pose is off by", off),
            (
                "time",
                format!(
                    "{:.1} s, the search {:.1} s of it",
                    self.wall_s, self.search_s
                ),
            ),
        ];
        for (name, value) in &rows {
            writeln!(f, "{name:<26}{value}")?;
        }
        Ok(())
    }
}
