//! Slope and step of surfaces.

use nalgebra::Vector3;

use super::GroundOptions;
use super::columns::Columns;
use super::surfaces::{ColumnState, Layer, Surface};
use super::tiles::{Column, Tiles};

/// Strides on each side from which the inclination beyond a step is taken.
pub(super) const REACH: i32 = 4;
/// Strides between the two surfaces of an inclination.
const BASELINE: i32 = 2;
/// Part of a limit by which rounding may exceed it.
const SLACK: f64 = 1e-9;

type States = Tiles<ColumnState>;

/// Slope and step of a surface.
pub(super) struct Terrain {
    pub(super) slope: f64,
    pub(super) step_m: f64,
    pub(super) is_standable: bool,
}

/// Terrain of each surface of a column, from their layers.
pub(super) fn standable(
    columns: &Columns,
    states: &States,
    column: Column,
    layers: &[Layer],
    ground: &GroundOptions,
) -> Vec<Terrain> {
    let surfaces = states.get(column).map_or(&[][..], |state| &state.surfaces);
    let link_m = ground.max_link_m(columns.resolution_m);
    let judge = |(surface, layer): (&Surface, &Layer)| {
        let [x, y] =
            [0, 1].map(|axis| Profile::new(columns, states, column, surface, axis, link_m));
        // Surfaces of a profile are not quite on its axis: what the other axis adds to their heights is taken off.
        let [across_y, across_x] =
            [&x, &y].map(|profile| profile.inclination(0.0, ground.max_step_m));
        let slope_x = x.inclination(across_x, ground.max_step_m);
        let slope_y = y.inclination(across_y, ground.max_step_m);
        let slope = slope_x.hypot(slope_y);
        let step_m = step_m(
            layer,
            &x.beyond(across_x, ground),
            &y.beyond(across_y, ground),
        );
        let within = |value: f64, limit: f64| value <= limit * (1.0 + SLACK);
        Terrain {
            slope,
            step_m,
            is_standable: within(slope, ground.max_rise()) && within(step_m, ground.max_step_m),
        }
    };
    surfaces.iter().zip(layers).map(judge).collect()
}

/// Range of samples about the inclination that explains them best, metres.
fn step_m(layer: &[Vector3<f64>], x: &[f64], y: &[f64]) -> f64 {
    let range = |gx: f64, gy: f64| {
        let residuals = layer.iter().map(|p| p.z - gx * p.x - gy * p.y);
        let bounds = residuals.fold((f64::MAX, f64::MIN), |(low, high), residual| {
            (low.min(residual), high.max(residual))
        });
        bounds.1 - bounds.0
    };
    let pairs = x.iter().flat_map(|gx| y.iter().map(|gy| (*gx, *gy)));
    pairs.map(|(gx, gy)| range(gx, gy)).fold(f64::MAX, f64::min)
}

/// Profile of the ground along one axis through a surface.
struct Profile {
    axis: usize,
    /// On either side: from the surface to that [`BASELINE`] strides away, and from there on by as much, metres.
    sides: [[Option<Vector3<f64>>; 2]; 2],
}

impl Profile {
    fn new(
        columns: &Columns,
        states: &States,
        column: Column,
        surface: &Surface,
        axis: usize,
        link_m: f64,
    ) -> Profile {
        let near = BASELINE * columns.stride();
        let side = |sign: i32| {
            let mut at = (column, surface.at_m);
            let mut baseline = || {
                let from_m = at.1;
                for _ in 0..near {
                    at = next(states, at, axis, sign, link_m)?;
                }
                let baseline_m = at.1 - from_m;
                (baseline_m[axis].abs() > 0.5 * columns.resolution_m).then_some(baseline_m)
            };
            let beside = baseline();
            [beside, beside.and_then(|_| baseline())]
        };
        Profile {
            axis,
            sides: [side(-1), side(1)],
        }
    }

    /// Rise per metre along the axis, where the ground rises by `across` per metre along the other one.
    fn rise(&self, baseline_m: &Vector3<f64>, across: f64) -> f64 {
        let across_m = baseline_m[1 - self.axis];
        (baseline_m.z - across * across_m) / baseline_m[self.axis]
    }

    /// Inclination of the surface; 0 where both sides differ in sign.
    ///
    /// It is the median of both sides and of the lesser inclination beyond. On a plane the smaller one of two sides would be
    /// too small by the noise of the points. Beside a step the side without it is left, as the ground beyond is no steeper.
    ///
    /// The mean of a surface that spans a step is between the two levels, so that both sides are inclined. Where the rise
    /// from side to side is one that the robot drives over, the inclination is no more than that of the steeper ground beyond.
    fn inclination(&self, across: f64, max_step_m: f64) -> f64 {
        let rise = |baseline_m: Vector3<f64>| self.rise(&baseline_m, across);
        let beside_m = self.sides.map(|[beside_m, _]| beside_m);
        let beyond = self.sides.map(|[_, beyond_m]| beyond_m.map(rise));
        let (a, b) = match beside_m.map(|side| side.map(rise)) {
            [Some(a), Some(b)] => (a, b),
            [None, None] => return 0.0,
            [Some(one), None] | [None, Some(one)] => return one,
        };
        let (small, large) = (a.abs().min(b.abs()), a.abs().max(b.abs()));
        if a * b <= 0.0 {
            return 0.0;
        }
        let ([Some(low_m), Some(high_m)], [Some(low), Some(high)]) = (beside_m, beyond) else {
            return small.copysign(a);
        };
        let [low, high] = [low, high].map(|beyond| beyond * a.signum());
        let median = low.min(high).max(small).min(large);
        let steeper = low.abs().max(high.abs());
        let span_m = high_m - low_m;
        let step_m = (rise(span_m) * span_m[self.axis]).abs();
        let found = match step_m <= max_step_m {
            true => median.min(steeper),
            false => median,
        };
        found.copysign(a)
    }

    /// Inclinations that are beyond a step here, besides none.
    fn beyond(&self, across: f64, ground: &GroundOptions) -> Vec<f64> {
        let most = ground.max_rise();
        let beyond = self.sides.iter().filter_map(|[_, beyond]| *beyond);
        let beyond = beyond.map(|baseline_m| self.rise(&baseline_m, across).clamp(-most, most));
        std::iter::once(0.0).chain(beyond).collect()
    }
}

/// Surface of the next column along an axis that continues a surface.
fn next(
    states: &States,
    (column, at_m): (Column, Vector3<f64>),
    axis: usize,
    sign: i32,
    link_m: f64,
) -> Option<(Column, Vector3<f64>)> {
    let [x, y] = column;
    let column = match axis {
        0 => [x.checked_add(sign)?, y],
        _ => [x, y.checked_add(sign)?],
    };
    let rise_m = |surface: &&Surface| (surface.at_m.z - at_m.z).abs();
    let surfaces = states.get(column)?.surfaces.iter();
    let nearest = surfaces.min_by(|a, b| rise_m(a).total_cmp(&rise_m(b)))?;
    (rise_m(&nearest) <= link_m).then_some((column, nearest.at_m))
}
