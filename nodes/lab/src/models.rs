//! Networks that come with the laboratory.

use crate::AnyError;
use lattice_nodes::files::atomic_write;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A network for rendered rooms, ONNX: 3 x 144 x 192 in, logits of the 18 classes of
/// [`House`](crate::simulate::house::House) at half the size out. `test/segmentation` says how it was trained.
pub const ROOMS_ONNX: &[u8] = include_bytes!("../models/rooms.onnx");

/// Writes [`ROOMS_ONNX`] to `rooms.onnx` in a folder, for nodes to read, and gives its path.
pub fn write_rooms(folder: &Path) -> Result<PathBuf, AnyError> {
    let path = folder.join("rooms.onnx");
    atomic_write::write(&path, |file| file.write_all(ROOMS_ONNX))?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_is_small_and_written_as_it_is() {
        // Parameters of 4 bytes and what is around them: fewer than half a million.
        assert!((100_000..2_000_000).contains(&ROOMS_ONNX.len()));
        let folder = tempfile::tempdir().unwrap();
        let path = write_rooms(folder.path()).unwrap();
        assert_eq!(std::fs::read(path).unwrap(), ROOMS_ONNX);
    }

    /// Share of pixels that are labelled rightly in views of rooms that it was not trained on.
    #[cfg(feature = "onnx")]
    #[test]
    fn the_network_labels_rooms_that_it_has_not_seen() {
        use crate::simulate::house::{House, RoomCamera, RoomImages, look_views, robot_views};
        use lattice_msgs::std_msgs::Header;
        use lattice_nodes::segmenter::{Segmenter, SegmenterOptions, read_network};

        let folder = tempfile::tempdir().unwrap();
        let network = read_network(&write_rooms(folder.path()).unwrap(), None, 1).unwrap();
        let house = House::generated(41).unwrap();
        let names = house.class_names().values();
        assert!(names.eq(network.names()));
        let mut machine = Segmenter::new(SegmenterOptions::default(), network);
        let rooms = RoomImages::new(&house, 42);
        let robot = robot_views(&house, 16, 43).unwrap();
        let robot = robot.iter().map(|view| (RoomCamera::ROBOT, view.truth));
        let looks = look_views(&house, 16, 43).unwrap();
        let looks = looks.into_iter().map(|pose| (RoomCamera::HEADSET, pose));
        let (mut right, mut all) = (0, 0);
        for (number, (camera, pose)) in robot.chain(looks).enumerate() {
            let image = rooms.take(&camera, &pose, number as u64);
            let labelled = machine.on_image(&image.colors_message(Header::default()));
            let labels = labelled.unwrap().labels;
            let [width, height] = [labels.width, labels.height].map(|side| side as usize);
            for (pixel, label) in image.labels.iter().enumerate() {
                let column = (pixel % image.width) * width / image.width;
                let row = (pixel / image.width) * height / image.height;
                let found = labels.data[row * width + column];
                all += 1;
                right += usize::from(u16::from(found) == *label);
            }
        }
        let share = right as f64 / all as f64;
        println!("{:.1} % of the pixels are right", 100.0 * share);
        assert!(share > 0.5, "{share}");
    }
}
