//! OctoMap's trees, binary (`.bt`) or with log-odds (`.ot`): centres of the occupied voxels.
//!
//! A text header, then the nodes, depth first. In a binary tree an inner node has two bytes: two bits for each of its
//! eight children (unknown, free, occupied or inner node). With log-odds each node has a 32-bit float, the colour of a
//! `ColorOcTree`, and a byte whose bits are the children that exist. The tree has 16 levels and is centred at the
//! origin; bits 0, 1 and 2 of a child's index select the upper half in x, y and z.

use super::collect::Collector;
use super::source::Source;
use super::{PointFileError, PointFormat};
use crate::octree::LEVELS;

/// First line of a binary tree.
pub(super) const SIGNATURE: &[u8] = b"# Octomap OcTree binary file";
/// First line of a tree with log-odds.
pub(super) const FULL_SIGNATURE: &[u8] = b"# Octomap OcTree file";

/// Limit of header lines.
const MAX_LINES: u64 = 1000;

/// Resolution, number of nodes, and bytes of a colour, from the header.
struct Header {
    format: PointFormat,
    resolution_m: f64,
    nodes: u64,
    color_bytes: usize,
}

/// A node that is read next.
struct Next {
    /// Lowest voxel on each axis, relative to the lowest of the tree.
    corner: [u32; 3],
    /// Levels below it.
    levels: u32,
}

impl Next {
    const ROOT: Next = Next {
        corner: [0; 3],
        levels: LEVELS,
    };

    fn child(&self, child: u32) -> Next {
        let levels = self.levels.saturating_sub(1);
        let corner = [0, 1, 2].map(|axis| {
            let low = self.corner.get(axis).copied().unwrap_or_default();
            low + ((child >> axis & 1) << levels)
        });
        Next { corner, levels }
    }
}

/// Reads the voxels; also returns their edge, metres.
pub(super) fn read(
    source: &mut Source,
    points: &mut Collector,
) -> Result<(PointFormat, f64), PointFileError> {
    let header = read_header(source)?;
    let nodes = match (header.nodes, header.format) {
        (0, _) => 0,
        (_, PointFormat::OctoMapFull) => read_full(source, points, &header)?,
        _ => read_binary(source, points, &header)?,
    };
    if nodes != header.nodes {
        let reason = format!("{nodes} nodes, but `size` is {}", header.nodes);
        return Err(header.fault(source.byte(), &reason));
    }
    Ok((header.format, header.resolution_m))
}

impl Header {
    fn fault(&self, byte: u64, reason: &str) -> PointFileError {
        PointFileError::Data {
            format: self.format,
            byte,
            reason: reason.to_owned(),
        }
    }

    /// Checks the number of nodes read so far.
    fn check(&self, nodes: u64, source: &Source) -> Result<(), PointFileError> {
        match nodes > self.nodes {
            true => Err(self.fault(source.byte(), "more nodes than `size` of the header")),
            false => Ok(()),
        }
    }
}

const TOO_DEEP: &str = "a voxel of the lowest level has children";

/// Reads a tree with two bits per child; returns its number of nodes.
fn read_binary(
    source: &mut Source,
    points: &mut Collector,
    header: &Header,
) -> Result<u64, PointFileError> {
    // The root is one.
    let mut nodes = 1;
    let mut inner = vec![Next::ROOT];
    while let Some(node) = inner.pop() {
        let mut children = [0; 2];
        let part = format_args!("node {nodes} of {}", header.nodes);
        source.exact(&mut children, part)?;
        let children = u16::from_le_bytes(children);
        // In reverse order: the last pushed node is read first.
        for number in (0..8_u32).rev() {
            let child = node.child(number);
            match children >> (2 * number) & 0b11 {
                0b00 => continue,
                0b01 => {}
                0b10 => push_voxels(points, &child, header.resolution_m)?,
                _ if child.levels == 0 => return Err(header.fault(source.byte(), TOO_DEEP)),
                _ => inner.push(child),
            }
            nodes += 1;
        }
        header.check(nodes, source)?;
    }
    Ok(nodes)
}

