//! Map files of rolling ground, voxels per second: `cargo bench -p lattice_core --bench map_file`.
#![allow(clippy::unwrap_used)]

use divan::counter::ItemsCount;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::VoxelList;
use lattice_core::voxels::codec::{decode_keys, encode_keys};
use lattice_core::voxels::file::{
    MapContents, WriteOptions, read_map, read_occupancy, write_occupancy,
};
use nalgebra::Vector3;

const KINDS: [&str; 3] = ["cubic", "bcc", "fcc"];

const BARE: WriteOptions = WriteOptions {
    zstd_level: None,
    occupancy_only: true,
};

fn main() {
    divan::main();
}

/// A hill side of 100 m by 100 m in cells of 0.1 m: some million voxels.
fn map(kind: &str) -> MapContents {
    let lattice = Lattice::new(kind.parse::<LatticeKind>().unwrap(), 0.001).unwrap();
    let points = (0..2500 * 2500).map(|i| {
        let (x, y) = ((i % 2500) as f32 * 0.04, (i / 2500) as f32 * 0.04);
        [x, y, 2.0 * (0.11 * x).sin() + (0.23 * y).cos()]
    });
    let mut list = VoxelList::new(lattice, Vector3::zeros(), usize::MAX).unwrap();
    list.insert(&Cloud {
        stamp_ns: 0,
        datum_m: Vector3::zeros(),
        offsets_m: points.collect(),
    });
    MapContents::from_list(&list)
}

fn bytes(map: &MapContents, options: &WriteOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    map.write(&mut bytes, options).unwrap();
    bytes
}

fn voxels(map: &MapContents) -> ItemsCount {
    ItemsCount::new(map.keys().len())
}

#[divan::bench(args = KINDS)]
fn save_occupancy(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    bencher.counter(voxels(&map)).bench(|| bytes(&map, &BARE));
}

#[divan::bench(args = KINDS)]
fn load_occupancy(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    let file = bytes(&map, &BARE);
    bencher
        .counter(voxels(&map))
        .bench(|| MapContents::read(&file[..], usize::MAX).unwrap());
}

#[divan::bench(args = KINDS)]
fn save_occupancy_of_a_list(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    let count = voxels(&map);
    let list = map.into_occupancy(usize::MAX);
    bencher.counter(count).bench(|| {
        let mut bytes = Vec::new();
        write_occupancy(&list, &mut bytes, &BARE).unwrap();
        bytes
    });
}

#[divan::bench(args = KINDS)]
fn load_occupancy_into_a_list(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    let file = bytes(&map, &BARE);
    bencher
        .counter(voxels(&map))
        .bench(|| read_occupancy(&file[..], usize::MAX).unwrap());
}

#[divan::bench(args = KINDS)]
fn encode(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    bencher
        .counter(voxels(&map))
        .bench(|| encode_keys(map.keys()));
}

#[divan::bench(args = KINDS)]
fn decode(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    let keys = encode_keys(map.keys());
    bencher
        .counter(voxels(&map))
        .bench(|| decode_keys(&keys, usize::MAX).unwrap());
}

#[divan::bench(args = KINDS)]
fn save_payload(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    bencher
        .counter(voxels(&map))
        .bench(|| bytes(&map, &WriteOptions::default()));
}

#[divan::bench(args = KINDS)]
fn load_payload(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    let file = bytes(&map, &WriteOptions::default());
    bencher
        .counter(voxels(&map))
        .bench(|| MapContents::read(&file[..], usize::MAX).unwrap());
}

#[divan::bench(args = ["fcc"])]
fn load_payload_into_a_list(bencher: divan::Bencher, kind: &str) {
    let map = map(kind);
    let file = bytes(&map, &WriteOptions::default());
    bencher
        .counter(voxels(&map))
        .bench(|| read_map(&file[..], usize::MAX).unwrap());
}
