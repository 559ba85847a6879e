//! Header of a binary PLY file.

/// An element: its name, how many there are, and the type and name of each property.
pub type PlyElement<'a> = (&'a str, u64, &'a [&'a str]);

/// The header of a binary little-endian PLY file, with one line of comment.
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
