//! Logs of a depth camera: maps of `lattice replay`, direct and over DDS, and by hand.

mod scene;

use std::fs;
use std::path::Path;

use lattice_core::voxels::VoxelList;
use lattice_core::voxels::file::MapContents;
use serde_json::Value;

use self::scene::{
    ALIGNED, CLOUDS, Cells, DEPTH, FRAMES, Log, color_reference, difference, reference,
};
use crate::lattice;

/// Arguments of replays of depth images: all pixels become points.
const ALL_PIXELS: [&str; 2] = ["-p", "edge_jump:=0.0"];
/// Arguments of each replay: the cells of the reference.
const BASE: [&str; 8] = [
    "--lattice",
    "cubic",
    "--cell-size",
    "0.1",
    "-p",
    "keep_labels:=true",
    "--json",
    "--map-out",
];

/// A replay of a log: its report, its choices, and the map.
struct Replayed {
    report: Value,
    errors: String,
    map: VoxelList,
}

fn replay(log: &Path, arguments: &[&str]) -> Replayed {
    replay_clouds(log, &[&ALL_PIXELS, arguments].concat())
}

fn replay_clouds(log: &Path, arguments: &[&str]) -> Replayed {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("map.lattice");
    let (log, path) = (log.display().to_string(), map.display().to_string());
    let all = [&["replay", &log], &BASE[..], &[&path], arguments].concat();
    let output = lattice(&all);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{all:?}: {errors}");
    let map = MapContents::read(&fs::read(map).unwrap()[..], usize::MAX).unwrap();
    Replayed {
        report: serde_json::from_slice(&output.stdout).unwrap(),
        errors,
        map: map.into_list(usize::MAX),
    }
}

/// Standard error of a replay that must end with status 1.
fn refused(log: &Path, arguments: &[&str]) -> String {
    let log = log.display().to_string();
    let output = lattice(&[&["replay", &log, "--direct"], arguments].concat());
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

impl Replayed {
    fn cells(&self) -> Cells {
        let datum = self.map.datum_index();
        let cell = |(key, voxel): (_, lattice_core::voxels::Voxel)| {
            let index: [i32; 3] = lattice_core::lattice::MortonKey::unpack(key);
            let index = [0, 1, 2].map(|i| i64::from(index[i]) + datum[i]);
            let labels = self.map.labels(key).into_iter();
            let mut labels: std::collections::BTreeMap<u16, u32> =
                labels.map(|of| (of.label, of.count)).collect();
            let rest = voxel.count - labels.values().sum::<u32>();
            if rest > 0 {
                labels.insert(u16::MAX, rest);
            }
            (index, labels)
        };
        self.map.sorted().into_iter().map(cell).collect()
    }

    /// Checks the map against the projection by hand, up to points on the borders of cells.
    fn check(&self, with_labels: bool, frames: impl IntoIterator<Item = i64>) {
        let (expected, near) = reference(with_labels, frames);
        let found = self.cells();
        let apart = difference(&found, &expected);
        let points: u32 = expected.values().flat_map(|labels| labels.values()).sum();
        assert!(near < points / 500, "{near} of {points} points at borders");
        assert!(
            apart <= 2 * near,
            "{apart} of {points} points, {near} at borders"
        );
    }

    /// Mean colours and their numbers of points, in the order of the keys.
    fn colors(&self) -> Vec<Option<(u32, [u8; 3])>> {
        let color = |key: &_| {
            let color = self.map.color(*key)?;
            Some((color.count, color.mean()?))
        };
        self.map
            .sorted()
            .iter()
            .map(|(key, _)| color(key))
            .collect()
    }

    /// Checks the mean colours to 1 of 255 in the cells that have the points of those by hand.
    fn check_colors(&self) {
        let expected = color_reference();
        let mut same = 0;
        let datum = self.map.datum_index();
        for ((key, _), color) in self.map.sorted().into_iter().zip(self.colors()) {
            let index = key.unpack();
            let cell = [0, 1, 2].map(|i: usize| i64::from(index[i]) + datum[i]);
            let (count, mean) = color.unwrap();
            let Some((_, sum)) = expected.get(&cell).filter(|(points, _)| *points == count) else {
                continue;
            };
            same += 1;
            let exact = sum.map(|sum| sum / f64::from(count));
            let apart = mean
                .iter()
                .zip(exact)
                .map(|(m, e)| (f64::from(*m) - e).abs());
            assert!(
                apart.fold(0.0, f64::max) <= 1.0,
                "{cell:?}: {mean:?}, {exact:?}"
            );
        }
        assert!(
            50 * same > 49 * expected.len(),
            "{same} of {}",
            expected.len()
        );
    }

    fn camera(&self) -> &Value {
        &self.report["cameras"][0]
    }

    fn says(&self, texts: &[&str]) {
        for text in texts {
            assert!(self.errors.contains(text), "no '{text}' in {}", self.errors);
        }
    }
}

fn written(log: Log) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    log.write(&folder.path().join("log"));
    folder
}

