//! Conversion between labelled PointCloud2 and the core's [`SemanticCloud`].
//!
//! Labels in clouds have no standard; [`LabelReader`] supports the conventions in use.

mod fields;
mod options;
mod write;

pub use fields::LabelReader;
pub use options::{Color, LabelOptions, SemanticOptions, palette_from_params};
pub use write::{color_of, message_from_semantic};

use lattice_core::cloud::{CloudError, CloudLimits, CloudView};
use lattice_core::registration::{LabelDistribution, SemanticCloud, SourceCloud};
use lattice_msgs::sensor_msgs::PointCloud2;
use thiserror::Error;

use super::cloud;
use super::viewpoint::viewpoint_of;

/// Largest sensor movement during a cloud with a single viewpoint, m.
const MAX_MOVED_M: f64 = 0.1;

/// Reason for rejecting a cloud.
#[derive(Debug, Error)]
pub enum SemanticError {
    /// The data do not match the header, or there are too many points.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// Empty cloud.
    #[error("the cloud has no points")]
    Empty,
    /// No usable point.
    #[error(
        "none of the {points} points is finite and within {max_range_m} m of the origin of the headset"
    )]
    NoPlace {
        /// Points of the cloud.
        points: usize,
        /// The limit.
        max_range_m: f64,
    },
    /// No label field.
    #[error(
        "the cloud has no labels: there is no field label, label_probs, p_0, semantic_color or \
         semantic_color1 among {found} (colours need `palette_rgb_class`)"
    )]
    NoLabels {
        /// Names of its fields.
        found: String,
    },
    /// No labelled point.
    #[error("none of the {points} points has a label of a known class")]
    AllUnlabelled {
        /// Points of the cloud.
        points: usize,
    },
}

/// Numbers of rejected and unlabelled points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SemanticReport {
    /// Points of the message.
    pub points: usize,
    /// Rejected: NaN or infinite.
    pub not_finite: usize,
    /// Rejected: farther from the origin than the limit.
    pub too_far: usize,
    /// Kept, but without a known class.
    pub unlabelled: usize,
}

/// Converts a cloud to the axes of ROS.
///
/// A message without labels gives an unlabelled cloud, unless labels are required.
pub fn semantic_from_message(
    message: &PointCloud2,
    options: &SemanticOptions,
) -> Result<(SemanticCloud, SemanticReport), SemanticError> {
    let layout = cloud::layout_of(message);
    semantic_from_view(&layout.view(&message.data, &limits(options))?, options)
}

fn limits(options: &SemanticOptions) -> CloudLimits {
    CloudLimits {
        max_points: options.max_points,
    }
}

fn semantic_from_view(
    view: &CloudView,
    options: &SemanticOptions,
) -> Result<(SemanticCloud, SemanticReport), SemanticError> {
    let mut report = SemanticReport {
        points: view.len(),
        ..SemanticReport::default()
    };
    if view.is_empty() {
        return Err(SemanticError::Empty);
    }
    let reader = LabelReader::find(view.fields(), &options.labels);
    if reader.is_none() && options.require_labels {
        let names = view.fields().iter().take(24);
        let names: Vec<String> = names.map(|f| f.name.chars().take(32).collect()).collect();
        return Err(SemanticError::NoLabels {
            found: names.join(", "),
        });
    }
    let mut semantic = SemanticCloud::default();
    semantic.points_m.reserve(view.len());
    for i in 0..view.len() {
        let p = view.xyz(i);
        let distance_m = p.norm();
        if !distance_m.is_finite() {
            report.not_finite += 1;
        } else if distance_m > options.max_range_m {
            report.too_far += 1;
        } else {
            semantic.points_m.push(options.axes.to_ros(p).into());
            if let Some(reader) = &reader {
                let label = reader.read(view, i);
                report.unlabelled += usize::from(label == LabelDistribution::UNKNOWN);
                semantic.labels.push(label);
            }
        }
    }
    if semantic.is_empty() {
        return Err(SemanticError::NoPlace {
            points: report.points,
            max_range_m: options.max_range_m,
        });
    }
    if reader.is_none() || report.unlabelled == semantic.len() {
        if options.require_labels {
            return Err(SemanticError::AllUnlabelled {
                points: semantic.len(),
            });
        }
        report.unlabelled = semantic.len();
        semantic.labels.clear();
    }
    Ok((semantic, report))
}

/// Converts a headset cloud as [`semantic_from_message`] does, with its viewpoint.
pub fn headset_scan_from_message(
    message: &PointCloud2,
    options: &SemanticOptions,
) -> Result<(SourceCloud, SemanticReport), SemanticError> {
    let layout = cloud::layout_of(message);
    let view = layout.view(&message.data, &limits(options))?;
    let (cloud, report) = semantic_from_view(&view, options)?;
    let viewpoint_m = viewpoint_of(&view, MAX_MOVED_M);
    let sensor_m = viewpoint_m.map(|v| options.axes.to_ros(v).into());
    Ok((SourceCloud { cloud, sensor_m }, report))
}

/// Most probable class of each point of a message, in its order, NaN points included; `None` without
/// labels.
pub fn labels_from_message(
    message: &PointCloud2,
    max_points: usize,
    options: &LabelOptions,
) -> Result<Option<Vec<u16>>, CloudError> {
    use lattice_core::registration::UNLABELED;

    let layout = cloud::layout_of(message);
    let view = layout.view(&message.data, &CloudLimits { max_points })?;
    let Some(reader) = LabelReader::find(view.fields(), options) else {
        return Ok(None);
    };
    let labels = (0..view.len()).map(|i| reader.read(&view, i).top().unwrap_or(UNLABELED));
    Ok(Some(labels.collect()))
}

#[cfg(test)]
mod tests;
