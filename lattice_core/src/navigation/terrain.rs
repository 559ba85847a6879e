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
        let slope = x.inclination().hypot(y.inclination());
        let step_m = step_m(layer, &x.beyond(ground), &y.beyond(ground));
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

/// Inclinations of the ground along one axis through a surface: beyond and up to it on either side.
struct Profile {
    sides: [[Option<f64>; 2]; 2],
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
            let mut inclination = || {
                let from_m = at.1;
                for _ in 0..near {
                    at = next(states, at, axis, sign, link_m)?;
                }
                let apart_m = at.1[axis] - from_m[axis];
                (apart_m.abs() > 0.5 * columns.resolution_m).then(|| (at.1.z - from_m.z) / apart_m)
            };
            let beside = inclination();
            [beside, beside.and_then(|_| inclination())]
        };
        Profile {
            sides: [side(-1), side(1)],
        }
    }

    /// The smaller one of both sides; 0 where they differ in sign.
    fn inclination(&self) -> f64 {
        match self.sides.map(|[beside, _]| beside) {
            [Some(a), Some(b)] if a * b <= 0.0 => 0.0,
            [Some(a), Some(b)] if a.abs() < b.abs() => a,
            [_, Some(one)] | [Some(one), None] => one,
            [None, None] => 0.0,
        }
    }

    /// Inclinations that are beyond a step here, besides none.
    fn beyond(&self, ground: &GroundOptions) -> Vec<f64> {
        let most = ground.max_rise();
        let beyond = self.sides.iter().filter_map(|[_, beyond]| *beyond);
        let beyond = beyond.map(|inclination| inclination.clamp(-most, most));
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
