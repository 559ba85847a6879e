//! Surfaces on which a robot has room to all sides.

use super::options::GroundOptions;
use super::surface_graph::{CORNERS, EDGES, SurfaceGraph};
use super::surface_steps::{Place, Steps};

/// Smallest distance that counts as room, cells: a surface beside a cell without one is never passed.
const MIN_ROOM_CELLS: f64 = 0.75;
/// Part of a radius that rounding may take: grids have resolutions of single precision.
const SLACK: f64 = 1e-6;

/// Cell without a surface that is linked with one beside it: an obstacle, a drop, or ground that was not seen.
struct Border {
    /// Column and row, counted from that of the first cell; may be outside of the grid.
    at: [i32; 2],
    beside: Place,
}

/// Nodes of ground whose cell has its centre at least `radius_m` from each cell without ground, as far as surfaces within
/// that distance lead there; `None` once `go_on` returns false.
pub(super) fn open_nodes(
    graph: &SurfaceGraph,
    ground: &GroundOptions,
    radius_m: f64,
    mut go_on: impl FnMut() -> bool,
) -> Option<Vec<bool>> {
    let steps = Steps {
        graph,
        ground,
        open: &[],
    };
    let is_ground = graph.is_ground();
    let mut open = vec![false; graph.at_m.len()];
    let mut borders = Vec::new();
    for cell in 0..graph.grid.cells.len() {
        for node in graph.of_cell(cell) {
            if !is_ground(graph.component_of(node)) {
                continue;
            }
            if let (Some(place), Some(open)) = (Place::new(cell, node), open.get_mut(node)) {
                *open = true;
                borders.extend(borders_of(&steps, place));
            }
        }
    }
    borders.sort_unstable_by_key(|border| (border.at, border.beside));
    let room_m = radius_m.max(MIN_ROOM_CELLS * graph.grid.resolution_m) * (1.0 - SLACK);
    let mut search = Search {
        steps,
        room_m,
        seen: vec![0; graph.at_m.len()],
    };
    for (borders, number) in borders.chunk_by(|a, b| a.at == b.at).zip(1..) {
        if !go_on() {
            return None;
        }
        search.close(borders, number, &mut open);
    }
    Some(open)
}

fn borders_of<'a>(steps: &'a Steps<'_>, place: Place) -> impl Iterator<Item = Border> + 'a {
    let [x, y] = steps.column(place);
    let over = move |first, second| {
        let between = steps.edge(place, first);
        between.is_some_and(|between| steps.edge(between, second).is_some())
    };
    let edges = EDGES
        .into_iter()
        .filter(move |step| steps.edge(place, *step).is_none());
    let is_closed =
        move |[dx, dy]: &[i32; 2]| !over([*dx, 0], [0, *dy]) && !over([0, *dy], [*dx, 0]);
    edges
        .chain(CORNERS.into_iter().filter(is_closed))
        .map(move |[dx, dy]| Border {
            at: [x + dx, y + dy],
            beside: place,
        })
}

/// Search for the surfaces near a cell without ground.
struct Search<'a> {
    steps: Steps<'a>,
    room_m: f64,
    /// Number of the last cell without ground from which each node was seen.
    seen: Vec<u32>,
}

impl Search<'_> {
    /// Distance from the centre of a cell to a square, metres.
    fn away_m(&self, place: Place, [x, y]: [i32; 2]) -> f64 {
        let column = self.steps.column(place);
        let apart = |a: i32, b: i32| (f64::from(a.abs_diff(b)) - 0.5).max(0.0);
        apart(column[0], x).hypot(apart(column[1], y)) * self.steps.graph.grid.resolution_m
    }

    /// Closes the nodes near a cell without ground, from those beside it on.
    fn close(&mut self, borders: &[Border], number: u32, open: &mut [bool]) {
        let mut waiting: Vec<Place> = borders.iter().map(|border| border.beside).collect();
        let Some(at) = borders.first().map(|border| border.at) else {
            return;
        };
        while let Some(place) = waiting.pop() {
            let is_near = self.away_m(place, at) < self.room_m;
            let seen = self.seen.get_mut(place.node as usize);
            let Some(seen) = seen.filter(|seen| is_near && **seen != number) else {
                continue;
            };
            *seen = number;
            if let Some(open) = open.get_mut(place.node as usize) {
                *open = false;
            }
            waiting.extend(
                EDGES
                    .into_iter()
                    .filter_map(|step| self.steps.edge(place, step)),
            );
        }
    }
}
