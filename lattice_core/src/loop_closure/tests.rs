use nalgebra::{DMatrix, Isometry3, Matrix6, Vector3, Vector6};
use proptest::prelude::*;

use super::*;
use crate::odometry::{ScanResult, Verdict};
use crate::pose::se3;

/// Numbers from -1 to 1 that follow from a seed.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

fn twist(noise: &mut impl FnMut() -> f64, m: f64, rad: f64) -> Vector6<f64> {
    let mut next = |scale: f64| scale * noise();
    Vector6::new(next(m), next(m), next(m), next(rad), next(rad), next(rad))
}

fn covariance(m: f64, rad: f64) -> Matrix6<f64> {
    let (m, rad) = (m * m, rad * rad);
    Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad))
}

/// True poses around a square, a graph of noisy motions along them, and its loops.
fn square(nodes: usize, loops: &[(usize, usize)], seed: u64) -> (Vec<Isometry3<f64>>, PoseGraph) {
    let noise = &mut noise(seed);
    let side = nodes / 4;
    let mut pose = Isometry3::identity();
    let mut truth = Vec::new();
    for node in 0..nodes {
        truth.push(pose);
        let turn = if node % side == side - 1 { 1.5 } else { 0.05 };
        pose *= Isometry3::new(Vector3::new(5.0, 0.1, 0.05), Vector3::new(0.01, 0.02, turn));
    }
    let mut graph = PoseGraph::default();
    graph.push(truth[0], Matrix6::zeros());
    for pair in truth.windows(2) {
        let spread = (0.02 + 0.05 * noise().abs(), 0.002 + 0.005 * noise().abs());
        let error = se3::exp(&twist(noise, 1.7 * spread.0, 1.7 * spread.1));
        let motion = error * pair[0].inverse() * pair[1];
        graph.push(motion, covariance(spread.0, spread.1));
    }
    for (from, to) in loops {
        let error = se3::exp(&twist(noise, 0.02, 0.002));
        graph.close(LoopEdge {
            from: *from,
            to: *to,
            from_to: error * truth[*from].inverse() * truth[*to],
            covariance: covariance(0.015, 0.0015),
        });
    }
    (truth, graph)
}

/// Half the squared errors of all motions and loops, each whitened by its covariance, at poses.
fn cost(
    graph: &PoseGraph,
    motions: &[(Isometry3<f64>, Matrix6<f64>)],
    poses: &[Isometry3<f64>],
) -> f64 {
    let square = |error: Vector6<f64>, covariance: &Matrix6<f64>| {
        error.dot(&(covariance.try_inverse().unwrap() * error))
    };
    let along = motions
        .iter()
        .zip(poses.windows(2))
        .map(|((motion, covariance), pair)| {
            square(
                se3::log(&(pair[0].inverse() * pair[1] * motion.inverse())),
                covariance,
            )
        });
    let loops = graph.loops().iter().map(|edge| {
        let found = poses[edge.from].inverse() * poses[edge.to];
        square(
            se3::log(&(found * edge.from_to.inverse())),
            &edge.covariance,
        )
    });
    0.5 * (along.sum::<f64>() + loops.sum::<f64>())
}

#[test]
fn the_poses_are_those_of_the_least_squares() {
    for seed in 1..6 {
        let loops = [(0, 36), (2, 38), (5, 22), (1, 39)];
        let (_, mut graph) = square(40, &loops, seed);
        let motions = graph.motions().to_vec();
        let begun = cost(&graph, &motions, graph.poses());
        assert!(graph.optimize());
        let poses = graph.poses().to_vec();
        let least = cost(&graph, &motions, &poses);
        assert!(least < 0.5 * begun, "{least} {begun}");
        // No pose can be moved to a lower cost: the gradient is small against what a step of one deviation costs.
        for node in [1, 7, 20, 39] {
            for axis in 0..6 {
                let step = if axis < 3 { 1e-4 } else { 1e-5 };
                let mut change = Vector6::zeros();
                change[axis] = step;
                let moved = |sign: f64| {
                    let mut poses = poses.clone();
                    poses[node] *= se3::exp(&(sign * change));
                    cost(&graph, &motions, &poses)
                };
                let (up, down) = (moved(1.0) - least, moved(-1.0) - least);
                let (slope, bend) = ((up - down) / 2.0, (up + down) / 2.0);
                assert!(bend > 0.0, "{bend}");
                // Distance to the minimum along the axis, in deviations of the node between its neighbours.
                let away = slope.abs() / (2.0 * bend).sqrt();
                assert!(away < 0.02, "seed {seed} node {node} axis {axis}: {away}");
            }
        }
    }
}

