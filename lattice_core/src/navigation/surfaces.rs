//! Surfaces of a column that a robot may stand on.

use nalgebra::Vector3;

use super::GroundOptions;
use super::columns::Columns;
use super::tiles::Column;

/// Top of a span of matter in a column, with room for the robot above it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Surface {
    /// Weighted mean of its samples, map frame, metres; on planes a point of the plane.
    pub(super) at_m: Vector3<f64>,
    /// Rise per horizontal metre.
    pub(super) slope: f64,
    /// Height of the step at the column, metres.
    pub(super) step_m: f64,
    /// Distance to the lowest sample above, metres; infinite without any.
    pub(super) clearance_m: f64,
    /// True if slope and step are within the limits of the robot.
    pub(super) is_standable: bool,
}

/// Samples of a surface, as offsets from the centre of their column in x and y and as heights.
pub(super) type Layer = Vec<Vector3<f64>>;

/// Surfaces and matter of a column with samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ColumnState {
    /// Surfaces, lowest first.
    pub(super) surfaces: Vec<Surface>,
    /// Lowest and highest sample of each span that is taller than a step on a slope, metres.
    pub(super) tall_m: Vec<[f64; 2]>,
}

/// Maximum range of heights of the samples of one surface, metres: a step on the steepest slope.
fn layer_m(columns: &Columns, ground: &GroundOptions) -> f64 {
    ground.max_link_m(2.0 * columns.window_m)
}

/// Samples of a window in spans, lowest first: the robot fits between two of them.
///
/// Half a cell is added to its height, as a sample is the mean of a cell that reaches further down.
fn spans<'a>(
    columns: &Columns,
    window: &'a [Vector3<f64>],
    ground: &GroundOptions,
) -> impl Iterator<Item = &'a [Vector3<f64>]> {
    let room_m = ground.robot_height_m + 0.5 * columns.side_m();
    window.chunk_by(move |below, above| above.z - below.z < room_m)
}

/// Samples of a span within a step of its top that no other of these covers: the underside of a deck is none of them.
///
/// Covered samples cover none: those of a riser, each half a cell from the next, would hide the ground at its foot. So each
/// sample has one of the layer within half a cell.
fn layer(columns: &Columns, span: &[Vector3<f64>], ground: &GroundOptions) -> Layer {
    let top_m = span.last().map_or(0.0, |sample| sample.z);
    let low_m = top_m - layer_m(columns, ground);
    let begin = span.partition_point(|sample| sample.z < low_m);
    let near = span.get(begin..).unwrap_or_default();
    let half_m = 0.5 * columns.side_m();
    let covers = |a: &Vector3<f64>, b: &Vector3<f64>| (a.xy() - b.xy()).amax() < half_m;
    let mut layer = Layer::new();
    for sample in near.iter().rev() {
        if !layer.iter().any(|above| covers(above, sample)) {
            layer.push(*sample);
        }
    }
    layer.reverse();
    layer
}

/// Tests whether the centre of the column is among samples: none of eight half planes is without any.
fn surrounds(layer: &[Vector3<f64>]) -> bool {
    const HALF_PLANES: [[f64; 2]; 8] = [
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
        [-1.0, 1.0],
        [-1.0, 0.0],
        [-1.0, -1.0],
        [0.0, -1.0],
        [1.0, -1.0],
    ];
    HALF_PLANES.iter().all(|[x, y]| {
        layer
            .iter()
            .any(|sample| x * sample.x + y * sample.y >= 0.0)
    })
}

/// Layers of samples that are surfaces, in the order of [`ColumnState::surfaces`].
fn layers(columns: &Columns, window: &[Vector3<f64>], ground: &GroundOptions) -> Vec<Layer> {
    let layers = spans(columns, window, ground).map(|span| layer(columns, span, ground));
    layers.filter(|layer| surrounds(layer)).collect()
}

/// Layers of the surfaces of a column.
pub(super) fn layers_of(columns: &Columns, column: Column, ground: &GroundOptions) -> Vec<Layer> {
    layers(columns, &columns.window(column), ground)
}

/// State of a column and the layers of its surfaces; `None` without samples.
pub(super) fn of_column(
    columns: &Columns,
    column: Column,
    ground: &GroundOptions,
) -> Option<(ColumnState, Vec<Layer>)> {
    let window = columns.window(column);
    let tall_m = layer_m(columns, ground);
    let surface = |layer: &Layer, at_m: Vector3<f64>| Surface {
        at_m,
        slope: 0.0,
        step_m: 0.0,
        clearance_m: clearance_m(&window, layer, at_m.z),
        is_standable: false,
    };
    let tall = |span: &[Vector3<f64>]| match span {
        [low, .., high] if high.z - low.z > tall_m => Some([low.z, high.z]),
        _ => None,
    };
    (!window.is_empty()).then(|| {
        let layers = layers(columns, &window, ground);
        let state = ColumnState {
            surfaces: layers
                .iter()
                .map(|layer| surface(layer, mean(columns, column, layer)))
                .collect(),
            tall_m: spans(columns, &window, ground).filter_map(tall).collect(),
        };
        (state, layers)
    })
}

/// Distance from a surface to the lowest sample of a window above its layer, metres; infinite without any.
fn clearance_m(window: &[Vector3<f64>], layer: &[Vector3<f64>], z_m: f64) -> f64 {
    // The top of a span is the last one of its layer, as nothing covers it.
    let top_m = layer.last().map_or(z_m, |sample| sample.z);
    let above = window.partition_point(|sample| sample.z <= top_m);
    window
        .get(above)
        .map_or(f64::INFINITY, |sample| sample.z - z_m)
}

/// Mean of samples, weighted by their distance from the border of the window.
fn mean(columns: &Columns, column: Column, layer: &[Vector3<f64>]) -> Vector3<f64> {
    let [x_m, y_m] = columns.center_m(column);
    // Samples on the border count a little, so that the sum is not 0.
    let weight = |offset_m: f64| 1.0 + 1e-6 - offset_m.abs() / columns.window_m;
    let (mut sum, mut total) = (Vector3::zeros(), 0.0);
    for sample in layer {
        let weight = weight(sample.x) * weight(sample.y);
        sum += weight * sample;
        total += weight;
    }
    sum / total + Vector3::new(x_m, y_m, 0.0)
}
