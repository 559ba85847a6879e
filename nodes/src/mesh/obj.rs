//! Meshes from OBJ files: vertices and faces only.

use lattice_core::registration::UNLABELED;
use std::io::{BufRead, Read};

use super::{LabelledMesh, MeshError};

/// Longest line, bytes.
const MAX_LINE: u64 = 1 << 16;

/// Reads `v` (metres) and `f`; polygons become fans of unlabelled triangles. Vertex indices of faces
/// count from 1, or backwards from the last one if they are negative.
pub(super) fn read(mut reader: impl BufRead, max: usize) -> Result<LabelledMesh, MeshError> {
    let (mut vertices_m, mut triangles) = (Vec::new(), Vec::new());
    let mut text = Vec::new();
    for line in 1.. {
        text.clear();
        let fault = |reason: &str| MeshError::Obj {
            line,
            reason: reason.to_owned(),
        };
        let read = reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut text);
        match read.map_err(|error| fault(&error.to_string()))? {
            0 => break,
            bytes if bytes as u64 == MAX_LINE => return Err(fault("the line is too long")),
            _ => {}
        }
        let text = String::from_utf8_lossy(&text);
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f32> = words.take(3).map_while(|w| w.parse().ok()).collect();
                let vertex = <[f32; 3]>::try_from(numbers);
                vertices_m.push(vertex.map_err(|_| fault("a vertex needs three numbers"))?);
                if vertices_m.len() > max.saturating_mul(3) {
                    let (what, found) = ("vertices or more", vertices_m.len());
                    let max = max.saturating_mul(3);
                    return Err(MeshError::TooMany { what, found, max });
                }
            }
            Some("f") => {
                let corners = words.map(|word| corner(word, vertices_m.len()));
                let corners: Option<Vec<u32>> = corners.collect();
                let corners = corners
                    .ok_or_else(|| fault("a corner refers to a vertex that is not defined"))?;
                let Some((&first, others)) = corners.split_first().filter(|(_, o)| o.len() > 1)
                else {
                    return Err(fault("a face needs three corners"));
                };
                triangles.extend(others.windows(2).map(|pair| [first, pair[0], pair[1]]));
                if triangles.len() > max {
                    let triangles = triangles.len() as u64;
                    return Err(MeshError::FileTooLarge { triangles, max });
                }
            }
            _ => {}
        }
    }
    let labels = vec![UNLABELED; triangles.len()];
    LabelledMesh::new(vertices_m, triangles, labels.clone(), labels)
        .map_err(|error| MeshError::NoMesh(Box::new(error)))
}

/// Vertex index of a corner such as `7`, `7/1/2` or `-1`.
fn corner(word: &str, vertices: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let from_start = match number {
        1.. => number - 1,
        0 => return None,
        _ => number.checked_add(i64::try_from(vertices).ok()?)?,
    };
    let vertex = u32::try_from(from_start).ok()?;
    ((vertex as usize) < vertices).then_some(vertex)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<LabelledMesh, MeshError> {
        read(text.as_bytes(), 3)
    }

    #[test]
    fn polygons_become_fans_and_other_lines_are_passed_over() {
        let text =
            "# a\nmtllib x\nv 0 0 0\nv 1 0 0 9\nv 1 1 0\nvn 0 0 1\nv 0 1 0\nf 1/1/1 2//1 3 -1\n";
        let mesh = read_text(text).unwrap();
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.vertices_m()[1], [1.0, 0.0, 0.0]);
        assert_eq!(mesh.labels(), [UNLABELED; 2]);
    }

    #[test]
    fn faults_are_refused_with_their_line() {
        let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for (text, problem) in [
            ("v 0 0\n", "line 1: a vertex needs three numbers"),
            ("v 0 0 nil", "line 1: a vertex"),
            ("v 0 0 nan\n", "no mesh: vertex 0"),
            ("f 1 2\n", "a corner refers to a vertex that is not defined"),
            ("f\n", "three corners"),
            ("f 1 2 3", "a corner refers to a vertex that is not defined"),
        ] {
            let error = read_text(text).unwrap_err().to_string();
            assert!(error.contains(problem), "{error}");
        }
        for (faces, problem) in [
            ("f 1 2 4\n", "line 4: a corner refers to a vertex"),
            ("f 1 2 0\n", "line 4: a corner refers to a vertex"),
            ("f 1 2 -9223372036854775808\n", "line 4: a corner refers to"),
            (&"f 1 2 3\n".repeat(4), "more than 3"),
            (&"x".repeat(1 << 16), "line 4: the line is too long"),
        ] {
            let error = read_text(&format!("{corners}{faces}")).unwrap_err();
            assert!(error.to_string().contains(problem), "{error}");
        }
    }
}
