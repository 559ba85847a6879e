//! Size, camera and colours of a picture.

use std::collections::BTreeMap;

/// Options of a picture of a map.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RenderOptions {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Azimuth of the camera seen from the map: degrees clockwise from north.
    pub azimuth_deg: f64,
    /// Elevation of the camera over the map: degrees, 90 looks straight down.
    pub elevation_deg: f64,
    /// Contrast of light and shadow: 1 as outdoors, 0 none.
    pub contrast: f64,
    /// A place to show in place of the whole map, at the same size whatever else there is.
    pub focus: Option<Focus>,
}

impl Default for RenderOptions {
    /// Full HD from the south-west.
    fn default() -> RenderOptions {
        RenderOptions {
            width: 1920,
            height: 1080,
            azimuth_deg: 215.0,
            elevation_deg: 35.0,
            contrast: 1.0,
            focus: None,
        }
    }
}

/// Place that a picture is centred on.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Focus {
    /// Middle of the picture: map frame, metres.
    pub center_m: [f64; 3],
    /// Width of the picture, metres.
    pub width_m: f64,
}

/// sRGB colours of labels.
pub type LabelColors = BTreeMap<u16, [u8; 3]>;
