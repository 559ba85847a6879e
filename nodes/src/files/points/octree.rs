//! OctoMap's binary trees (`.bt`): centres of the occupied voxels.
//!
//! A text header, then two bytes per inner node, depth first: two bits for each of its eight
//! children (unknown, free, occupied or inner node). The tree has 16 levels and is
//! centred at the origin; bits 0, 1 and 2 of a child's index select the upper half in x, y and z.

use super::collect::Collector;
use super::source::Source;
use super::{PointFileError, PointFormat};

/// First line of every file.
pub(super) const SIGNATURE: &[u8] = b"# Octomap OcTree binary file";
/// First line of a tree with probabilities.
pub(super) const FULL_SIGNATURE: &[u8] = b"# Octomap OcTree file";

/// Levels below the root.
const LEVELS: u32 = 16;
/// Limit of header lines.
const MAX_LINES: u64 = 1000;

/// Resolution and number of nodes from the header.
struct Header {
    resolution_m: f64,
    nodes: u64,
}

/// An inner node whose children are read next.
struct Inner {
    /// Lowest voxel on each axis, relative to the lowest of the tree.
    corner: [u32; 3],
    /// Levels below it.
    levels: u32,
}

/// Reads the voxels; also returns their edge, metres.
pub(super) fn read(
    source: &mut Source,
    points: &mut Collector,
) -> Result<(PointFormat, f64), PointFileError> {
    let header = read_header(source)?;
    // Number of nodes read; the root is one.
    let mut nodes = u64::from(header.nodes > 0);
    let mut inner = Vec::new();
    if header.nodes > 0 {
        inner.push(Inner {
            corner: [0; 3],
            levels: LEVELS,
        });
    }
    while let Some(node) = inner.pop() {
        let mut children = [0; 2];
        let part = format_args!("node {nodes} of {}", header.nodes);
        source.exact(&mut children, part)?;
        let children = u16::from_le_bytes(children);
        let fault = |reason: &str| PointFileError::Data {
            format: PointFormat::OctoMapBinary,
            byte: source.byte().saturating_sub(2),
            reason: reason.to_owned(),
        };
        let levels = node.levels.saturating_sub(1);
        // In reverse order: the last pushed node is read first.
        for child in (0..8_u32).rev() {
            let corner = [0, 1, 2].map(|axis| {
                let low = node.corner.get(axis).copied().unwrap_or_default();
                low + ((child >> axis & 1) << levels)
            });
            match children >> (2 * child) & 0b11 {
                0b00 => continue,
                0b01 => {}
                0b10 => push_voxels(points, corner, levels, header.resolution_m)?,
                _ if levels == 0 => return Err(fault("a voxel of the lowest level has children")),
                _ => inner.push(Inner { corner, levels }),
            }
            nodes += 1;
        }
        if nodes > header.nodes {
            return Err(fault("more nodes than `size` of the header"));
        }
    }
    if nodes != header.nodes {
        return Err(PointFileError::Data {
            format: PointFormat::OctoMapBinary,
            byte: source.byte(),
            reason: format!("{nodes} nodes, but `size` is {}", header.nodes),
        });
    }
    Ok((PointFormat::OctoMapBinary, header.resolution_m))
}

/// Adds all voxels of an occupied node.
fn push_voxels(
    points: &mut Collector,
    corner: [u32; 3],
    levels: u32,
    resolution_m: f64,
) -> Result<(), PointFileError> {
    let side = 1_u32 << levels;
    // Checked before any is created.
    points.promise_more(u64::from(side).pow(3))?;
    let range = |axis: usize| {
        let low = corner.get(axis).copied().unwrap_or_default();
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
    let (mut resolution_m, mut nodes) = (None, None);
    for number in 1..MAX_LINES {
        let line = source.expect_line("the header, before `data`")?;
        let line = line.trim();
        let fault = |reason: String| PointFileError::Line {
            format: PointFormat::OctoMapBinary,
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
            "data" => {
                let missing = || fault("`data` comes before `res` and `size`".to_owned());
                return Ok(Header {
                    resolution_m: resolution_m.ok_or_else(missing)?,
                    nodes: nodes.ok_or_else(missing)?,
                });
            }
            _ => {}
        }
    }
    Err(PointFileError::Line {
        format: PointFormat::OctoMapBinary,
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
