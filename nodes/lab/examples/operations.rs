//! Quantizes or inserts the same points some times over, for tools that count what that takes.
//!
//! `operations OPERATION LATTICE CELL_SIDE_M FILE TIMES`, where OPERATION is batch, portable, scalar,
//! paper27, occupancy or list, and FILE holds little-endian f32 `x y z i`; prints the number of points.
#![allow(clippy::unwrap_used)]

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeKind, Simd};
use lattice_core::voxels::{OccupancyList, VoxelList, VoxelStore};
use lattice_lab::printed::Search27;
use nalgebra::{Isometry3, Vector3};
use std::hint::black_box;

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
    let run = of(operation, &lattice, points.clone());
    for _ in 0..times.parse::<usize>().unwrap() {
        run();
    }
    println!("{}", points.len());
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
        _ => panic!("no operation {operation}"),
    }
}
