//! A chain of poses with loop closures, optimized exactly.
//!
//! Twists are (translation m, rotation rad) in the axes and about the origin of the map; a pose is perturbed from the
//! left, `exp(twist) * map_from_node`. In a chain the covariance between two nodes is the sum of those of the motions
//! between them. One step of Gauss-Newton is then a dense system in the loop closures alone, with sums over shared
//! intervals as its blocks (the dual of the least squares; Barfoot, State Estimation for Robotics, section 3.3).

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Isometry3, Matrix6, Vector6};

use crate::pose::se3;

/// Iteration limit of an optimization; a loop with a quarter turn takes six.
const MAX_ITERATIONS: usize = 30;
/// Change of poses below which an optimization ends, m and rad.
const CONVERGED: f64 = 1e-6;
/// Change of poses since a linearization above which it is recomputed, m and rad: covariances rotate with the poses.
const STALE: (f64, f64) = (0.5, 0.01);

/// Edge: measured pose of a node in the frame of an earlier one.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopEdge {
    /// Number of the earlier node.
    pub from: usize,
    /// Number of the later node.
    pub to: usize,
    /// Pose of the later node in the frame of the earlier one.
    pub from_to: Isometry3<f64>,
    /// Covariance of its twist in the frame of the earlier node.
    pub covariance: Matrix6<f64>,
}

impl LoopEdge {
    /// Numbers of both nodes.
    fn span(&self) -> Range<usize> {
        self.from..self.to
    }
}

/// Pose graph of a path: nodes in order of time, each with the motion from the one before, and loop closures.
#[derive(Clone, Debug, Default)]
pub struct PoseGraph {
    map_from_nodes: Vec<Isometry3<f64>>,
    /// Motion from each node to the next one, and the covariance of its twist in the frame of the node.
    motions: Vec<(Isometry3<f64>, Matrix6<f64>)>,
    loops: Vec<LoopEdge>,
    /// Linearization at the poses of the last optimization.
    solved: Option<Linearization>,
}

/// Sums along the path and the linear system of the loop closures, at given poses.
#[derive(Clone, Debug)]
struct Linearization {
    /// Covariance of each node relative to the first one.
    covariances: Vec<Matrix6<f64>>,
    /// Joint innovation covariance of all loop closures.
    system: Option<Cholesky<f64, Dyn>>,
    /// Largest change of a pose since the linearization, m and rad.
    changed: (f64, f64),
}

impl PoseGraph {
    /// Adds a node. `motion` leads from the last node to it, with the covariance of its twist in the frame of the
    /// last node; for the first node, `motion` is its pose.
    pub fn push(&mut self, motion: Isometry3<f64>, covariance: Matrix6<f64>) {
        match self.map_from_nodes.last() {
            None => self.map_from_nodes.push(motion),
            Some(last) => {
                let pose = last * motion;
                let added = self.in_map(self.map_from_nodes.len() - 1, &covariance);
                self.map_from_nodes.push(pose);
                self.motions.push((motion, covariance));
                if let Some(solved) = &mut self.solved {
                    let before = solved.covariances.last().copied();
                    let sum = before.unwrap_or_else(Matrix6::zeros) + added;
                    solved.covariances.push(sum);
                }
            }
        }
    }

    /// Poses of the nodes in the map.
    pub fn poses(&self) -> &[Isometry3<f64>] {
        &self.map_from_nodes
    }

    /// Motion from each node to the next one, and the covariance of its twist in the frame of the node.
    pub fn motions(&self) -> &[(Isometry3<f64>, Matrix6<f64>)] {
        &self.motions
    }

    /// Loop closures.
    pub fn loops(&self) -> &[LoopEdge] {
        &self.loops
    }

    /// Pose of a later node in the frame of an earlier one, with the covariance of its twist there; `None` if there is no such
    /// node or the graph has no solution.
    pub fn relative(&mut self, from: usize, to: usize) -> Option<(Isometry3<f64>, Matrix6<f64>)> {
        let (earlier, later) = (
            *self.map_from_nodes.get(from)?,
            *self.map_from_nodes.get(to)?,
        );
        let loops = self.loops.len();
        if self.solved.is_none() {
            self.solved = Some(self.linearize());
        }
        let solved = self.solved.as_ref()?;
        let mut covariance = solved.between(&(from..to));
        if let Some(system) = &solved.system {
            let mut shared = DMatrix::zeros(6 * loops, 6);
            for (row, edge) in self.loops.iter().enumerate() {
                let block = solved.between(&overlap(&edge.span(), &(from..to)));
                shared.view_mut((6 * row, 0), (6, 6)).copy_from(&block);
            }
            let gained = shared.transpose() * system.solve(&shared);
            covariance -= gained.fixed_view::<6, 6>(0, 0);
        }
        let to_local = se3::adjoint(&earlier.inverse());
        let covariance = to_local * covariance * to_local.transpose();
        Some((earlier.inverse() * later, covariance))
    }

