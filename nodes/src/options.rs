//! Common parameters of several nodes: frames, words, limits of threads and inboxes.

use std::time::Duration;

use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};
use nalgebra::Vector3;

use crate::compute::ComputeLimits;

/// Common parameters of several nodes.
pub const COMMON: &[About] = about! {
    "map_frame" fixed(FRAME): "Frame of the map (x east, y north, z up where it comes from an INS).";
    "threads" fixed("the pool is made with it"): "Threads of the compute pool; 0: one less than the machine has.";
    "inbox_events" fixed(INBOX): "Limit of messages queued for the compute thread.";
    "inbox_bytes" fixed(INBOX): "Limit of message bytes queued for the compute thread.";
    "report_file" fixed("it names an output"): "File for a report in JSON at the end; empty: none.";
    "mapper" fixed("it names a topic"): "Node that receives keyframe requests after a loss of map messages.";
    "max_cloud_points": "Limit of points per cloud; larger clouds are rejected.";
    "max_voxels": "Voxel limit of the followed map.";
    "max_image_pixels": "Limit of pixels per image; larger images are rejected.";
    "rectified": "Whether the images are rectified: p of camera_info is used, otherwise k and the distortion.";
    "stride": "Step between the rows and columns that become points.";
    "min_range_m": "Points nearer to the sensor are rejected.";
    "max_range_m": "Points farther from the sensor are rejected; 0: no limit.";
    "update_period_s": "Period of voxel_map_updates.";
    "group_labels": "Groups of classes: class, group, class, group and so on.";
    "label_low_16_bits": "Whether only the low 16 bits of 32-bit labels are the class (SemanticKITTI: the high bits are the instance).";
    "ignored_labels": "Classes treated as unlabelled, such as 0 in SemanticKITTI.";
    "palette_rgb_class": "Classes of colours, for clouds labelled by the colours semantic_color, semantic_color1 to 3 or rgb, and for colour masks: red, green, blue, class, and so on.";
};

/// Reason why frames are read-only.
pub const FRAME: &str = "others know it by now";
/// Reason why topics are read-only.
pub const TOPIC: &str = "it is subscribed to";
const INBOX: &str = "the inbox is made with it";

/// Largest settable number of inbox events: memory is reserved for all of them.
const MAX_EVENTS: usize = 1 << 18;
/// Largest settable number of pool threads.
const MAX_THREADS: usize = 256;
/// Smallest chunk size that fits a header and some voxels.
const MIN_CHUNK_BYTES: usize = 2048;

/// Reads a frame name and removes leading slashes.
pub fn frame(params: &Params, name: &str, default: &str) -> Result<String, ParamError> {
    let frame = params.string(name, default)?;
    match frame.trim_start_matches('/') {
        "" => Err(params.invalid(name, "expected the name of a frame")),
        frame => Ok(frame.to_owned()),
    }
}

/// Reads one of several words; the first is the default.
pub fn one_of<T: Copy>(params: &Params, name: &str, words: &[(&str, T)]) -> Result<T, ParamError> {
    let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
    let place = params.word(name, &known)?;
    let found = words.get(place).map(|(_, value)| *value);
    found.ok_or_else(|| params.invalid(name, "there are no words to choose from"))
}

/// `inbox_events`: limit of queued events of a node.
pub fn inbox_events(params: &Params, default: usize) -> Result<usize, ParamError> {
    params.usize_in("inbox_events", default, 1..=MAX_EVENTS)
}

/// Limits of a compute thread, with the defaults of `inbox_events` and `inbox_bytes`.
pub fn compute_limits(
    params: &Params,
    events: usize,
    bytes: usize,
    threads: usize,
) -> Result<ComputeLimits, ParamError> {
    Ok(ComputeLimits {
        events: inbox_events(params, events)?,
        bytes: params.positive("inbox_bytes", bytes)?,
        threads,
    })
}

/// `threads`: threads of a pool; 0: one less than the number of cores.
pub fn threads(params: &Params, default: usize) -> Result<usize, ParamError> {
    params.usize_in("threads", default, 0..=MAX_THREADS)
}