#[test]
fn loops_that_come_one_by_one_give_the_poses_of_all_at_once() {
    let loops = [(0, 36), (2, 38), (5, 22), (1, 39)];
    let (_, mut together) = square(40, &loops, 3);
    together.optimize();
    let (_, mut after) = square(40, &[], 3);
    for edge in together.loops() {
        after.close(edge.clone());
        after.optimize();
    }
    for (a, b) in together.poses().iter().zip(after.poses()) {
        let apart = se3::log(&(a.inverse() * b));
        assert!(apart.amax() < 1e-3, "{apart}");
    }
}

#[test]
fn covariances_between_nodes_are_those_of_the_information_matrix() {
    let (_, mut graph) = square(24, &[(0, 20), (3, 15)], 4);
    graph.optimize();
    let (pose, found) = graph.relative(2, 18).unwrap();
    assert_eq!(pose, graph.poses()[2].inverse() * graph.poses()[18]);
    // Unknowns: twists in the map of all nodes but the first.
    let nodes = graph.poses().len();
    let mut information = DMatrix::<f64>::zeros(6 * nodes, 6 * nodes);
    let mut add = |from: usize, to: usize, covariance: Matrix6<f64>| {
        let inverse = covariance.try_inverse().unwrap();
        for (row, a) in [(from, -1.0), (to, 1.0)] {
            for (column, b) in [(from, -1.0), (to, 1.0)] {
                let mut view = information.view_mut((6 * row, 6 * column), (6, 6));
                view += inverse * (a * b);
            }
        }
    };
    let in_map = |node: usize, covariance: &Matrix6<f64>| {
        let adjoint = se3::adjoint(&graph.poses()[node]);
        adjoint * covariance * adjoint.transpose()
    };
    for (node, (_, covariance)) in graph.motions().iter().enumerate() {
        add(node, node + 1, in_map(node, covariance));
    }
    for edge in graph.loops() {
        add(edge.from, edge.to, in_map(edge.from, &edge.covariance));
    }
    let free = information
        .view((6, 6), (6 * nodes - 6, 6 * nodes - 6))
        .into_owned();
    let all = free.try_inverse().unwrap();
    let block = |a: usize, b: usize| all.view((6 * a - 6, 6 * b - 6), (6, 6)).into_owned();
    let between = block(2, 2) + block(18, 18) - block(2, 18) - block(18, 2);
    let adjoint = se3::adjoint(&graph.poses()[2].inverse());
    let expected = adjoint * between * adjoint.transpose();
    let scale = expected.diagonal().map(f64::sqrt);
    for i in 0..6 {
        for j in 0..6 {
            let apart = (found[(i, j)] - expected[(i, j)]) / (scale[i] * scale[j]);
            assert!(apart.abs() < 0.02, "{i} {j}: {apart}");
        }
    }
}

#[test]
fn a_loop_that_contradicts_the_motions_has_a_large_innovation() {
    let (truth, mut graph) = square(40, &[(0, 36), (2, 38)], 5);
    graph.optimize();
    let edge = |from_to| LoopEdge {
        from: 4,
        to: 30,
        from_to,
        covariance: covariance(0.015, 0.0015),
    };
    let right = truth[4].inverse() * truth[30];
    let wrong = right * Isometry3::translation(3.0, 0.0, 0.0);
    assert!(graph.innovation(&edge(right)) < 30.0);
    assert!(graph.innovation(&edge(wrong)) > 100.0);
    let unknown = LoopEdge {
        to: 99,
        ..edge(right)
    };
    assert_eq!(graph.innovation(&unknown), f64::INFINITY);
    graph.close(unknown);
    assert_eq!(graph.loops().len(), 2);
}

