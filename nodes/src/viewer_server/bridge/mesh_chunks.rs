//! Chunking of mesh surfaces that a client sends as a whole.

use lattice_msgs::lattice::HeadsetMesh;

use crate::convert::headset_mesh::{self, chunks_for};
use crate::viewer_server::session::InputRefusal;

/// Limit of bytes of session, surface and frame names, which every chunk repeats.
const NAMES_BYTES: usize = 2_000;
/// Limit of chunks per surface, within the history of the publisher.
const MAX_CHUNKS: usize = 1000;

/// Splits a surface into chunks; a short one, or a chunk, is unchanged.
pub(super) fn in_chunks(mesh: HeadsetMesh) -> Result<Vec<HeadsetMesh>, InputRefusal> {
    let names = mesh.session.len() + mesh.surface.len() + mesh.header.frame_id.len();
    if names > NAMES_BYTES {
        return Err(InputRefusal::LongNames);
    }
    let chunks = chunks_for(&mesh);
    if chunks <= 1 {
        return Ok(vec![mesh]);
    }
    if mesh.chunks > 1 || mesh.removed || chunks > MAX_CHUNKS {
        return Err(InputRefusal::LongChunk);
    }
    Ok(headset_mesh::in_chunks(&mesh, chunks))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_surfaces_are_parted_and_chunks_go_on_as_they_are() {
        let whole = HeadsetMesh {
            surface: "room".to_owned(),
            chunks: 1,
            triangles: (0..60_001).collect(),
            ..HeadsetMesh::default()
        };
        let chunks = in_chunks(whole.clone()).unwrap();
        assert_eq!(chunks.len(), 5);
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
