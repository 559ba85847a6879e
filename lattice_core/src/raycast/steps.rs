//! Steps along the rays of a scan, several in turn.

use nalgebra::Vector3;

use super::families::{Families, Origin, Ray};
use super::packed::Packed;

/// Number of rays that are followed in turn.
const LANES: usize = 4;

/// Straight line from a sensor, metres from lattice point 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) origin_m: Vector3<f64>,
    /// Unit vector.
    pub(super) direction: Vector3<f64>,
}

/// Handler of the cells that rays leave. A trait: its methods can be compiled into their caller always, closures not.
pub(super) trait Visit {
    fn visit(&mut self, cell: Packed, place: &mut Place);
}

/// State of a ray besides its steps.
pub(super) struct Place {
    pub(super) end: Packed,
    pub(super) line: Option<Line>,
}

/// Steps along all rays, each given with its end; returns the number of visits.
#[inline(always)]
pub(super) fn step_all<const P: usize>(
    families: &Families<P>,
    origin: &Origin<P>,
    rays: impl Iterator<Item = (Ray<P>, Packed)>,
    visitor: &mut impl Visit,
) -> u64 {
    let mut visits = 0;
    let mut rays = rays.map(|(ray, end)| (ray, Place { end, line: None }));
    let mut lanes: Vec<(Ray<P>, Place)> = rays.by_ref().take(LANES).collect();
    while let Ok(full) = <&mut [(Ray<P>, Place); LANES]>::try_from(lanes.as_mut_slice()) {
        let mut has_ended = false;
        for (ray, place) in full {
            if let Some(cell) = families.step(origin, ray) {
                visitor.visit(cell, place);
                continue;
            }
            visits += ray.steps;
            match rays.next() {
                Some(next) => (*ray, place.end, place.line) = (next.0, next.1.end, None),
                None => {
                    ray.limit = 0;
                    has_ended = true;
                }
            }
        }
        if has_ended {
            lanes.retain(|(ray, _)| ray.limit > 0);
        }
    }
    for (ray, place) in &mut lanes {
        while let Some(cell) = families.step(origin, ray) {
            visitor.visit(cell, place);
        }
        visits += ray.steps;
    }
    visits
}