    /// Squared Mahalanobis distance of a measurement from the graph without it, with 6 degrees of freedom if all
    /// covariances are right. `INFINITY` if a node does not exist.
    pub fn innovation(&mut self, edge: &LoopEdge) -> f64 {
        let Some((predicted, covariance)) = self.relative(edge.from, edge.to) else {
            return f64::INFINITY;
        };
        let residual = se3::log(&(edge.from_to * predicted.inverse()));
        let total = covariance + edge.covariance;
        total
            .cholesky()
            .map_or(f64::INFINITY, |total| residual.dot(&total.solve(&residual)))
    }

    /// Adds a loop closure. An edge between nodes that do not exist in this order is ignored.
    pub fn close(&mut self, edge: LoopEdge) {
        if edge.from >= edge.to || edge.to >= self.map_from_nodes.len() {
            return;
        }
        // The system grows by six columns, which takes less than a new one.
        if let Some(mut solved) = self.solved.take() {
            let own = solved.between(&edge.span()) + self.in_map(edge.from, &edge.covariance);
            let size = 6 * self.loops.len();
            let mut columns = DMatrix::zeros(size + 6, 6);
            for (row, other) in self.loops.iter().enumerate() {
                let block = solved.between(&overlap(&other.span(), &edge.span()));
                columns.view_mut((6 * row, 0), (6, 6)).copy_from(&block);
            }
            columns.view_mut((size, 0), (6, 6)).copy_from(&own);
            solved.system = match solved.system.take() {
                None => Cholesky::new(columns),
                Some(system) => Some((0..6).fold(system, |system, column| {
                    let rows = size + column + 1;
                    system.insert_column(rows - 1, columns.view((0, column), (rows, 1)).column(0))
                })),
            };
            self.solved = solved.system.is_some().then_some(solved);
        }
        self.loops.push(edge);
    }

    /// Keeps the loop closures that pass a test.
    pub fn retain(&mut self, is_kept: impl FnMut(&LoopEdge) -> bool) {
        self.loops.retain(is_kept);
        self.solved = None;
    }

    /// Optimizes the poses by least squares over motions and loop closures. The first node is fixed.
    ///
    /// Returns false, with unchanged poses, if the loop closures have no common solution.
    pub fn optimize(&mut self) -> bool {
        if self.loops.is_empty() {
            return true;
        }
        let before = self.map_from_nodes.clone();
        for _ in 0..MAX_ITERATIONS {
            let mut solved = self.solved.take().unwrap_or_else(|| self.linearize());
            let Some(largest) = self.step(&mut solved) else {
                self.map_from_nodes = before;
                return false;
            };
            let (moved_m, turned_rad) = solved.changed;
            if moved_m <= STALE.0 && turned_rad <= STALE.1 {
                self.solved = Some(solved);
            }
            if largest < CONVERGED {
                break;
            }
        }
        true
    }

    /// Squared Mahalanobis distance of each loop closure at the current poses.
    pub fn residuals(&self) -> Vec<f64> {
        let distance = |edge: &LoopEdge| {
            let residual = self.residual(edge);
            let covariance = self.in_map(edge.from, &edge.covariance);
            let inverse = covariance.cholesky();
            inverse.map_or(f64::INFINITY, |inverse| {
                residual.dot(&inverse.solve(&residual))
            })
        };
        self.loops.iter().map(distance).collect()
    }

