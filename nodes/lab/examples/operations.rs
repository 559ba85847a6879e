//! Quantizes, inserts or transforms the same points some times over, for tools that count what that takes.
//!
//! `operations OPERATION LATTICE CELL_SIDE_M FILE TIMES`, where OPERATION is batch, portable, scalar,
//! paper27, occupancy, list, rays (occupied and free cells, scan by scan from FILE.scans), transform (all points at the
//! stamp), deskew (times of 1024 columns are read, and each has its pose) or viewpoints (which are written too), and FILE holds
//! little-endian f32 `x y z i`; prints the number of points.
#![allow(clippy::unwrap_used)]

use lattice_core::cloud::{
    Cloud, CloudLayout, CloudLimits, Datatype, PointField, RangeLimits, RecordFormat, TimeOptions,
    transform_records,
};
use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeKind, Simd};
use lattice_core::raycast::{FreeSpaceMap, FreeSpaceOptions, RayBundle};
use lattice_core::voxels::{OccupancyList, VoxelList, VoxelStore};
use lattice_lab::bench::read_scans;
use lattice_lab::paper_values::Search27;
use nalgebra::{Isometry3, Vector3};
use std::convert::Infallible;
use std::hint::black_box;
use std::path::Path;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [operation, kind, side_m, file, times] = arguments.as_slice() else {
        eprintln!("usage: operations OPERATION LATTICE CELL_SIDE_M FILE TIMES");
        std::process::exit(2);
    };
    let kind: LatticeKind = kind.parse().unwrap();
    let lattice = Lattice::new(kind, side_m.parse::<f64>().unwrap().powi(3)).unwrap();
    let bytes = std::fs::read(file).unwrap();
    let number = |i: usize| f32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap());
    let points: Vec<[f32; 3]> = (0..bytes.len() / 16)
        .map(|i| [0, 1, 2].map(|axis| number(4 * i + axis)))
        .collect();
    let run = match operation.as_str() {
        "rays" => rays(&lattice, &points, Path::new(file)),
        _ => of(operation, &lattice, points.clone()),
    };
    for _ in 0..times.parse::<usize>().unwrap() {
        run();
    }
    println!("{}", points.len());
}

/// Free space of all scans. The clock of `lattice_lab::bench` does not run under valgrind.
fn rays(lattice: &Lattice, points: &[[f32; 3]], file: &Path) -> Box<dyn Fn()> {
    let lattice = lattice.clone();
    let mut left = points;
    let scans = read_scans(file, points.len()).unwrap().into_iter();
    let scans: Vec<(Vector3<f64>, Cloud)> = scans
        .map(|scan| {
            let (ends, rest) = left.split_at(scan.points);
            left = rest;
            let offsets_m = ends.to_vec();
            let datum_m = Vector3::zeros();
            let cloud = Cloud {
                stamp_ns: 0,
                datum_m,
                offsets_m,
            };
            (scan.origin_m, cloud)
        })
        .collect();
    Box::new(move || {
        let options = FreeSpaceOptions::default();
        let mut map = FreeSpaceMap::new(lattice.clone(), Vector3::zeros(), options).unwrap();
        for (origin_m, ends) in &scans {
            black_box(map.insert_scan(&[RayBundle {
                origin_m: *origin_m,
                ends,
            }]));
        }
    })
}

/// One operation on all points.
fn of(operation: &str, lattice: &Lattice, points: Vec<[f32; 3]>) -> Box<dyn Fn()> {
    let lattice = lattice.clone();
    let batch = |simd| BatchQuantizer::with_simd(&lattice, Isometry3::identity(), simd);
    let room = || Vec::with_capacity(points.len());
    match operation {
        "batch" | "portable" => {
            let batch = batch(match operation {
                "batch" => Simd::detect(),
                _ => Simd::Portable,
            });
            Box::new(move || {
                let mut codes = Vec::with_capacity(points.len());
                batch.codes(&points, &mut codes);
                black_box(codes);
            })
        }
        "scalar" => Box::new(move || {
            let mut codes: Vec<BlockKey> = Vec::with_capacity(points.len());
            let wide = points.iter().map(|p| p.map(f64::from));
            lattice.quantize_each(wide, |_, w| codes.extend(w.and_then(BlockKey::pack)));
            black_box(codes);
        }),
        "paper27" => {
            let search = Search27::new(&lattice, Simd::detect()).unwrap();
            let mut codes: Vec<BlockKey> = room();
            codes.resize(points.len(), BlockKey::NONE);
            Box::new(move || {
                let mut codes = codes.clone();
                search.codes(&points, &mut codes);
                black_box(codes);
            })
        }
        "occupancy" | "list" => {
            let cloud = Cloud {
                stamp_ns: 0,
                datum_m: Vector3::zeros(),
                offsets_m: points,
            };
            let bits = operation == "occupancy";
            Box::new(move || {
                let (lattice, datum_m) = (lattice.clone(), Vector3::zeros());
                if bits {
                    let mut store = OccupancyList::new(lattice, datum_m, 1 << 30).unwrap();
                    store.insert(&cloud);
                    black_box(store.len());
                } else {
                    let mut store = VoxelList::new(lattice, datum_m, 1 << 24).unwrap();
                    store.insert(&cloud);
                    black_box(store.len());
                }
            })
        }
        "transform" | "deskew" | "viewpoints" => {
            let (layout, data) = timed(&points);
            let is_deskewed = operation != "transform";
            let with_viewpoints = operation == "viewpoints";
            Box::new(move || {
                let view = layout.view(&data, &CloudLimits::default()).unwrap();
                let options = TimeOptions::default();
                let times = is_deskewed.then(|| view.point_times(0, &options).unwrap().times_ns);
                let format = RecordFormat::new(&view, &[], None, with_viewpoints);
                let times = times.flatten();
                let range = RangeLimits::default();
                let at = |ns| Ok::<_, Infallible>(pose(ns));
                black_box(transform_records(
                    &view,
                    0,
                    times.as_deref(),
                    &range,
                    &format,
                    at,
                ))
                .unwrap();
            })
        }
        _ => panic!("no operation {operation}"),
    }
}

/// Pose of a machine that drives and turns.
fn pose(stamp_ns: i64) -> Isometry3<f64> {
    let t = stamp_ns as f64 * 1.0e-9;
    Isometry3::new(Vector3::new(10.0 * t, 0.0, 2.0), Vector3::new(0.0, 0.01, t))
}

/// A cloud of records with the times of 1024 columns in 0.1 s.
fn timed(points: &[[f32; 3]]) -> (CloudLayout, Vec<u8>) {
    let field = |(name, offset, datatype): (&str, u32, Datatype)| PointField {
        name: name.to_owned(),
        offset,
        datatype: datatype as u8,
        count: 1,
    };
    let (float, number) = (Datatype::Float32, Datatype::Uint32);
    let places = [
        ("x", 0, float),
        ("y", 4, float),
        ("z", 8, float),
        ("t", 12, number),
    ];
    let width = u32::try_from(points.len()).unwrap();
    let mut data = Vec::with_capacity(16 * points.len());
    for (i, point) in points.iter().enumerate() {
        data.extend(point.iter().flat_map(|v| v.to_le_bytes()));
        data.extend((i as u32 % 1024 * 97_656).to_le_bytes());
    }
    let layout = CloudLayout {
        width,
        height: 1,
        point_step: 16,
        row_step: 16 * width,
        is_bigendian: false,
        fields: places.map(field).into(),
    };
    (layout, data)
}
