//! A* (Hart, Nilsson & Raphael 1968) over surfaces in eight directions.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::ground_path_error::GroundPathError;
use super::surface_graph::{CORNERS, EDGES};
use super::surface_steps::{Place, Steps};

/// A way to a place; the shortest estimate is the greatest.
struct Way {
    estimate_m: f64,
    length_m: f64,
    at: Place,
}

impl Ord for Way {
    fn cmp(&self, other: &Way) -> Ordering {
        let estimates = other.estimate_m.total_cmp(&self.estimate_m);
        // Of equal estimates the one that is nearer to the goal.
        let lengths = || self.length_m.total_cmp(&other.length_m);
        estimates
            .then_with(lengths)
            .then_with(|| other.at.cmp(&self.at))
    }
}

impl PartialOrd for Way {
    fn partial_cmp(&self, other: &Way) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Way {
    fn eq(&self, other: &Way) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Way {}

/// Length of the shortest way to a node, and the place before it there.
#[derive(Clone, Copy)]
struct Known {
    length_m: f64,
    before: Place,
}

/// Length of a step, metres.
pub(super) fn step_m(steps: &Steps<'_>, from: Place, to: Place) -> f64 {
    (steps.point_m(to) - steps.point_m(from)).norm()
}

/// Lower bound on the length of ways in eight directions, metres.
fn bound_m(steps: &Steps<'_>, from: Place, to: Place) -> f64 {
    let ([x0, y0], [x1, y1]) = (steps.column(from), steps.column(to));
    let [dx, dy] = [x0.abs_diff(x1), y0.abs_diff(y1)].map(f64::from);
    let cells = dx.max(dy) + (std::f64::consts::SQRT_2 - 1.0) * dx.min(dy);
    let rise_m = steps.point_m(to).z - steps.point_m(from).z;
    (cells * steps.graph.grid.resolution_m).hypot(rise_m)
}

/// State of a search.
struct Search<'a> {
    steps: &'a Steps<'a>,
    goal: Place,
    known: Vec<Option<Known>>,
    waiting: BinaryHeap<Way>,
}

impl Search<'_> {
    fn reach(&mut self, before: Place, at: Place, length_m: f64) {
        let Some(known) = self.known.get_mut(at.node as usize) else {
            return;
        };
        if known.is_none_or(|known| length_m < known.length_m) {
            *known = Some(Known { length_m, before });
            self.waiting.push(Way {
                estimate_m: length_m + bound_m(self.steps, at, self.goal),
                length_m,
                at,
            });
        }
    }

    fn way_from(&self, start: Place) -> Vec<Place> {
        let (mut way, mut at) = (vec![self.goal], self.goal);
        while at != start {
            let Some(Some(Known { before, .. })) = self.known.get(at.node as usize) else {
                break;
            };
            at = *before;
            way.push(at);
        }
        way.reverse();
        way
    }
}

/// Finds the shortest way from place to place, and the number of expanded places.
pub(super) fn search(
    steps: &Steps<'_>,
    [start, goal]: [Place; 2],
    max_expanded: usize,
    mut go_on: impl FnMut() -> bool,
) -> Result<(Vec<Place>, usize), GroundPathError> {
    let nodes = steps.graph.at_m.len();
    let mut search = Search {
        steps,
        goal,
        known: vec![None; nodes],
        waiting: BinaryHeap::new(),
    };
    let mut done = vec![false; nodes];
    let mut expanded = 0;
    search.reach(start, start, 0.0);
    while let Some(Way { at, length_m, .. }) = search.waiting.pop() {
        let Some(done) = done.get_mut(at.node as usize).filter(|done| !**done) else {
            continue;
        };
        if at == goal {
            return Ok((search.way_from(start), expanded));
        }
        if expanded >= max_expanded || !go_on() {
            return Err(GroundPathError::Limit { expanded });
        }
        *done = true;
        expanded += 1;
        let edges = EDGES.into_iter().filter_map(|step| steps.edge(at, step));
        let corners = CORNERS
            .into_iter()
            .filter_map(|step| steps.corner(at, step));
        for to in edges.chain(corners) {
            search.reach(at, to, length_m + step_m(steps, at, to));
        }
    }
    Err(GroundPathError::NoWay { expanded })
}