    /// Gauss-Newton step, and its largest change; `None` without a solution.
    fn step(&mut self, solved: &mut Linearization) -> Option<f64> {
        // Deviation of each motion from its measurement, as a twist in the map.
        let deviations: Vec<Vector6<f64>> = (self.motions.iter())
            .zip(self.map_from_nodes.windows(2))
            .map(|((motion, _), pair)| match pair {
                [a, b] => se3::log(&(b * (a * motion).inverse())),
                _ => Vector6::zeros(),
            })
            .collect();
        let summed = cumulative(deviations.iter().copied(), Vector6::zeros());
        let mut wanted = DVector::zeros(6 * self.loops.len());
        for (row, edge) in self.loops.iter().enumerate() {
            let along = difference(&summed, &edge.span()).unwrap_or_else(Vector6::zeros);
            let value = self.residual(edge) + along;
            wanted.rows_mut(6 * row, 6).copy_from(&value);
        }
        let pulls = solved.system.as_ref()?.solve(&wanted);
        // The sum of the pulls of all loops over each motion.
        let mut changes = vec![Vector6::zeros(); self.map_from_nodes.len() + 1];
        for (row, edge) in self.loops.iter().enumerate() {
            let pull: Vector6<f64> = pulls.fixed_rows::<6>(6 * row).into_owned();
            if let Some(change) = changes.get_mut(edge.from) {
                *change += pull;
            }
            if let Some(change) = changes.get_mut(edge.to) {
                *change -= pull;
            }
        }
        let mut pull = Vector6::zeros();
        let mut moved = Vector6::zeros();
        let (mut largest, mut moves): (f64, (f64, f64)) = (0.0, (0.0, 0.0));
        let covariances = solved.covariances.windows(2).map(|pair| match pair {
            [a, b] => b - a,
            _ => Matrix6::zeros(),
        });
        let steps = changes.iter().zip(covariances.zip(deviations));
        let nodes = self.map_from_nodes.iter_mut().skip(1);
        for (pose, (change, (covariance, deviation))) in nodes.zip(steps) {
            pull += change;
            moved += covariance * pull - deviation;
            let after = renormalized(se3::exp(&moved) * *pose);
            let moved_m = (after.translation.vector - pose.translation.vector).norm();
            let turned_rad = moved.fixed_rows::<3>(3).norm();
            largest = largest.max(moved_m).max(turned_rad);
            moves = (moves.0.max(moved_m), moves.1.max(turned_rad));
            *pose = after;
        }
        solved.changed = (solved.changed.0 + moves.0, solved.changed.1 + moves.1);
        largest.is_finite().then_some(largest)
    }

    /// Twist in the map that moves the later node of a loop closure to its measured pose.
    fn residual(&self, edge: &LoopEdge) -> Vector6<f64> {
        let poses = &self.map_from_nodes;
        match (poses.get(edge.from), poses.get(edge.to)) {
            (Some(from), Some(to)) => se3::log(&(from * edge.from_to * to.inverse())),
            _ => Vector6::zeros(),
        }
    }

    /// Transforms the covariance of a twist from the frame of a node to the map.
    fn in_map(&self, node: usize, covariance: &Matrix6<f64>) -> Matrix6<f64> {
        let adjoint = self.map_from_nodes.get(node).map(se3::adjoint);
        adjoint.map_or_else(Matrix6::identity, |adjoint| {
            adjoint * covariance * adjoint.transpose()
        })
    }

    fn linearize(&self) -> Linearization {
        let each = self.motions.iter().enumerate();
        let each = each.map(|(node, (_, covariance))| self.in_map(node, covariance));
        let mut solved = Linearization {
            covariances: cumulative(each, Matrix6::zeros()),
            system: None,
            changed: (0.0, 0.0),
        };
        let size = 6 * self.loops.len();
        if size > 0 {
            let mut system = DMatrix::zeros(size, size);
            for (row, a) in self.loops.iter().enumerate() {
                for (column, b) in self.loops.iter().enumerate().take(row + 1) {
                    let mut block = solved.between(&overlap(&a.span(), &b.span()));
                    if row == column {
                        block += self.in_map(a.from, &a.covariance);
                    }
                    let mut to = system.view_mut((6 * row, 6 * column), (6, 6));
                    to.copy_from(&block);
                }
            }
            solved.system = Cholesky::new(system);
        }
        solved
    }
}

impl Linearization {
    /// Covariance between both ends of a span.
    fn between(&self, span: &Range<usize>) -> Matrix6<f64> {
        difference(&self.covariances, span).unwrap_or_else(Matrix6::zeros)
    }
}

/// Cumulative sums: before each element and after the last.
fn cumulative<T: Copy + std::ops::Add<Output = T>>(
    values: impl Iterator<Item = T>,
    zero: T,
) -> Vec<T> {
    let mut sums = vec![zero];
    let mut sum = zero;
    for value in values {
        sum = sum + value;
        sums.push(sum);
    }
    sums
}

/// Sum over a span of cumulative sums.
fn difference<T: Copy + std::ops::Sub<Output = T>>(sums: &[T], span: &Range<usize>) -> Option<T> {
    (span.start < span.end)
        .then(|| Some(*sums.get(span.end)? - *sums.get(span.start)?))
        .flatten()
}

fn overlap(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    a.start.max(b.start)..a.end.min(b.end)
}

fn renormalized(mut pose: Isometry3<f64>) -> Isometry3<f64> {
    pose.rotation.renormalize_fast();
    pose
}
