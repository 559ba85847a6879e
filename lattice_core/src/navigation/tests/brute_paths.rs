//! Paths on the ground against brute force on small terrains.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::super::robot_room::open_nodes;
use super::super::surface_graph::{CORNERS, EDGES, SurfaceGraph};
use super::super::surface_steps::{Place, Steps};
use super::super::surfaces::Surface;
use super::super::{ground_search, path_points};
use super::world::Random;
use super::*;

const RESOLUTION_M: f64 = 0.25;

/// Graph of random steps, holes, curbs and upper floors.
fn terrain(random: &mut Random, side: i32) -> SurfaceGraph {
    let mut states = Tiles::default();
    for (x, y) in (0..side).flat_map(|x| (0..side).map(move |y| (x, y))) {
        let heights_m: &[f64] = match random.next() {
            hole if hole < 0.12 => &[],
            curb if curb < 0.2 => &[0.4],
            raised if raised < 0.4 => &[0.06],
            ramp if ramp < 0.5 => &[0.15],
            bridge if bridge < 0.6 => &[0.0, 2.0],
            _ => &[0.0],
        };
        let surface = |z: &f64| Surface {
            at_m: Vector3::new(
                (f64::from(x) + 0.5) * RESOLUTION_M,
                (f64::from(y) + 0.5) * RESOLUTION_M,
                z + 0.02 * random.next(),
            ),
            slope: 0.0,
            step_m: 0.0,
            clearance_m: f64::INFINITY,
            is_standable: true,
        };
        let surfaces = heights_m.iter().map(surface).collect();
        let tall_m = Vec::new();
        states.set([x, y], Some(ColumnState { surfaces, tall_m }));
    }
    SurfaceGraph::new(&states, RESOLUTION_M, &GroundOptions::default()).unwrap()
}

/// Column and height of each node, with all rules written anew.
struct Brute {
    nodes: Vec<([i32; 2], f64)>,
    open: Vec<bool>,
}

impl Brute {
    fn new(graph: &SurfaceGraph, radius_m: f64) -> Brute {
        let width = graph.grid.width;
        let cells = 0..graph.grid.cells.len();
        let column = |cell: usize| [(cell % width) as i32, (cell / width) as i32];
        let nodes = cells.flat_map(|cell| {
            graph
                .of_cell(cell)
                .map(move |node| (column(cell), graph.at_m[node].z))
        });
        let mut brute = Brute {
            nodes: nodes.collect(),
            open: Vec::new(),
        };
        let is_ground = graph.is_ground();
        let ground = (0..brute.nodes.len()).filter(|node| is_ground(graph.component_of(*node)));
        let ground: Vec<usize> = ground.collect();
        let mut open = vec![false; brute.nodes.len()];
        ground.iter().for_each(|node| open[*node] = true);
        for border in &ground {
            for at in brute.closed_beside(*border) {
                brute
                    .near(*border, at, radius_m)
                    .into_iter()
                    .for_each(|node| open[node] = false);
            }
        }
        brute.open = open;
        brute
    }

    fn edge(&self, from: usize, [dx, dy]: [i32; 2]) -> Option<usize> {
        let ([x, y], z) = self.nodes[from];
        let most_m = 0.1 + 20.0_f64.to_radians().tan() * RESOLUTION_M;
        let linked = (0..self.nodes.len()).filter(|to| {
            self.nodes[*to].0 == [x + dx, y + dy] && (self.nodes[*to].1 - z).abs() <= most_m
        });
        linked.min_by(|a, b| {
            (self.nodes[*a].1 - z)
                .abs()
                .total_cmp(&(self.nodes[*b].1 - z).abs())
        })
    }

    fn closed_beside(&self, node: usize) -> Vec<[i32; 2]> {
        let [x, y] = self.nodes[node].0;
        let over = |a, b| {
            self.edge(node, a)
                .and_then(|between| self.edge(between, b))
                .is_some()
        };
        let all = EDGES.into_iter().chain(CORNERS);
        let closed = all.filter(|[dx, dy]| match *dx == 0 || *dy == 0 {
            true => self.edge(node, [*dx, *dy]).is_none(),
            false => !over([*dx, 0], [0, *dy]) && !over([0, *dy], [*dx, 0]),
        });
        closed.map(|[dx, dy]| [x + dx, y + dy]).collect()
    }

    /// Nodes within the radius of a cell, linked with one beside it over such nodes.
    fn near(&self, beside: usize, at: [i32; 2], radius_m: f64) -> BTreeSet<usize> {
        let is_near = |node: usize| {
            let [x, y] = self.nodes[node].0;
            let apart = |a: i32, b: i32| (f64::from((a - b).abs()) - 0.5).max(0.0) * RESOLUTION_M;
            let room_m = radius_m.max(0.75 * RESOLUTION_M);
            apart(x, at[0]).hypot(apart(y, at[1])) < room_m - 1e-6
        };
        let mut found = BTreeSet::from([beside]);
        loop {
            let more: Vec<usize> = found
                .iter()
                .flat_map(|node| EDGES.into_iter().filter_map(|step| self.edge(*node, step)))
                .filter(|node| is_near(*node) && !found.contains(node))
                .collect();
            if more.is_empty() {
                return found;
            }
            found.extend(more);
        }
    }

