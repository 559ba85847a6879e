//! sensor_msgs/PointCloud2, for serde.

use serde::{Deserialize, Serialize};

#[derive(Debug, Default, Deserialize, Serialize)]
struct Time {
    sec: i32,
    nanosec: u32,
}

#[derive(Debug, Default, Deserialize, Serialize)]
struct Header {
    stamp: Time,
    frame_id: String,
}

#[derive(Debug, Deserialize, Serialize)]
struct Field {
    name: String,
    offset: u32,
    datatype: u8,
    count: u32,
}

/// A point cloud.
#[derive(Debug, Default, Deserialize, Serialize)]
pub struct Cloud {
    header: Header,
    height: u32,
    width: u32,
    fields: Vec<Field>,
    is_bigendian: bool,
    point_step: u32,
    row_step: u32,
    data: Vec<u8>,
    is_dense: bool,
}

impl Cloud {
    /// A cloud of one byte per point.
    pub fn of(bytes: usize) -> Self {
        Self {
            height: 1,
            width: u32::try_from(bytes).unwrap_or(u32::MAX),
            point_step: 1,
            data: vec![7; bytes],
            ..Self::default()
        }
    }

    /// Width, bytes of data and their sum.
    pub fn summary(&self) -> String {
        let sum: u64 = self.data.iter().map(|byte| u64::from(*byte)).sum();
        format!("{} {} {sum}", self.width, self.data.len())
    }
}
