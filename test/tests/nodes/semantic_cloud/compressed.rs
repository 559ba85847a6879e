//! Depth images packed as PNG.

use std::sync::Arc;

use lattice_msgs::sensor_msgs::CompressedImage;
use lattice_nodes::semantic_cloud::{Camera, CloudOptions, SemanticCloud, Stream};
use lattice_test::clouds::header;
use serde_bytes::ByteBuf;

use super::scene::{Form, HEIGHT, WIDTH, camera_info, depth, labels, points};
use super::{CAMERAS, clouds};

/// Parameters of the quantization by which the transport packs by default, for 10 m.
const A: f32 = 10_100.0;
const B: f32 = 1.0 - A / 10.0;

fn png_file(width: u32, height: u32, color: png::ColorType, rows: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(rows)
        .unwrap();
    file
}

/// A message as the transport makes it of 16UC1 or 32FC1.
fn packed(camera: &Camera, encoding: &'static str) -> CompressedImage {
    let image = depth(camera, 7, Form::plain(encoding));
    let mut data = [0.0_f32, A, B]
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect::<Vec<_>>();
    let numbers: Vec<u16> = match encoding {
        "16UC1" => image
            .data
            .as_chunks()
            .0
            .iter()
            .map(|b| u16::from_le_bytes(*b))
            .collect(),
        _ => {
            let depths = image
                .data
                .as_chunks()
                .0
                .iter()
                .map(|b| f32::from_le_bytes(*b));
            depths.map(|z| (A / z + B) as u16).collect()
        }
    };
    let rows: Vec<u8> = numbers.into_iter().flat_map(u16::to_be_bytes).collect();
    data.extend(png_file(WIDTH, HEIGHT, png::ColorType::Grayscale, &rows));
    CompressedImage {
        header: header("camera", 7),
        format: format!("{encoding}; compressedDepth png"),
        data: ByteBuf::from(data),
    }
}

fn machine() -> (SemanticCloud, Camera) {
    let info = camera_info(CAMERAS[1].0, CAMERAS[1].1);
    let camera = Camera::new(&info, false).unwrap();
    let mut machine = SemanticCloud::new(CloudOptions::default());
    machine.on_camera_info(Arc::new(info));
    let labels = labels(&camera, 7, 1, Form::plain("mono8"));
    machine.on_image(Stream::Labels, Arc::new(labels));
    (machine, camera)
}

#[test]
fn packed_depth_makes_the_points_of_the_plain_one() {
    for (encoding, quantum) in [("16UC1", 1e-3), ("32FC1", 1.0 / f64::from(A))] {
        let (mut machine, camera) = machine();
        let clouds = clouds(machine.on_compressed_depth(&packed(&camera, encoding)));
        let points = points(&clouds[0]);
        assert!(points.len() > 17_000);
        for point in points {
            let (off_m, label) = point.truth(&camera, 1);
            let z_m = point.place_m.z;
            let step_m = if encoding == "32FC1" {
                quantum * z_m * z_m
            } else {
                quantum
            };
            assert!(
                off_m < 1.1 * step_m * point.place_m.norm() / z_m,
                "{encoding}: {off_m}"
            );
            assert_eq!(point.label, label);
        }
    }
}

type Spoil = fn(&mut CompressedImage);

#[test]
fn bad_files_are_refused_by_name_and_the_next_is_used() {
    let with_file = |m: &mut CompressedImage, file: Vec<u8>| {
        m.data.truncate(12);
        m.data.extend(file);
    };
    let spoilt: [(&str, &str, Spoil); 6] = [
        ("depth_encoding", "16UC1; compressedDepth rvl", |m| {
            m.format = "16UC1; compressedDepth rvl".into();
        }),
        ("depth_encoding", "'jpeg'", |m| m.format = "jpeg".into()),
        ("depth_malformed", "5 bytes, but 12", |m| m.data.truncate(5)),
        ("depth_malformed", "its PNG file", |m| m.data.truncate(2000)),
        ("depth_malformed", "its PNG file", |m| m.data.truncate(12)),
        ("depth_malformed", "not finite", |m| {
            m.format = "32FC1; compressedDepth".into();
            m.data[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
        }),
    ];
    let (mut machine, camera) = machine();
    let good = packed(&camera, "16UC1");
    let mut refuse = |bad: &CompressedImage, count: &str, problem: &str| {
        let before = machine.counts().dropped.get(count).copied().unwrap_or(0);
        assert!(machine.on_compressed_depth(bad).is_empty());
        assert_eq!(machine.counts().dropped[count], before + 1, "{count}");
        let said = machine.problem().unwrap();
        assert!(said.contains(problem), "{said}");
    };
    for (count, problem, spoil) in spoilt {
        let mut bad = good.clone();
        spoil(&mut bad);
        refuse(&bad, count, problem);
    }
    // The size in the header of the file, whose checksum is renewed by writing a wide one.
    let mut wide = good.clone();
    let rows = vec![0; 2 * 5_000_000];
    with_file(
        &mut wide,
        png_file(5_000_000, 1, png::ColorType::Grayscale, &rows),
    );
    refuse(&wide, "depth_too_large", "5000000 x 1 pixels");
    let mut colored = good.clone();
    with_file(&mut colored, png_file(1, 1, png::ColorType::Rgb, &[0; 6]));
    refuse(&colored, "depth_malformed", "not grey");
    assert_eq!(machine.on_compressed_depth(&good).len(), 1);
}
