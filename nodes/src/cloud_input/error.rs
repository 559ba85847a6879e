//! Error of a conversion.

use thiserror::Error;

/// Limit of points of a converted message.
pub const MAX_POINTS: usize = 4_000_000;

/// Reason for which a message is not converted.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CloudInputError {
    /// Angle or time of a scan.
    #[error("`{field}` is {value}, not finite: have the driver publish {unit}")]
    NotFinite {
        /// Field of the message.
        field: &'static str,
        /// Value.
        value: f32,
        /// Meaning and unit of the field.
        unit: &'static str,
    },
    /// More points than are converted.
    #[error(
        "{points} points in a message are over {MAX_POINTS}: have the driver publish them in parts"
    )]
    TooManyPoints {
        /// Points of the message.
        points: usize,
    },
    /// A channel that is shorter or longer than the points.
    #[error(
        "channel '{channel}' has {values} values for {points} points: have the driver publish one for each point"
    )]
    ChannelLength {
        /// Name of the channel.
        channel: String,
        /// Number of values of the channel.
        values: usize,
        /// Points of the message.
        points: usize,
    },
}

pub(super) fn check_count(points: usize) -> Result<(), CloudInputError> {
    match points > MAX_POINTS {
        true => Err(CloudInputError::TooManyPoints { points }),
        false => Ok(()),
    }
}