    /// Lengths of the shortest ways from a node, by repetition until nothing changes.
    fn lengths_m(&self, start: usize) -> Vec<f64> {
        let open = |node: &usize| self.open[*node];
        let step = |from, step| self.edge(from, step).filter(open);
        let corner = |from, [dx, dy]: [i32; 2]| {
            let a = step(step(from, [dx, 0])?, [0, dy])?;
            let b = step(step(from, [0, dy])?, [dx, 0])?;
            (a == b).then_some(a)
        };
        let at_m = |node: usize| {
            let ([x, y], z) = self.nodes[node];
            Vector3::new(f64::from(x) * RESOLUTION_M, f64::from(y) * RESOLUTION_M, z)
        };
        let mut lengths_m = vec![f64::INFINITY; self.nodes.len()];
        lengths_m[start] = 0.0;
        loop {
            let before = lengths_m.clone();
            for from in (0..self.nodes.len()).filter(open) {
                let edges = EDGES.into_iter().filter_map(|dir| step(from, dir));
                for to in edges.chain(CORNERS.into_iter().filter_map(|dir| corner(from, dir))) {
                    let length_m = lengths_m[from] + (at_m(to) - at_m(from)).norm();
                    lengths_m[to] = lengths_m[to].min(length_m);
                }
            }
            if before == lengths_m {
                return lengths_m;
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_shortest_path_is_that_of_brute_force(seed in any::<u64>(), radius in 0_u8..4) {
        let mut random = Random(seed);
        let graph = terrain(&mut random, 14);
        let radius_m = 0.17 * f64::from(radius);
        let brute = Brute::new(&graph, radius_m);
        let ground = GroundOptions::default();
        let open = open_nodes(&graph, &ground, radius_m, || true).unwrap();
        prop_assert_eq!(&open, &brute.open);
        let steps = Steps { graph: &graph, ground: &ground, open: &open };
        let cells = 0..graph.grid.cells.len();
        let places = cells.flat_map(|cell| graph.of_cell(cell).map(move |node| Place::new(cell, node)));
        let places: Vec<Place> = places.flatten().filter(|at| open[at.node as usize]).collect();
        let Some(start) = places.get((random.next() * places.len() as f64) as usize) else {
            return Ok(());
        };
        let lengths_m = brute.lengths_m(start.node as usize);
        for goal in &places {
            let found = ground_search::search(&steps, [*start, *goal], usize::MAX, || true);
            let expected_m = lengths_m[goal.node as usize];
            let Ok((way, expanded)) = found else {
                prop_assert!(expected_m.is_infinite(), "{:?}", found);
                continue;
            };
            let length = |way: &[Place]| -> f64 {
                way.windows(2).map(|pair| ground_search::step_m(&steps, pair[0], pair[1])).sum()
            };
            prop_assert!((length(&way) - expected_m).abs() < 1e-9 && expanded <= places.len());
            // Corners are no longer, and every point of their lines is on open surfaces.
            let corners = path_points::corners(&steps, &way, || true).unwrap();
            prop_assert!(length(&corners) <= expected_m + 1e-9);
            prop_assert_eq!((corners[0], corners.last()), (*start, Some(goal)));
            for pair in corners.windows(2) {
                let line = steps.line(pair[0], pair[1]).unwrap();
                let touched: BTreeSet<[i32; 2]> = line.iter().chain([&pair[0]]).map(|at| steps.column(*at)).collect();
                let columns = [pair[0], pair[1]].map(|at| steps.column(at).map(f64::from));
                for i in 0..=997 {
                    let part = f64::from(i) / 997.0;
                    let at = [0, 1].map(|axis| {
                        let [a, b] = [columns[0][axis], columns[1][axis]];
                        (a + part * (b - a) + 0.5).floor() as i32
                    });
                    prop_assert!(touched.contains(&at), "{:?} of {:?}", at, touched);
                }
                prop_assert!(line.iter().all(|at| brute.open[at.node as usize]));
            }
            let points = path_points::points(&steps, &corners);
            let apart_m = |pair: &[Vector3<f64>]| (pair[1] - pair[0]).xy().norm();
            prop_assert!(points.windows(2).all(|pair| apart_m(pair) < 1.5 * RESOLUTION_M));
            for point_m in &points {
                let is_below = |at: &Place| {
                    let away = steps.point_m(*at) - point_m;
                    away.xy().amax() <= 0.5 * RESOLUTION_M + 1e-9 && away.z.abs() < 1e-9
                };
                prop_assert!(places.iter().any(is_below), "{point_m}");
            }
        }
    }
}