/// Reads a period in seconds.
pub fn period(params: &Params, name: &str, default_s: f64) -> Result<Duration, ParamError> {
    let seconds = params.f64_in(name, default_s, 0.01..=86_400.0)?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Reads a position in metres; the origin by default.
pub fn place_m(params: &Params, name: &str) -> Result<Vector3<f64>, ParamError> {
    match params.f64_array(name, &[0.0; 3])?[..] {
        [x, y, z] => Ok(Vector3::new(x, y, z)),
        _ => Err(params.invalid(name, "expected three numbers, x y z in metres")),
    }
}

/// `chunk_bytes`: largest serialized message.
pub fn chunk_bytes(params: &Params, default: usize) -> Result<usize, ParamError> {
    params.usize_in("chunk_bytes", default, MIN_CHUNK_BYTES..=1 << 26)
}

#[cfg(test)]
mod tests {
    use lattice_runtime::params::ParamValue;

    use super::*;
    use crate::enu_transformer::TransformerOptions;
    use crate::lattice_mapper::MapperOptions;
    use crate::semantic_icp_server::ServerOptions;
    use crate::voxel_marker_publisher::MarkerOptions;

    type Read = fn(&Params) -> Result<(), ParamError>;

    #[test]
    fn parameters_out_of_their_range_are_refused_by_name_and_range() {
        let transformer: Read = |params| TransformerOptions::from_params(params).map(drop);
        let mapper: Read = |params| MapperOptions::from_params(params).map(drop);
        let markers: Read = |params| MarkerOptions::from_params(params).map(drop);
        let server: Read = |params| ServerOptions::from_params(params).map(drop);
        let limits: Read = |params| compute_limits(params, 4096, 4096, 1).map(drop);
        let threads: Read = |params| threads(params, 0).map(drop);
        for (read, name, value, expected) in [
            (limits, "inbox_events", "0", "1 to 262144"),
            (limits, "inbox_events", "1000000000000", "1 to 262144"),
            (limits, "inbox_bytes", "0", "1 or more"),
            (threads, "threads", "100000", "0 to 256"),
            (transformer, "min_range_m", "60.0", "at most `max_range_m`"),
            (transformer, "min_range_m", "-1.0", "0.0 or more"),
            (transformer, "map_frame", "''", "the name of a frame"),
            (transformer, "base_frame", "'/'", "the name of a frame"),
            (transformer, "max_cloud_points", "0", "1 or more"),
            (transformer, "max_waiting_clouds", "0", "1 or more"),
            (
                transformer,
                "precision",
                "half",
                "auto or float32 or float64",
            ),
            (mapper, "map_frame", "''", "the name of a frame"),
            (mapper, "max_voxels", "0", "1 or more"),
            (mapper, "max_cloud_points", "0", "1 or more"),
            (mapper, "chunk_bytes", "0", "2048 to 67108864"),
            (mapper, "free_space", "yes, sir", "off or clear or"),
            (mapper, "payload", "bits", "centroid or occupancy"),
            (mapper, "rays.misses", "0", "1 to 4294967295"),
            (mapper, "rays.keep_ratio", "2.0", "0.0 to 1.0"),
            (mapper, "rays.max_bytes", "0", "or more"),
            (mapper, "free_level", "1", "evidence"),
            (markers, "chunk_bytes", "0", "2048 to 67108864"),
            (markers, "max_voxels", "0", "1 or more"),
            (markers, "block_bits", "11", "1 to 10"),
            (markers, "alpha", "7.0", "0.01 to 1.0"),
            (server, "map_frame", "''", "the name of a frame"),
            (server, "max_map_voxels", "0", "1 or more"),
            (server, "max_cloud_points", "0", "1 or more"),
            (server, "max_headset_scans", "0", "1 or more"),
        ] {
            let value = ParamValue::from_yaml_text(value).unwrap();
            let range = ("max_range_m", ParamValue::F64(50.0));
            let params = Params::from_values("/node", [(name, value), range]);
            let error = read(&params).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains(expected), "{error}");
        }
        // As it is typed in a file: not a bool.
        let off = ParamValue::from_yaml_text("off").unwrap();
        mapper(&Params::from_values("/node", [("free_space", off)])).unwrap();
    }
}
