//! Export of the centres of occupied cells as PCD.

use std::io::{BufWriter, Write};

use lattice_core::registration::UNLABELED;
use lattice_core::voxels::VoxelList;

use super::error::ExportError;
use super::ply_header::comment;

/// Coordinates below this are written in single precision, with an error below 0.5 mm, m.
const SINGLE_M: f64 = 8192.0;

/// Writes the occupied cells in Morton order as a binary PCD file.
///
/// `x`, `y`, `z` (metres, map frame) is the centre of the cell; they are `float`, as PCL's point types are, or
/// `double` if one is 8192 m or more. `intensity` (float) is the number of points in the cell, and `label`
/// (uint, 65535 for none), if the map keeps labels, the most frequent one.
pub fn write_centers_pcd(list: &VoxelList, writer: impl Write) -> Result<(), ExportError> {
    let voxels = list.sorted();
    let centers = || voxels.iter().map(|(key, _)| list.center_m(*key));
    let is_single = centers().all(|center| center.amax() < SINGLE_M);
    let size = if is_single { 4 } else { 8 };
    let has_labels = list.payload().labels;
    let label = |text: &'static str| if has_labels { text } else { "" };
    let mut writer = BufWriter::new(writer);
    write!(
        writer,
        "# .PCD v0.7 - Point Cloud Data file format\n# {}\nVERSION 0.7\nFIELDS x y z intensity{}\n\
         SIZE {size} {size} {size} 4{}\nTYPE F F F F{}\nCOUNT 1 1 1 1{}\nWIDTH {points}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA binary\n",
        comment(list),
        label(" label"),
        label(" 4"),
        label(" U"),
        label(" 1"),
        points = voxels.len(),
    )?;
    for (key, voxel) in &voxels {
        for coordinate in list.center_m(*key).iter() {
            match is_single {
                true => writer.write_all(&(*coordinate as f32).to_le_bytes())?,
                false => writer.write_all(&coordinate.to_le_bytes())?,
            }
        }
        writer.write_all(&(voxel.count as f32).to_le_bytes())?;
        if has_labels {
            let label = list.label(*key).map_or(UNLABELED, |counted| counted.label);
            writer.write_all(&u32::from(label).to_le_bytes())?;
        }
    }
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use lattice_core::cloud::Cloud;
    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::Payload;
    use nalgebra::Vector3;

    use super::*;
    use crate::files::points::{PointFile, PointFileOptions, read_points};

    fn list(datum_m: Vector3<f64>, labels: Option<&[u16]>) -> VoxelList {
        let lattice = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
        let list = VoxelList::new(lattice, datum_m, 10).unwrap();
        let mut list = list.with_payload(Payload {
            labels: labels.is_some(),
            ..Payload::default()
        });
        let points = [[0.25, 0.0, 0.0], [-0.25, 0.25, 0.0], [0.0, 0.0, 5.125]];
        let points: Vec<_> = points.iter().map(|&p| datum_m + Vector3::from(p)).collect();
        let cloud = Cloud::from_points(0, datum_m, &points);
        list.insert_labelled(&cloud, labels.unwrap_or_default());
        list
    }

    fn written(list: &VoxelList) -> (Vec<u8>, PointFile) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.pcd");
        let mut bytes = Vec::new();
        write_centers_pcd(list, &mut bytes).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        (
            bytes,
            read_points(&path, &PointFileOptions::default()).unwrap(),
        )
    }

    #[test]
    fn centres_counts_and_labels_are_read_again() {
        let (bytes, file) = written(&list(Vector3::zeros(), Some(&[7, 7, UNLABELED])));
        assert_eq!(file.points_m, [[0.0; 3], [0.0, 0.0, 5.0]]);
        assert_eq!(file.labels, [7, UNLABELED]);
        let row = [0_f32, 0.0, 0.0, 2.0].map(f32::to_le_bytes).concat();
        let row = [&row[..], &7_u32.to_le_bytes()].concat();
        assert_eq!(&bytes[bytes.len() - 40..][..20], row);
        let header = String::from_utf8_lossy(&bytes[..bytes.len() - 40]).into_owned();
        assert!(
            header.contains("\nSIZE 4 4 4 4 4\nTYPE F F F F U\n"),
            "{header}"
        );
    }

    #[test]
    fn far_centres_keep_their_digits() {
        let far_m = Vector3::new(4.2e6, -5e5, 0.0);
        let (bytes, file) = written(&list(far_m, None));
        assert_eq!(file.points_m, [[4.2e6, -5e5, 0.0], [4.2e6, -5e5, 5.0]]);
        assert!(file.labels.is_empty());
        let header = String::from_utf8_lossy(&bytes).into_owned();
        assert!(header.contains("\nFIELDS x y z intensity\nSIZE 8 8 8 4\n"));
    }
}