/// Reads a tree with log-odds; returns its number of nodes. A leaf is occupied from 0 on.
fn read_full(
    source: &mut Source,
    points: &mut Collector,
    header: &Header,
) -> Result<u64, PointFileError> {
    let mut nodes = 0;
    let mut next = vec![Next::ROOT];
    while let Some(node) = next.pop() {
        nodes += 1;
        header.check(nodes + next.len() as u64, source)?;
        let part = format_args!("node {nodes} of {}", header.nodes);
        let (mut log_odds, mut color, mut children) = ([0; 4], [0; 3], [0; 1]);
        source.exact(&mut log_odds, part)?;
        source.exact(
            color.get_mut(..header.color_bytes).unwrap_or_default(),
            part,
        )?;
        source.exact(&mut children, part)?;
        let (log_odds, [children]) = (f32::from_le_bytes(log_odds), children);
        if !log_odds.is_finite() {
            let reason = format!("log-odds {log_odds} of a node are not finite");
            return Err(header.fault(source.byte(), &reason));
        }
        if children != 0 && node.levels == 0 {
            return Err(header.fault(source.byte(), TOO_DEEP));
        }
        if children == 0 && log_odds >= 0.0 {
            push_voxels(points, &node, header.resolution_m)?;
        }
        let exist = (0..8_u32).rev().filter(|child| children >> child & 1 == 1);
        next.extend(exist.map(|child| node.child(child)));
    }
    Ok(nodes)
}

/// Adds all voxels of an occupied node.
fn push_voxels(
    points: &mut Collector,
    node: &Next,
    resolution_m: f64,
) -> Result<(), PointFileError> {
    let side = 1_u32 << node.levels;
    // Checked before any is created.
    points.promise_more(u64::from(side).pow(3))?;
    let range = |axis: usize| {
        let low = node.corner.get(axis).copied().unwrap_or_default();
        low..low + side
    };
    // The centre of the tree is between two voxels.
    let center_m = |voxel: u32| (f64::from(voxel) - 32767.5) * resolution_m;
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                points.push([x, y, z].map(center_m))?;
            }
        }
    }
    Ok(())
}

