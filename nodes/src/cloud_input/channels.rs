//! Clouds of sensor_msgs/PointCloud.

use lattice_msgs::sensor_msgs::{PointCloud, PointCloud2, PointField};

use super::error::{CloudInputError, check_count};
use super::records::Records;

/// Limit of a channel's name in an error.
const SHOWN_CHARS: usize = 48;

/// Cloud of a message: each channel is a field of f32, one of times by its name as in a PointCloud2.
pub fn cloud_of_channels(message: &PointCloud) -> Result<PointCloud2, CloudInputError> {
    let points = message.points.len();
    check_count(points)?;
    for channel in &message.channels {
        if channel.values.len() != points {
            return Err(CloudInputError::ChannelLength {
                channel: channel.name.chars().take(SHOWN_CHARS).collect(),
                values: channel.values.len(),
                points,
            });
        }
    }
    let channels = message.channels.iter();
    let fields: Vec<_> = channels
        .map(|channel| (channel.name.as_str(), PointField::FLOAT32))
        .collect();
    let mut records = Records::new(points, &fields);
    for (i, point) in message.points.iter().enumerate() {
        records.begin([point.x, point.y, point.z]);
        for channel in &message.channels {
            let value = channel.values.get(i).copied().unwrap_or(f32::NAN);
            records.put(value.to_le_bytes());
        }
    }
    Ok(records.finish(message.header.clone()))
}