/// Checks the direct map of a log by hand, and that of DDS by the direct one.
fn check_both(log: Log, arguments: &[&str]) -> Replayed {
    let folder = written(log);
    let path = folder.path().join("log");
    let direct = replay(&path, &[&["--direct"], arguments].concat());
    direct.check(log.with_labels, 0..FRAMES);
    let of_dds = replay(&path, arguments);
    assert!(
        of_dds.map.sorted() == direct.map.sorted(),
        "{}",
        of_dds.errors
    );
    assert_eq!(of_dds.cells(), direct.cells());
    assert_eq!(of_dds.colors(), direct.colors());
    for replayed in [&direct, &of_dds] {
        let camera = replayed.camera();
        assert_eq!(camera["topic"], log.depth(), "{camera}");
        assert_eq!(camera["depth_in"], FRAMES, "{camera}");
        assert_eq!(camera["clouds_out"], FRAMES, "{camera}");
        assert_eq!(replayed.report["clouds_in_log"], FRAMES);
        assert_eq!(camera["pixels_no_depth"], FRAMES * 60, "{camera}");
    }
    direct
}

#[test]
fn depth_images_alone_give_the_map_by_hand_directly_and_over_dds() {
    let direct = check_both(Log::default(), &[]);
    direct.says(&[
        "clouds: /camera/depth/image_rect_raw (16 messages)",
        "of base_link in odom",
        "calibration /camera/depth/camera_info, labels none, colours none",
    ]);
}

#[test]
fn labels_that_come_a_second_late_are_in_the_map() {
    let log = Log {
        with_labels: true,
        with_colors: true,
        ..Log::default()
    };
    let direct = check_both(log, &[]);
    direct.says(&["labels /segmentation/labels (`labels: none` leaves them out)"]);
    assert_eq!(direct.camera()["points_unlabelled"], 0);
    let folder = written(log);
    let path = folder.path().join("log");
    let without = replay(&path, &["--direct", "-p", "labels:=none"]);
    without.check(false, 0..FRAMES);
    assert_eq!(without.camera()["labels_in"], 0);
}

#[test]
fn compressed_depth_with_colours_gives_the_same_map() {
    let log = Log {
        is_compressed: true,
        with_colors: true,
        ..Log::default()
    };
    let direct = check_both(log, &["-p", "use_color:=true", "-p", "keep_color:=true"]);
    direct.check_colors();
    assert_eq!(direct.camera()["color_in"], FRAMES);
    direct.says(&["colours /camera/color/image_raw"]);
}

#[test]
fn clouds_of_a_log_come_before_its_depth_images() {
    let folder = written(Log {
        with_clouds: true,
        ..Log::default()
    });
    let path = folder.path().join("log");
    let of_clouds = replay_clouds(&path, &["--direct"]);
    of_clouds.check(false, 0..FRAMES);
    of_clouds.says(&[
        "clouds: /camera/points (16 messages)",
        "not taken: /camera/depth/image_rect_raw (depth images, in a log with clouds; \
         --points /camera/depth/image_rect_raw takes it)",
    ]);
    assert!(of_clouds.report["cameras"].is_null());
    let of_depth = replay(&path, &["--direct", "--points", DEPTH]);
    assert!(of_depth.map.sorted() == of_clouds.map.sorted());
    let both = replay(&path, &["--direct", "--points", CLOUDS, "--points", DEPTH]);
    assert_eq!(both.report["clouds_in_log"], 2 * FRAMES);
    let twice = |cells: Cells| {
        let labels = |labels: std::collections::BTreeMap<u16, u32>| {
            labels
                .into_iter()
                .map(|(label, count)| (label, 2 * count))
                .collect()
        };
        let cells = cells.into_iter().map(|(cell, of)| (cell, labels(of)));
        cells.collect::<Cells>()
    };
    assert_eq!(both.cells(), twice(of_clouds.cells()));
    // Parameters of depth cameras have no use there.
    let errors = refused(&path, &["-p", "stride:=2"]);
    assert!(errors.contains("stride"), "{errors}");
}