fn read_header(source: &mut Source) -> Result<Header, PointFileError> {
    let (mut resolution_m, mut nodes, mut color_bytes) = (None, None, 0);
    let is_full = (source.peek()?).starts_with(FULL_SIGNATURE);
    let format = match is_full {
        true => PointFormat::OctoMapFull,
        false => PointFormat::OctoMapBinary,
    };
    for number in 1..MAX_LINES {
        let line = source.expect_line("the header, before `data`")?;
        let line = line.trim();
        let fault = |reason: String| PointFileError::Line {
            format,
            line: number,
            reason,
        };
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let value = value.trim();
        match key {
            "res" => {
                let number: Option<f64> = value.parse().ok();
                resolution_m = number.filter(|res| (1e-6..=1e6).contains(res));
                if resolution_m.is_none() {
                    let value: String = value.chars().take(40).collect();
                    return Err(fault(format!(
                        "res {value:?} is outside 0.000001 to 1000000 m"
                    )));
                }
            }
            "size" => {
                nodes = value.parse().ok();
                if nodes.is_none() {
                    let value: String = value.chars().take(40).collect();
                    return Err(fault(format!("size {value:?} is not a number of nodes")));
                }
            }
            // Colours are not in a binary tree.
            "id" if is_full => {
                color_bytes = match value {
                    "OcTree" => 0,
                    "ColorOcTree" => 3,
                    _ => {
                        let value: String = value.chars().take(40).collect();
                        let known = "OcTree and ColorOcTree";
                        return Err(fault(format!("id {value:?} is not read, only {known}")));
                    }
                }
            }
            "data" => {
                let missing = || fault("`data` comes before `res` and `size`".to_owned());
                return Ok(Header {
                    format,
                    color_bytes,
                    resolution_m: resolution_m.ok_or_else(missing)?,
                    nodes: nodes.ok_or_else(missing)?,
                });
            }
            _ => {}
        }
    }
    Err(PointFileError::Line {
        format,
        line: MAX_LINES,
        reason: format!("no `data` in the first {MAX_LINES} lines"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(size: u64, data: &[u8]) -> Vec<u8> {
        let header = "# Octomap OcTree binary file\n# a comment\nid OcTree\n";
        let header = format!("{header}size {size}\nres 0.5\ndata\n");
        [header.as_bytes(), data].concat()
    }

    fn points(bytes: Vec<u8>, max_points: usize) -> Result<Vec<[f64; 3]>, String> {
        let mut points = Collector::new(max_points);
        let mut source = Source::new(Box::new(std::io::Cursor::new(bytes)));
        let read = read(&mut source, &mut points);
        read.map(|_| points.points_m).map_err(|e| e.to_string())
    }

    /// The way to the voxel next to the origin on the upper side: child 7, then child 0, 15 times.
    fn upper(last: u16) -> Vec<u8> {
        let way = [0b11 << 14].into_iter().chain([0b11; 14]).chain([last]);
        way.flat_map(u16::to_le_bytes).collect()
    }

    #[test]
    fn voxels_are_cubes_beside_the_origin() {
        let one = points(bytes(17, &upper(0b10)), 9);
        assert_eq!(one, Ok(vec![[0.25; 3]]));
        // The neighbour in x is free, that in y and z occupied.
        let two = points(bytes(19, &upper(0b10_0000_0000_0110)), 9);
        assert_eq!(two.unwrap(), [[0.25, 0.75, 0.75], [0.25; 3]]);
        // A node above the lowest level is all its voxels.
        let mut block = upper(0);
        block.truncate(28);
        block.extend(0b10_u16.to_le_bytes());
        let eight = points(bytes(16, &block), 9).unwrap();
        assert_eq!(eight.len(), 8);
        assert!(eight.contains(&[0.25, 0.75, 0.25]));
        assert_eq!(points(bytes(0, &[]), 9), Ok(vec![]));
    }

    fn full(id: &str, size: u64, nodes: &[(f32, u8)]) -> Vec<u8> {
        let header = format!("# Octomap OcTree file\nid {id}\nsize {size}\nres 0.5\ndata\n");
        let color = if id == "OcTree" { 0 } else { 3 };
        let node = |(value, children): &(f32, u8)| {
            [&value.to_le_bytes()[..], &[9; 3][..color], &[*children]].concat()
        };
        let nodes: Vec<u8> = nodes.iter().flat_map(node).collect();
        [header.as_bytes(), &nodes].concat()
    }

    #[test]
    fn trees_with_log_odds_have_the_same_voxels() {
        let way = [vec![(1.0, 128)], vec![(1.0, 1); 14]].concat();
        let voxels = [
            vec![(1.0, 0b1111)],
            vec![(0.5, 0), (-0.5, 0), (0.0, 0), (-2.0, 0)],
        ];
        let nodes = [way, voxels.concat()].concat();
        for id in ["OcTree", "ColorOcTree"] {
            let found = points(full(id, 20, &nodes), 9).unwrap();
            assert_eq!(found, [[0.25; 3], [0.25, 0.75, 0.25]], "{id}");
        }
        for (bytes, message) in [
            (full("OcTree", 21, &nodes), "20 nodes, but `size` is 21"),
            (full("OcTree", 19, &nodes), "more nodes than `size`"),
            (full("OcTree", 20, &nodes[..19]), "cut short"),
            (full("OcTree", 1, &[(0.0, 0)]), "but at most 9 are allowed"),
            (full("OcTree", 1, &[(f32::NAN, 0)]), "log-odds NaN"),
            (
                full("OcTree", 99, &[(0.0, 1); 18]),
                "lowest level has children",
            ),
            (
                full("CountingOcTree", 1, &[]),
                "only OcTree and ColorOcTree",
            ),
        ] {
            let error = points(bytes, 9).unwrap_err();
            assert!(error.contains(message), "{error}: {message}");
        }
    }

    #[test]
    fn lies_are_refused_and_take_no_memory() {
        for (bytes, message) in [
            // All of space.
            (bytes(9, &[0xaa, 0xaa]), "but at most 9 are allowed"),
            (bytes(17, &upper(0b11)), "lowest level has children"),
            (bytes(18, &upper(0b10)), "17 nodes, but `size` is 18"),
            (bytes(3, &upper(0b10)), "more nodes than `size`"),
            (bytes(2, &[0, 0xc0, 3, 0, 3, 0]), "more nodes than `size`"),
            (bytes(17, &upper(0b10)[..31]), "cut short"),
            (
                b"# Octomap OcTree binary file\ndata\n".to_vec(),
                "before `res`",
            ),
            (b"res nan\n".to_vec(), "res \"nan\""),
            (b"size -1\n".to_vec(), "size \"-1\""),
            (b"res 1\n".to_vec(), "before `data`"),
        ] {
            let error = points(bytes, 9).unwrap_err();
            assert!(error.contains(message), "{error}: {message}");
        }
    }
}
