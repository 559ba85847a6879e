//! Chunking of headset mesh surfaces for transmission.

use lattice_msgs::lattice::HeadsetMesh;

/// Limit of array bytes per chunk, so that a message with its names has at most 60 kB.
const CHUNK_BYTES: usize = 56_000;

/// Number of chunks of a surface with at most 60 kB each.
pub fn chunks_for(mesh: &HeadsetMesh) -> usize {
    let numbers = mesh.vertices.len() + mesh.triangles.len();
    match 4 * numbers + 2 * mesh.classes.len() {
        0..=CHUNK_BYTES => 1,
        // Reserve for rounding up each array.
        bytes => bytes.div_ceil(CHUNK_BYTES - 16),
    }
}

/// Splits a surface into chunks with equal parts of every array; surplus chunks are empty.
pub fn in_chunks(mesh: &HeadsetMesh, chunks: usize) -> Vec<HeadsetMesh> {
    let chunk = |i: usize| HeadsetMesh {
        header: mesh.header.clone(),
        session: mesh.session.clone(),
        surface: mesh.surface.clone(),
        removed: mesh.removed,
        chunk: i as u32,
        chunks: chunks as u32,
        pose: mesh.pose,
        vertices: part(&mesh.vertices, i, chunks),
        triangles: part(&mesh.triangles, i, chunks),
        classes: part(&mesh.classes, i, chunks),
    };
    (0..chunks).map(chunk).collect()
}

/// Part `i` of an array split into `parts` of equal length, except the last.
fn part<T: Copy>(all: &[T], i: usize, parts: usize) -> Vec<T> {
    let length = all.len().div_ceil(parts).max(1);
    all.chunks(length).nth(i).unwrap_or_default().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_short_and_join_to_the_surface() {
        let whole = HeadsetMesh {
            surface: "room".to_owned(),
            session: "s".to_owned(),
            chunks: 1,
            vertices: (0..30_000).map(|i| i as f32).collect(),
            triangles: (0..60_001).collect(),
            classes: (0..20_000).map(|i| i as u16).collect(),
            ..HeadsetMesh::default()
        };
        let chunks = in_chunks(&whole, chunks_for(&whole));
        assert_eq!(chunks.len(), 8);
        let mut joined = HeadsetMesh {
            chunks: 1,
            vertices: Vec::new(),
            triangles: Vec::new(),
            classes: Vec::new(),
            ..whole.clone()
        };
        for (i, chunk) in chunks.iter().enumerate() {
            assert_eq!((chunk.chunk, chunk.chunks), (i as u32, 8));
            assert_eq!(chunks_for(chunk), 1);
            let cdr = lattice_msgs::cdr::to_vec(chunk).unwrap();
            assert!(cdr.len() <= 60_000, "{}", cdr.len());
            joined.vertices.extend(&chunk.vertices);
            joined.triangles.extend(&chunk.triangles);
            joined.classes.extend(&chunk.classes);
        }
        assert_eq!(joined, whole);
        let nothing = HeadsetMesh {
            chunks: 1,
            ..HeadsetMesh::default()
        };
        assert_eq!(in_chunks(&nothing, chunks_for(&nothing)), [nothing]);
    }
}
