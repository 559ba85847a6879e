//! Export of labelled clouds.

use std::io::{self, BufWriter, Write};

use nalgebra::Point3;

use super::ply_header::ply_header;

/// Writes points as vertices of a binary PLY file: `x`, `y`, `z` (double, metres) and `label`
/// (ushort, 65535 for none, also for points beyond the labels). `comment` is one line that names
/// their frame.
pub fn write_labelled_ply(
    points_m: &[Point3<f64>],
    labels: &[u16],
    comment: &str,
    writer: impl Write,
) -> io::Result<()> {
    let mut writer = BufWriter::new(writer);
    let properties = ["double x", "double y", "double z", "ushort label"];
    let vertices = ("vertex", points_m.len() as u64, &properties[..]);
    writer.write_all(ply_header(comment, &[vertices]).as_bytes())?;
    let labels = labels.iter().copied().chain(std::iter::repeat(u16::MAX));
    for (point, label) in points_m.iter().zip(labels) {
        for coordinate in point.iter() {
            writer.write_all(&coordinate.to_le_bytes())?;
        }
        writer.write_all(&label.to_le_bytes())?;
    }
    writer.flush()
}

#[cfg(test)]
mod tests {
    use crate::files::points::{PointFileOptions, read_points};

    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.ply");
        let points = [Point3::new(4e5, -0.25, 1e-9), Point3::new(0.1, 0.2, 0.3)];
        let file = std::fs::File::create(&path).unwrap();
        write_labelled_ply(&points, &[12], "two\nend_header", file).unwrap();
        let read = read_points(&path, &PointFileOptions::default()).unwrap();
        assert_eq!(read.points_m, points.map(<[f64; 3]>::from));
        assert_eq!(read.labels, [12, u16::MAX]);
    }
}