#[test]
fn a_graph_without_loops_keeps_its_poses() {
    let (_, mut graph) = square(12, &[], 6);
    let before = graph.poses().to_vec();
    assert!(graph.optimize());
    assert_eq!(before, graph.poses());
    assert!(PoseGraph::default().optimize());
    assert!(PoseGraph::default().relative(0, 1).is_none());
}

proptest! {
    #[test]
    fn a_look_up_finds_what_all_distances_find(seed in 0u64..1000, radius_m in 0.5..20.0f64) {
        let noise = &mut noise(seed);
        let mut place = || Vector3::new(50.0 * noise(), 50.0 * noise(), 5.0 * noise());
        let mut history = PlaceHistory::new(radius_m).unwrap();
        let places: Vec<_> = (0..300).map(|_| place()).collect();
        for (number, place_m) in places.iter().enumerate() {
            history.add(number as u32, place_m);
        }
        let at_m = place();
        let near: BTreeSet<u32> = history.near(&at_m).iter().map(|(number, _)| *number).collect();
        let all = (0..).zip(&places).filter(|(_, place_m)| (*place_m - at_m).norm() <= radius_m);
        prop_assert_eq!(history.cells_visited(), 87);
        prop_assert_eq!(near, all.map(|(number, _)| number).collect::<BTreeSet<u32>>());
    }
}

/// Points on the walls of a hall with pillars at places that do not repeat, in the frame of a lidar.
fn scan_of_hall(map_from_lidar: &Isometry3<f64>) -> Vec<Vector3<f64>> {
    let mut points = Vec::new();
    let eye = map_from_lidar.inverse();
    let mut wall = |from: Vector3<f64>, to: Vector3<f64>| {
        let length = (to - from).norm();
        for i in 0..(length / 0.25) as usize {
            for j in 0..12 {
                let along = from + (to - from) * (0.25 * i as f64 / length);
                let place = along + Vector3::z() * (0.25 * f64::from(j));
                points.push((eye * nalgebra::Point3::from(place)).coords);
            }
        }
    };
    let corner = |x: f64, y: f64| Vector3::new(x, y, 0.0);
    let corners = [
        corner(-12.0, -9.0),
        corner(12.0, -9.0),
        corner(12.0, 9.0),
        corner(-12.0, 9.0),
    ];
    for i in 0..4 {
        wall(corners[i], corners[(i + 1) % 4]);
    }
    let pillars = [
        (-7.0, -6.5),
        (-1.5, -7.0),
        (6.0, -5.5),
        (8.5, 1.0),
        (5.5, 7.0),
        (-3.0, 6.0),
        (-9.0, 3.0),
    ];
    for (i, (x, y)) in pillars.into_iter().enumerate() {
        let half = 0.4 + 0.1 * i as f64;
        let corners = [
            corner(x - half, y - half),
            corner(x + half, y - half),
            corner(x + half, y + half),
            corner(x - half, y + half),
        ];
        for k in 0..4 {
            wall(corners[k], corners[(k + 1) % 4]);
        }
    }
    points
}

/// A scan's result with a drift.
fn result_at(
    odom_from_base: Isometry3<f64>,
    number: u32,
    submap: u32,
    drift: Matrix6<f64>,
) -> ScanResult {
    ScanResult {
        first_ns: i64::from(number) * 100_000_000,
        odom_from_first: odom_from_base,
        end_ns: i64::from(number) * 100_000_000,
        odom_from_base,
        covariance: drift,
        drift,
        verdict: Verdict::Ok,
        submap,
        overlap: 1.0,
        points: 1000,
        contrast: 100.0,
    }
}

