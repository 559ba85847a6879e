//! Encoder of the nodes of a tree, depth first.

use lattice_core::raycast::LOG_ODDS_STEP;

use super::error::OctreeError;

/// Levels of a tree below its root.
pub const LEVELS: u32 = 16;

/// Value of an unknown voxel.
pub const UNKNOWN: i8 = i8::MIN;
/// Log-odds of voxels that are occupied without evidence, in steps of [`LOG_ODDS_STEP`]: 3.5, about OctoMap's
/// upper bound.
pub const LOG_ODDS_OCCUPIED: i8 = 112;

/// Levels of a block, the smallest part of a tree that is filled at once.
pub(super) const BLOCK_LEVELS: u32 = 3;
/// Voxels of a block.
pub(super) const BLOCK_VOXELS: usize = 1 << (3 * BLOCK_LEVELS);

/// Content of the nodes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OctreeForm {
    /// Two bits a child: unknown, free, occupied, or a node with children.
    Binary,
    /// Log-odds as 32-bit float, and one bit for each child that exists.
    Full,
}

/// Nodes of a tree.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct EncodedTree {
    /// Bytes of the nodes, without header; empty if all voxels are unknown.
    pub data: Vec<u8>,
    /// Number of nodes, leaves included.
    pub nodes: u64,
    /// Number of occupied voxels.
    pub occupied: u64,
}

/// Part of a tree.
#[derive(Clone, Copy, PartialEq)]
enum Node {
    Unknown,
    /// All voxels have this value.
    Leaf(i8),
    /// Voxels differ; the largest value of any.
    Inner(i8),
}

/// Encoder that merges eight equal children to one leaf.
pub(super) struct Encoder<'a, F> {
    form: OctreeForm,
    /// Smallest value of an occupied voxel.
    threshold: i8,
    max_bytes: usize,
    /// Voxels of a block by its code, in tree order.
    fill: F,
    tree: &'a mut EncodedTree,
}

impl<'a, F: FnMut(u64, &mut [i8; BLOCK_VOXELS])> Encoder<'a, F> {
    /// Encodes the blocks with these codes: ascending, each once.
    pub(super) fn run(
        form: OctreeForm,
        threshold: i8,
        max_bytes: usize,
        blocks: &[u64],
        fill: F,
    ) -> Result<EncodedTree, OctreeError> {
        let mut tree = EncodedTree::default();
        let mut encoder = Encoder {
            form,
            threshold,
            max_bytes,
            fill,
            tree: &mut tree,
        };
        if encoder.part(blocks, LEVELS)? != Node::Unknown {
            tree.nodes += 1;
        }
        Ok(tree)
    }

    /// Encodes a node with `levels` below it from its blocks.
    fn part(&mut self, blocks: &[u64], levels: u32) -> Result<Node, OctreeError> {
        if levels == BLOCK_LEVELS {
            let mut values = [UNKNOWN; BLOCK_VOXELS];
            if let Some(block) = blocks.first() {
                (self.fill)(*block, &mut values);
            }
            let is_occupied = |value: &&i8| **value >= self.threshold && **value != UNKNOWN;
            self.tree.occupied += values.iter().filter(is_occupied).count() as u64;
            if self.form == OctreeForm::Binary {
                for value in values.iter_mut().filter(|value| **value != UNKNOWN) {
                    *value = i8::from(*value >= self.threshold);
                }
            }
            let node = self.dense(&values);
            return match self.tree.data.len() > self.max_bytes {
                true => Err(OctreeError::TooLarge {
                    max_bytes: self.max_bytes,
                }),
                false => Ok(node),
            };
        }
        let below = levels.saturating_sub(1);
        let child_of = |block: &u64| (block >> (3 * (below - BLOCK_LEVELS)) & 7) as usize;
        let begun = self.begin();
        let mut children = [Node::Unknown; 8];
        for part in blocks.chunk_by(|a, b| child_of(a) == child_of(b)) {
            let node = self.part(part, below)?;
            if let Some(child) = part.first().and_then(|b| children.get_mut(child_of(b))) {
                *child = node;
            }
        }
        Ok(self.end(begun, &children))
    }

    /// Encodes a node from all its voxels.
    fn dense(&mut self, values: &[i8]) -> Node {
        let first = values.first().copied().unwrap_or(UNKNOWN);
        if values.iter().all(|value| *value == first) {
            return match first {
                UNKNOWN => Node::Unknown,
                value => self.leaf(value),
            };
        }
        let begun = self.begin();
        let mut children = [Node::Unknown; 8];
        let parts = values.chunks(values.len().div_ceil(8));
        for (child, part) in children.iter_mut().zip(parts) {
            *child = self.dense(part);
        }
        self.end(begun, &children)
    }

    fn leaf(&mut self, value: i8) -> Node {
        if self.form == OctreeForm::Full {
            self.tree.data.extend(log_odds(value));
            self.tree.data.push(0);
        }
        Node::Leaf(value)
    }

    /// Reserves the bytes of an inner node; the length and number of nodes before it.
    fn begin(&mut self) -> (usize, u64) {
        let begun = (self.tree.data.len(), self.tree.nodes);
        let bytes: &[u8] = match self.form {
            OctreeForm::Binary => &[0; 2],
            OctreeForm::Full => &[0; 5],
        };
        self.tree.data.extend(bytes);
        begun
    }

    /// Completes an inner node whose children have been encoded.
    fn end(&mut self, (start, nodes): (usize, u64), children: &[Node; 8]) -> Node {
        let [first, rest @ ..] = children;
        if matches!(first, Node::Unknown | Node::Leaf(_)) && rest.iter().all(|node| node == first) {
            self.tree.data.truncate(start);
            self.tree.nodes = nodes;
            return match *first {
                Node::Leaf(value) => self.leaf(value),
                node => node,
            };
        }
        let (mut pairs, mut exist, mut most) = (0_u16, 0_u8, UNKNOWN);
        for (child, node) in children.iter().enumerate() {
            let (pair, value) = match *node {
                Node::Unknown => continue,
                Node::Leaf(value) => (if value > 0 { 0b10 } else { 0b01 }, value),
                Node::Inner(value) => (0b11, value),
            };
            pairs |= pair << (2 * child);
            exist |= 1 << child;
            most = most.max(value);
            self.tree.nodes += 1;
        }
        let [a, b, c, d] = log_odds(most);
        let [low, high] = pairs.to_le_bytes();
        let bytes: &[u8] = match self.form {
            OctreeForm::Binary => &[low, high],
            OctreeForm::Full => &[a, b, c, d, exist],
        };
        let reserved = self.tree.data.iter_mut().skip(start);
        reserved.zip(bytes).for_each(|(to, from)| *to = *from);
        Node::Inner(most)
    }
}

/// Log-odds as a file has them.
fn log_odds(value: i8) -> [u8; 4] {
    ((f64::from(value) * LOG_ODDS_STEP) as f32).to_le_bytes()
}