#[test]
fn of_two_depth_topics_of_a_sensor_the_one_with_labels_is_taken() {
    let folder = written(Log {
        with_labels: true,
        with_aligned: true,
        ..Log::default()
    });
    let path = folder.path().join("log");
    let labelled = replay(&path, &["--direct"]);
    labelled.check(true, 0..FRAMES);
    labelled.says(&[
        "clouds: /camera/aligned_depth_to_color/image_raw (16 messages)",
        "not taken: /camera/depth/image_rect_raw (of the sensor of /camera/aligned_depth_to_color/image_raw; ",
    ]);
    let raw = replay(&path, &["--direct", "-p", "labels:=none"]);
    raw.check(false, 0..FRAMES);
    raw.says(&["clouds: /camera/depth/image_rect_raw (16 messages)"]);
    let both = ["--points", DEPTH, "--points", ALIGNED];
    let direct = replay(&path, &[&["--direct"][..], &both].concat());
    let of_dds = replay(&path, &both);
    assert_eq!(direct.report["cameras"].as_array().unwrap().len(), 2);
    assert_eq!(direct.report["clouds_in_log"], 2 * FRAMES);
    assert!(
        of_dds.map.sorted() == direct.map.sorted(),
        "{}",
        of_dds.errors
    );
    assert_eq!(of_dds.cells(), direct.cells());
}

#[test]
fn slices_of_a_log_are_the_whole_together() {
    let log = Log {
        with_labels: true,
        ..Log::default()
    };
    let folder = written(log);
    let path = folder.path().join("log");
    let first = replay(&path, &["--direct", "--stop", "0.4"]);
    let second = replay(&path, &["--direct", "--start", "0.4"]);
    let frames = first.camera()["clouds_out"].as_i64().unwrap();
    assert!((1..FRAMES).contains(&frames), "{frames}");
    first.check(true, 0..frames);
    second.check(true, frames..FRAMES);
}

#[test]
fn what_is_lost_is_counted_by_reason_with_its_remedy() {
    let log = Log {
        damaged: Some(3),
        ..Log::default()
    };
    let folder = written(log);
    let path = folder.path().join("log");
    let direct = replay(&path, &["--direct"]);
    direct.check(false, (0..FRAMES).filter(|frame| *frame != 3));
    assert_eq!(direct.camera()["dropped"]["depth_malformed"], 1);
    let log = path.display().to_string();
    let output = lattice(&["replay", &log, "--direct"]);
    let shown = String::from_utf8_lossy(&output.stdout).into_owned();
    for text in [
        "/camera/depth/image_rect_raw: 16 depth images, 15 clouds",
        "dropped: 1 of 16 depth images on /camera/depth/image_rect_raw: depth_malformed",
        "last rejection on /camera/depth/image_rect_raw: depth: 100 bytes",
    ] {
        assert!(shown.contains(text), "no '{text}' in {shown}");
    }
    let tiny = ["-p", "max_image_pixels:=10"];
    let errors = refused(&path, &tiny);
    let cause = "nothing was mapped: none of 16 depth images on /camera/depth/image_rect_raw became a cloud";
    assert!(
        errors.contains(cause) && errors.contains("`max_image_pixels`"),
        "{errors}"
    );
}

#[test]
fn logs_that_cannot_be_mapped_are_refused_with_the_remedy() {
    let without_info = written(Log {
        without_info: true,
        ..Log::default()
    });
    let without_poses = written(Log {
        without_poses: true,
        ..Log::default()
    });
    let whole = written(Log::default());
    let log = |folder: &tempfile::TempDir| folder.path().join("log");
    let cases: [(_, &[&str], &[&str]); 5] = [
        (
            log(&without_info),
            &[],
            &[
                "/camera/depth/image_rect_raw has depth images (16UC1), but no camera_info",
                "record /camera/depth/camera_info too",
            ],
        ),
        (
            log(&without_poses),
            &[],
            &[
                "no poses in the log for the depth images of /camera/depth/image_rect_raw",
                "nav_msgs/msg/Odometry",
            ],
        ),
        (
            log(&whole),
            &["-p", "labels:=image"],
            &[
                "no labels in its frame 'camera_depth_optical_frame'",
                "`labels: none`",
            ],
        ),
        (
            log(&whole),
            &["-p", "use_color:=true"],
            &["no colours in its frame", "`use_color: false`"],
        ),
        (
            log(&whole),
            &["--points", "/nothing"],
            &[
                "no topic '/nothing'",
                "/camera/depth/image_rect_raw (sensor_msgs/msg/Image)",
            ],
        ),
    ];
    for (log, arguments, texts) in cases {
        let errors = refused(&log, arguments);
        for text in texts {
            assert!(
                errors.contains(text),
                "{arguments:?}: no '{text}' in {errors}"
            );
        }
    }
}