/// Drives twice around the hall with a drift in heading; gives the closer and the error between the
/// ends of the last loop by odometry and corrected, m.
fn drive(submap_of: impl Fn(u32) -> u32) -> (LoopCloser, f64, f64) {
    let (mut cutter, mut closer) = (SegmentCutter::default(), LoopCloser::default());
    let noise = &mut noise(8);
    let mut odom = Isometry3::identity();
    let mut last = None;
    let mut all = Vec::new();
    let mut spread = Matrix6::zeros();
    for number in 0..400 {
        let angle = 0.05 * f64::from(number);
        let place = Vector3::new(9.0 * angle.cos() * 0.5, 6.0 * angle.sin() * 0.5, 0.0);
        let truth = Isometry3::new(place, Vector3::z() * (angle + 1.57));
        if let Some(last) = last.replace(truth) {
            let drift = se3::exp(&twist(noise, 0.017, 0.005));
            odom = odom * (last.inverse() * truth) * drift;
        }
        let place_m = odom.translation.vector;
        spread += segment::about_origin(&covariance(0.01, 0.003), &place_m);
        let drift = segment::about_origin(&spread, &-place_m);
        let result = result_at(odom, number, submap_of(number), drift);
        let ended = cutter.add(&result, &scan_of_hall(&truth), 0.3).unwrap();
        ended.map(|segment| closer.add(segment).unwrap().cloned());
        all.push((result, truth));
    }
    let last = cutter.finish();
    last.map(|segment| closer.add(segment).unwrap().cloned());
    // Between both ends of the last loop.
    let mut closed = closer.attempts().iter().filter(|attempt| attempt.is_closed);
    let Some(ends_ns) = closed.next_back().map(|attempt| attempt.stamps_ns) else {
        return (closer, 0.0, f64::INFINITY);
    };
    let ends = ends_ns.map(|stamp_ns| {
        all.iter()
            .find(|(result, _)| result.end_ns == stamp_ns)
            .unwrap()
    });
    let truth = ends[0].1.inverse() * ends[1].1;
    let error = |of: &dyn Fn(&ScanResult) -> Isometry3<f64>| {
        let found = of(&ends[0].0).inverse() * of(&ends[1].0);
        (found.translation.vector - truth.translation.vector).norm()
    };
    let before_m = error(&|result| result.odom_from_base);
    let corrections = closer.corrections();
    let after_m = error(&|result| corrections.map_from_base(result));
    (closer, before_m, after_m)
}

#[test]
fn a_drive_that_comes_back_is_corrected() {
    let (closer, before_m, after_m) = drive(|_| 0);
    let closed = closer.attempts().iter().filter(|attempt| attempt.is_closed);
    assert!(closed.count() > 0, "{:?}", closer.attempts());
    assert!(
        before_m > 0.2 && after_m < 0.5 * before_m,
        "{before_m} {after_m}"
    );
}

#[test]
fn submaps_are_joined_by_a_loop() {
    let (closer, _, _) = drive(|number| u32::from(number > 200));
    assert_eq!(
        closer.joined_with(0),
        BTreeSet::from([0, 1]),
        "{:?}",
        closer.attempts()
    );
    let none = LoopCloser::default();
    assert_eq!(none.joined_with(3), BTreeSet::from([3]));
    assert_eq!(none.corrections().at(5), None);
}

#[test]
fn corrections_end_with_their_submap() {
    let (closer, _, _) = drive(|number| u32::from(number > 200));
    let corrections = closer.corrections();
    let of = |number: i64| corrections.at(number * 100_000_000).unwrap().submap;
    let submaps: Vec<u32> = (0..400).map(of).collect();
    assert_eq!(submaps.iter().filter(|submap| **submap == 0).count(), 201);
    assert!(submaps.is_sorted());
    // The last scan of a submap has its last correction, not a part of the next one's.
    let anchors = corrections.anchors();
    let end = anchors.iter().rfind(|anchor| anchor.submap == 0).unwrap();
    let (last, at_end) = (end.map_from_odom, corrections.at(end.stamp_ns).unwrap());
    assert_eq!((end.stamp_ns, at_end.map_from_odom), (20_000_000_000, last));
    // Between two anchors lies a part of both, before and behind all of them the nearest.
    let (first, second) = (&anchors[0], &anchors[1]);
    let middle = corrections.at((first.stamp_ns + second.stamp_ns) / 2);
    let halves = [first, second].map(|anchor| anchor.map_from_odom.translation.vector);
    let apart = middle.unwrap().map_from_odom.translation.vector - (halves[0] + halves[1]) * 0.5;
    assert!(apart.norm() < 0.05 * (halves[1] - halves[0]).norm() + 1e-9);
    for (stamp_ns, nearest) in [(i64::MIN, first), (i64::MAX, &anchors[anchors.len() - 1])] {
        let found = corrections.at(stamp_ns).unwrap();
        assert_eq!(found.map_from_odom, nearest.map_from_odom);
    }
}
