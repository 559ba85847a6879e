//! Report of a depth camera in a replay: images, clouds and drops.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::semantic_cloud::CloudReport;

/// Reasons for which depth images become no clouds, with their remedies.
const REMEDIES: [(&str, &str); 7] = [
    (
        "depth_no_partner",
        "no label or colour image within `max_stamp_difference_s` of their stamp, or `queue_size` is too short for \
         labels that come late; `-p labels:=none` makes clouds without labels",
    ),
    (
        "depth_no_camera_info",
        "no valid camera_info: record the camera_info of the depth images from the beginning",
    ),
    (
        "depth_size",
        "camera_info is of images of another size: record the one of the depth images",
    ),
    (
        "depth_encoding",
        "the encoding is not read: record 16UC1 (mm) or 32FC1 (m), or compressedDepth as PNG",
    ),
    (
        "depth_too_large",
        "they have more pixels than `max_image_pixels`",
    ),
    ("depth_repeated", "their stamp came before"),
    ("depth_time_jump", "their stamps jump back"),
];

/// Report of one depth camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraReport {
    /// Topic of the depth images.
    pub topic: String,
    /// Text of the last rejection, if any; of direct replays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
    /// Report of its `semantic_cloud`.
    #[serde(flatten)]
    pub clouds: CloudReport,
}

impl CameraReport {
    /// Depth images that became no clouds.
    pub(super) fn left_out(&self) -> u64 {
        let counts = &self.clouds.counts;
        counts.depth_in.saturating_sub(counts.clouds_out)
    }

    /// One line for each reason.
    pub(super) fn losses(&self) -> Vec<String> {
        let (topic, all) = (&self.topic, self.clouds.counts.depth_in);
        let mut lines = Vec::new();
        for (reason, count) in &self.clouds.counts.dropped {
            // Companions without a depth image are no loss.
            if reason.ends_with("_no_partner") && reason != "depth_no_partner" {
                continue;
            }
            let remedy = REMEDIES.iter().find(|(name, _)| name == reason);
            let remedy = remedy.map_or(String::new(), |(_, remedy)| format!(": {remedy}"));
            lines.push(match reason.starts_with("depth_") {
                true => format!("{count} of {all} depth images on {topic}: {reason}{remedy}"),
                false => format!("{count} messages of the camera of {topic}: {reason}{remedy}"),
            });
        }
        let others = [
            (
                self.clouds.images_lost,
                "images lost on the network or inbox_full",
            ),
            (self.clouds.undecodable, "samples undecodable"),
            (self.clouds.clouds_not_published, "clouds not published"),
        ];
        for (count, what) in others.into_iter().filter(|(count, _)| *count > 0) {
            lines.push(format!("{count} {what}, of the camera of {topic}"));
        }
        if let Some(network) = &self.clouds.network {
            let dropped = network.dropped.iter();
            let dropped = dropped.map(|(reason, count)| {
                format!("{count} images for the network of {topic}: {reason}")
            });
            lines.extend(dropped);
        }
        let problem = self.problem.iter().filter(|_| !lines.is_empty());
        let last: Vec<String> = problem
            .map(|p| format!("last rejection on {topic}: {p}"))
            .collect();
        lines.extend(last);
        lines
    }

    /// Cause of a map without voxels, if no image became a point.
    pub(super) fn cause_of_nothing(&self) -> Option<String> {
        let counts = &self.clouds.counts;
        let points = &counts.points;
        if counts.clouds_out == 0 {
            let losses = self.losses();
            let why = match losses.is_empty() {
                true => "none were matched".to_owned(),
                false => losses.join("; "),
            };
            return Some(format!(
                "none of {} depth images on {} became a cloud: {why}",
                counts.depth_in, self.topic
            ));
        }
        (points.points == 0).then(|| {
            format!(
                "of {} pixels on {} {} have no depth, {} no ray, {} are at edges (`edge_jump`), {} out of range \
                 (`min_range_m`, `max_range_m`)",
                points.pixels,
                self.topic,
                points.pixels_no_depth,
                points.pixels_no_ray,
                points.pixels_at_edges,
                points.pixels_out_of_range
            )
        })
    }
}

impl fmt::Display for CameraReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = &self.clouds.counts;
        let points = &counts.points;
        write!(
            f,
            "{}: {} depth images, {} clouds, {} points, {} without label; pixels left out: {} without depth, {} without \
             ray, {} at edges, {} out of range",
            self.topic,
            counts.depth_in,
            counts.clouds_out,
            points.points,
            points.points_unlabelled,
            points.pixels_no_depth,
            points.pixels_no_ray,
            points.pixels_at_edges,
            points.pixels_out_of_range
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_is_a_line_and_images_without_depth_are_not() {
        let mut report = CameraReport {
            topic: "/depth".to_owned(),
            problem: None,
            clouds: CloudReport::default(),
        };
        let counts = &mut report.clouds.counts;
        counts.depth_in = 60;
        counts.drop_one("labels", "no_partner");
        assert!(report.losses().is_empty());
        let cause = report.cause_of_nothing().unwrap();
        assert!(
            cause.contains("none of 60 depth images on /depth"),
            "{cause}"
        );
        let counts = &mut report.clouds.counts;
        counts.drop_one("depth", "no_partner");
        counts.drop_one("labels", "malformed");
        (report.clouds.images_lost, report.clouds.undecodable) = (2, 3);
        report.problem = Some("depth: no label image".to_owned());
        let losses = report.losses().join("\n");
        for text in [
            "1 of 60 depth images on /depth: depth_no_partner: ",
            "`-p labels:=none`",
            "1 messages of the camera of /depth: labels_malformed",
            "2 images lost",
            "3 samples undecodable",
            "last rejection on /depth: depth: no label image",
        ] {
            assert!(losses.contains(text), "{losses}");
        }
        report.clouds.counts.clouds_out = 50;
        assert_eq!(report.left_out(), 10);
        report.clouds.counts.points.pixels_no_depth = 7;
        assert!(
            report
                .cause_of_nothing()
                .unwrap()
                .contains(" 7 have no depth")
        );
        report.clouds.counts.points.points = 1;
        assert!(report.cause_of_nothing().is_none());
        let text = serde_json::to_string(&report).unwrap();
        assert_eq!(serde_json::from_str::<CameraReport>(&text).unwrap(), report);
    }
}
