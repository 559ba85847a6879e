//! Export of the centres of occupied cells.

use std::io::Write;

use lattice_core::registration::UNLABELED;
use lattice_core::voxels::VoxelList;

use super::error::ExportError;
use super::ply_header::{comment, ply_header};

/// Writes the occupied cells in Morton order as vertices of a binary PLY file.
///
/// `x`, `y`, `z` (double, metres, map frame) is the centre of the cell, `count` (uint) the number of
/// points in it, and `offset_x`, `_y`, `_z` (float, metres) their mean minus the centre. Maps with labels have
/// `label` (ushort, the most frequent one, 65535 for none), maps with colours `red`, `green` and `blue` (uchar, the mean,
/// black for none).
pub fn write_centers_ply(list: &VoxelList, writer: impl Write) -> Result<(), ExportError> {
    let mut writer = std::io::BufWriter::new(writer);
    let [x, y, z] = ["double x", "double y", "double z"];
    let [ox, oy, oz] = ["float offset_x", "float offset_y", "float offset_z"];
    let kept = list.payload();
    let mut properties = vec![x, y, z, "uint count", ox, oy, oz];
    if kept.labels {
        properties.push("ushort label");
    }
    if kept.color {
        properties.extend(["uchar red", "uchar green", "uchar blue"]);
    }
    let vertices = ("vertex", list.len() as u64, &properties[..]);
    writer.write_all(ply_header(&comment(list), &[vertices]).as_bytes())?;
    for (key, voxel) in list.sorted() {
        for coordinate in list.center_m(key).iter() {
            writer.write_all(&coordinate.to_le_bytes())?;
        }
        writer.write_all(&voxel.count.to_le_bytes())?;
        for offset in voxel.mean_offset_m() {
            writer.write_all(&(offset as f32).to_le_bytes())?;
        }
        if kept.labels {
            let label = list.label(key).map_or(UNLABELED, |counted| counted.label);
            writer.write_all(&label.to_le_bytes())?;
        }
        if kept.color {
            let mean = list.color(key).and_then(|color| color.mean());
            writer.write_all(&mean.unwrap_or_default())?;
        }
    }
    writer.flush()?;
    Ok(())
}

/// Writes the centres of the occupied cells in Morton order as lines of text: x, y and z in metres, map
/// frame.
pub fn write_centers_xyz(list: &VoxelList, writer: impl Write) -> Result<(), ExportError> {
    let mut writer = std::io::BufWriter::new(writer);
    for (key, _) in list.sorted() {
        let center = list.center_m(key);
        writeln!(writer, "{} {} {}", center.x, center.y, center.z)?;
    }
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use lattice_core::cloud::Cloud;
    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::{Payload, PointColumns};
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn centres_counts_and_offsets_are_written() {
        let lattice = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
        let datum = Vector3::new(4e6, -3.0, 0.0);
        let mut list = VoxelList::new(lattice, datum, 10).unwrap();
        let points = [[0.25, 0.0, 0.0], [-0.25, 0.25, 0.0], [0.0, 0.0, 5.125]];
        let points: Vec<_> = points.iter().map(|&p| datum + Vector3::from(p)).collect();
        list.insert(&Cloud::from_points(0, datum, &points));

        let mut bytes = Vec::new();
        write_centers_ply(&list, &mut bytes).unwrap();

        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = std::str::from_utf8(&bytes[..start]).unwrap();
        assert!(header.contains("comment cubic lattice, cell volume 1 m^3"));
        assert!(header.contains("element vertex 2\n"), "{header}");
        let row = |x: [f64; 3], count: u32, offset: [f32; 3]| {
            let (x, offset) = (x.map(f64::to_le_bytes), offset.map(f32::to_le_bytes));
            [&x.concat()[..], &count.to_le_bytes(), &offset.concat()].concat()
        };
        let expected = [
            row([4e6, -3.0, 0.0], 2, [0.0, 0.125, 0.0]),
            row([4e6, -3.0, 5.0], 1, [0.0, 0.0, 0.125]),
        ];
        assert_eq!(bytes[start..], expected.concat());
    }

    #[test]
    fn labels_and_colours_are_written_where_the_map_has_them() {
        let lattice = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
        let list = VoxelList::new(lattice, Vector3::zeros(), 10).unwrap();
        let mut list = list.with_payload(Payload {
            labels: true,
            color: true,
            ..Payload::default()
        });
        let columns = PointColumns {
            labels: &[7, 7],
            colors: &[Some([250, 0, 1]), Some([251, 2, 3])],
            ..PointColumns::default()
        };
        let points = [[0.25_f64, 0.0, 0.0], [-0.25, 0.0, 0.0], [0.0, 0.0, 5.0]];
        list.insert_points(Vector3::zeros(), &points, columns);
        let mut bytes = Vec::new();
        write_centers_ply(&list, &mut bytes).unwrap();
        let header = String::from_utf8_lossy(&bytes).into_owned();
        let expected = "property ushort label\nproperty uchar red\nproperty uchar green\n\
                        property uchar blue\nend_header\n";
        assert!(header.contains(expected), "{header}");
        let rows: Vec<_> = bytes[bytes.len() - 2 * 45..].chunks(45).collect();
        assert_eq!(rows[0][40..], [7, 0, 251, 1, 2]);
        assert_eq!(rows[1][40..], [255, 255, 0, 0, 0]);
    }
}
