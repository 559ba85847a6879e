//! Headers of PLY files.

use lattice_core::voxels::VoxelList;

/// PLY element: name, count, and type and name of each property.
type PlyElement<'a> = (&'a str, u64, &'a [&'a str]);

/// Header of a binary little-endian PLY file, with one line of comment.
pub fn ply_header(comment: &str, elements: &[PlyElement]) -> String {
    let comment = comment.replace(['\n', '\r'], " ");
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {comment}\n");
    for (name, count, properties) in elements {
        header += &format!("element {name} {count}\n");
        for property in *properties {
            header += &format!("property {property}\n");
        }
    }
    header + "end_header\n"
}

/// Header comment that describes the map.
pub(super) fn comment(list: &VoxelList) -> String {
    let lattice = list.lattice();
    format!(
        "{} lattice, cell volume {} m^3, metres, map frame: x east, y north, z up",
        lattice.kind(),
        lattice.cell_volume_m3()
    )
}
