//! Surfaces of a mesh that a client sends whole, in the chunks in which they go on.

use lattice_msgs::headset::HeadsetMesh;

/// Most bytes of the arrays of a chunk, so that a message has at most 60 kB.
const CHUNK_BYTES: usize = 56_000;
/// Numbers of each array in a chunk: 4 + 4 + 2 bytes.
const CHUNK_NUMBERS: usize = CHUNK_BYTES / 10;

/// A surface in chunks; one that is short enough, or a chunk already, as it is. `None`: a chunk that is too long.
pub(super) fn in_chunks(mesh: HeadsetMesh) -> Option<Vec<HeadsetMesh>> {
    let numbers = mesh.vertices.len() + mesh.triangles.len();
    if 4 * numbers + 2 * mesh.classes.len() <= CHUNK_BYTES {
        return Some(vec![mesh]);
    }
    if mesh.chunks > 1 || mesh.removed {
        return None;
    }
    let arrays = [
        &mesh.vertices.len(),
        &mesh.triangles.len(),
        &mesh.classes.len(),
    ];
    let longest = arrays.into_iter().copied().max().unwrap_or(0);
    let chunks = longest.div_ceil(CHUNK_NUMBERS);
    let chunk = |i: usize| HeadsetMesh {
        header: mesh.header.clone(),
        session: mesh.session.clone(),
        surface: mesh.surface.clone(),
        removed: false,
        chunk: i as u32,
        chunks: chunks as u32,
        pose: mesh.pose,
        vertices: part(&mesh.vertices, i),
        triangles: part(&mesh.triangles, i),
        classes: part(&mesh.classes, i),
    };
    Some((0..chunks).map(chunk).collect())
}

fn part<T: Copy>(all: &[T], i: usize) -> Vec<T> {
    all.chunks(CHUNK_NUMBERS)
        .nth(i)
        .unwrap_or_default()
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_parted_and_join_to_what_they_were() {
        let whole = HeadsetMesh {
            surface: "room".to_owned(),
            session: "s".to_owned(),
            chunks: 1,
            vertices: (0..30_000).map(|i| i as f32).collect(),
            triangles: (0..60_001).collect(),
            classes: (0..20_000).map(|i| i as u16).collect(),
            ..HeadsetMesh::default()
        };
        let chunks = in_chunks(whole.clone()).unwrap();
        assert_eq!(chunks.len(), 11);
        let mut joined = HeadsetMesh {
            chunks: 1,
            vertices: Vec::new(),
            triangles: Vec::new(),
            classes: Vec::new(),
            ..whole.clone()
        };
        for (i, chunk) in chunks.iter().enumerate() {
            assert_eq!((chunk.chunk, chunk.chunks), (i as u32, 11));
            let cdr = lattice_msgs::cdr::to_vec(chunk).unwrap();
            assert!(cdr.len() <= 60_000, "{}", cdr.len());
            joined.vertices.extend(&chunk.vertices);
            joined.triangles.extend(&chunk.triangles);
            joined.classes.extend(&chunk.classes);
        }
        assert_eq!(joined, whole);
        assert_eq!(in_chunks(chunks[3].clone()), Some(vec![chunks[3].clone()]));
        let long = HeadsetMesh { chunks: 2, ..whole };
        assert_eq!(in_chunks(long), None);
    }
}
