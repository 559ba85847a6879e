//! Surfaces of a mesh that a client sends whole, in the chunks in which they go on.

use lattice_msgs::headset::HeadsetMesh;

use crate::viewer_server::inputs::InputRefusal;

/// Most bytes of the arrays of a chunk, so that a message with its names has at most 60 kB.
const CHUNK_BYTES: usize = 56_000;
/// Most bytes of session, surface and frame in all: every chunk has them.
const NAMES_BYTES: usize = 2_000;
/// Most chunks of a surface: those that a reader may still ask for again.
const MAX_CHUNKS: usize = 1000;

/// A surface in chunks; one that is short enough, or a chunk already, as it is.
pub(super) fn in_chunks(mesh: HeadsetMesh) -> Result<Vec<HeadsetMesh>, InputRefusal> {
    let names = mesh.session.len() + mesh.surface.len() + mesh.header.frame_id.len();
    if names > NAMES_BYTES {
        return Err(InputRefusal::LongNames);
    }
    let numbers = mesh.vertices.len() + mesh.triangles.len();
    let bytes = 4 * numbers + 2 * mesh.classes.len();
    if bytes <= CHUNK_BYTES {
        return Ok(vec![mesh]);
    }
    // Room for what each array is rounded up by.
    let chunks = bytes.div_ceil(CHUNK_BYTES - 16);
    if mesh.chunks > 1 || mesh.removed || chunks > MAX_CHUNKS {
        return Err(InputRefusal::LongChunk);
    }
    let chunk = |i: usize| HeadsetMesh {
        header: mesh.header.clone(),
        session: mesh.session.clone(),
        surface: mesh.surface.clone(),
        removed: false,
        chunk: i as u32,
        chunks: chunks as u32,
        pose: mesh.pose,
        vertices: part(&mesh.vertices, i, chunks),
        triangles: part(&mesh.triangles, i, chunks),
        classes: part(&mesh.classes, i, chunks),
    };
    Ok((0..chunks).map(chunk).collect())
}

/// One of so many parts of an array that are as long as each other, but for the last.
fn part<T: Copy>(all: &[T], i: usize, parts: usize) -> Vec<T> {
    let length = all.len().div_ceil(parts).max(1);
    all.chunks(length).nth(i).unwrap_or_default().to_vec()
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
            let cdr = lattice_msgs::cdr::to_vec(chunk).unwrap();
            assert!(cdr.len() <= 60_000, "{}", cdr.len());
            joined.vertices.extend(&chunk.vertices);
            joined.triangles.extend(&chunk.triangles);
            joined.classes.extend(&chunk.classes);
        }
        assert_eq!(joined, whole);
        assert_eq!(in_chunks(chunks[3].clone()), Ok(vec![chunks[3].clone()]));
        let long = HeadsetMesh { chunks: 2, ..whole };
        assert_eq!(in_chunks(long), Err(InputRefusal::LongChunk));
    }

    #[test]
    fn surfaces_whose_names_or_chunks_are_too_many_are_refused() {
        // Each chunk would have the names, so that a few bytes would become many.
        let named = HeadsetMesh {
            session: "s".repeat(1_001),
            surface: "r".repeat(1_000),
            ..HeadsetMesh::default()
        };
        assert_eq!(in_chunks(named), Err(InputRefusal::LongNames));
        let vertices = |numbers: usize| HeadsetMesh {
            chunks: 1,
            vertices: vec![1.0; numbers],
            ..HeadsetMesh::default()
        };
        assert_eq!(in_chunks(vertices(28_000)).unwrap().len(), 3);
        assert_eq!(
            in_chunks(vertices(14_000_000)),
            Err(InputRefusal::LongChunk)
        );
    }
}
