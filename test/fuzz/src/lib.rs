//! Bodies of the fuzz targets, and the seeds they start from.
//!
//! Everything here panics where the library breaks a promise. The tests of the workspace include
//! this file, so that it holds without a fuzzer too.
#![allow(missing_docs)]

pub mod connected;
pub mod read;
pub mod received;

use std::collections::BTreeMap;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::file::{MapContents, WriteOptions, max_voxels_of, read_occupancy};
use lattice_core::voxels::{
    InsertReport, OFFSET_UNIT_M, OccupancyList, Payload, VoxelList, VoxelStore,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Reads bytes as a map file, as they are and with checksums that fit.
pub fn map_file(bytes: &[u8]) {
    read_and_write(bytes);
    let mut mended = bytes.to_vec();
    mend_checksums(&mut mended);
    read_and_write(&mended);
}

fn read_and_write(bytes: &[u8]) {
    let most = max_voxels_of(bytes.len() as u64);
    let Ok(map) = MapContents::read(bytes, most) else {
        return;
    };
    assert!(map.keys().is_sorted_by(|a, b| a < b));
    for zstd_level in [None, Some(1)] {
        let file = written(&map, zstd_level, map.voxels().is_none());
        let back = MapContents::read(&file[..], map.keys().len()).unwrap();
        assert_eq!(back, map);
        assert_eq!(written(&back, zstd_level, map.voxels().is_none()), file);
    }
    let cells = read_occupancy(bytes, usize::MAX).unwrap();
    cells.validate().unwrap();
    assert_eq!(cells.sorted_keys(), map.keys());
    if map.voxels().is_some() {
        let list = map.clone().into_list(usize::MAX);
        list.validate().unwrap();
        assert_eq!(MapContents::from_list(&list), map);
    }
    assert!(MapContents::read(&bytes[..bytes.len() - 1], most).is_err());
}

/// The map as a file.
fn written(map: &MapContents, zstd_level: Option<i32>, occupancy_only: bool) -> Vec<u8> {
    let options = WriteOptions {
        zstd_level,
        occupancy_only,
    };
    let mut file = Vec::new();
    map.write(&mut file, &options).unwrap();
    file
}

/// CRC-32 of zip, bit by bit.
pub fn crc32(bytes: &[u8]) -> [u8; 4] {
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
        }
    }
    (!crc).to_le_bytes()
}

/// Makes every checksum of a map file right, as far as the lengths in it lead.
pub fn mend_checksums(file: &mut [u8]) {
    if file.len() < 232 {
        return;
    }
    let head = crc32(&file[..220]);
    file[220..224].copy_from_slice(&head);
    let mut at = 224;
    while at + 48 <= file.len() && &file[at..at + 4] == b"SECT" {
        let stored = u64::from_le_bytes(file[at + 32..at + 40].try_into().unwrap());
        let end = usize::try_from(stored)
            .ok()
            .and_then(|n| n.checked_add(at + 48));
        let Some(end) = end.filter(|&end| end <= file.len()) else {
            break;
        };
        let crc = crc32(&file[at + 48..end]);
        file[at + 40..at + 44].copy_from_slice(&crc);
        let crc = crc32(&file[at..at + 44]);
        file[at + 44..at + 48].copy_from_slice(&crc);
        at = end;
    }
    let end = file.len() - 4;
    let crc = crc32(&file[..end]);
    file[end..].copy_from_slice(&crc);
}

/// Takes values off the front of the input; zeros when it has ended.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn array<const N: usize>(&mut self) -> [u8; N] {
        let (taken, rest) = self.0.split_at(self.0.len().min(N));
        self.0 = rest;
        let mut array = [0; N];
        array[..taken.len()].copy_from_slice(taken);
        array
    }

    fn byte(&mut self) -> u8 {
        self.array::<1>()[0]
    }

    /// Any f64, or a small or large plain one.
    fn coordinate(&mut self) -> f64 {
        match self.byte() % 4 {
            0 => f64::from_le_bytes(self.array()),
            1 => f64::from(i16::from_le_bytes(self.array())) / 256.0,
            2 => f64::from(i32::from_le_bytes(self.array())) / 64.0,
            _ => 0.0,
        }
    }
}

/// Inserts a hostile cloud into both stores and compares with one point at a time.
pub fn insert(bytes: &[u8]) {
    let mut input = Input(bytes);
    let kind = LatticeKind::ALL[usize::from(input.byte()) % LatticeKind::ALL.len()];
    let volume_m3 = (f64::from(input.byte() % 60) - 29.5).exp2();
    let lattice = Lattice::new(kind, volume_m3).unwrap();
    let max_voxels = match input.byte() {
        0 => usize::MAX,
        few => usize::from(few) - 1,
    };
    let repeat = match input.byte() {
        many @ 250.. => 100 * usize::from(many - 249),
        few => 1 + usize::from(few % 3),
    };
    let datum_near_m = Vector3::from_fn(|_, _| input.coordinate());
    let datum_m = Vector3::from_fn(|_, _| input.coordinate());
    let plain = input.byte() % 2 == 1;
    let mut points = Vec::new();
    while !input.0.is_empty() && points.len() < 1000 {
        points.push(if plain {
            input.array::<3>().map(|x| f32::from(x as i8) / 32.0)
        } else {
            [(); 3].map(|()| f32::from_le_bytes(input.array()))
        });
    }
    let cloud = Cloud {
        stamp_ns: 0,
        datum_m,
        offsets_m: points.repeat(repeat),
    };
    let Ok(mut list) = VoxelList::new(lattice.clone(), datum_near_m, max_voxels) else {
        return;
    };
    let report = list.insert(&cloud);
    list.validate().unwrap();
    let (voxels, expected) = reference(&lattice, list.datum_m(), max_voxels, &cloud);
    assert_eq!(report, expected);
    assert_eq!(list.len(), voxels.len());
    let tolerance = 1e-6 * lattice.covering_radius_m() / OFFSET_UNIT_M + 1.5;
    for (key, voxel) in list.sorted() {
        let (count, sum_m) = voxels[&key];
        assert_eq!(voxel.count, count);
        for (sum, sum_m) in voxel.sum.iter().zip(sum_m) {
            let error = (*sum as f64 - sum_m / OFFSET_UNIT_M).abs();
            assert!(error <= f64::from(count) * tolerance, "off by {error}");
        }
    }

    let mut occupancy = OccupancyList::new(lattice.clone(), datum_near_m, usize::MAX).unwrap();
    VoxelStore::insert(&mut occupancy, &cloud);
    occupancy.validate().unwrap();
    let (voxels, _) = reference(&lattice, list.datum_m(), usize::MAX, &cloud);
    assert!(occupancy.sorted_keys().iter().eq(voxels.keys()));
}

type Voxels = BTreeMap<MortonKey, (u32, [f64; 3])>;

/// Count and sum of offsets (metres) of every cell, one point after the other.
fn reference(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    max_voxels: usize,
    cloud: &Cloud,
) -> (Voxels, InsertReport) {
    let mut voxels = Voxels::new();
    let mut report = InsertReport {
        points: cloud.offsets_m.len() as u64,
        ..InsertReport::default()
    };
    let base_m = cloud.datum_m - datum_m;
    for offset_m in &cloud.offsets_m {
        let p_m = base_m + Vector3::from(offset_m.map(f64::from));
        let cell = lattice.quantize(&p_m);
        let Some((w, key)) = cell.and_then(|w| MortonKey::pack(w).map(|key| (w, key))) else {
            let finite = p_m.iter().all(|x| x.is_finite());
            report.out_of_range += u64::from(finite);
            report.not_finite += u64::from(!finite);
            continue;
        };
        if !voxels.contains_key(&key) && voxels.len() >= max_voxels {
            report.list_full += 1;
            continue;
        }
        let (count, sum_m) = voxels.entry(key).or_default();
        let from_center_m = p_m - lattice.center(w);
        *count += 1;
        (0..3).for_each(|axis| sum_m[axis] += from_center_m[axis]);
        report.inserted += 1;
    }
    report.new_voxels = voxels.len() as u64;
    (voxels, report)
}

/// Files of a custom and of a turned lattice with all columns.
fn detailed_maps() -> Vec<Vec<u8>> {
    let basis = Matrix3::new(0.5, 0.1, 0.0, 0.0, 0.4, 0.2, 0.1, -0.1, 0.6);
    let custom = Lattice::from_basis(basis).unwrap();
    let turn = UnitQuaternion::from_euler_angles(0.3, -1.2, 2.5);
    let fcc = Lattice::new(LatticeKind::Fcc, 0.125).unwrap();
    let mut files = Vec::new();
    for lattice in [custom.clone(), custom.oriented(turn), fcc.oriented(turn)] {
        let list = VoxelList::new(lattice, Vector3::zeros(), usize::MAX).unwrap();
        let mut list = list.with_payload(Payload {
            stamps: true,
            labels: true,
            color: true,
        });
        for scan in 0..2 {
            let cloud = Cloud {
                stamp_ns: scan * 1_700_000_000_000_000_000,
                datum_m: Vector3::zeros(),
                offsets_m: (0..30).map(|i| [0.1 * i as f32, 0.2, 0.3]).collect(),
            };
            let labels: Vec<u16> = (0..25).map(|i| i % 3 * 30_000).collect();
            list.insert_labelled(&cloud, &labels);
        }
        let map = MapContents::from_list(&list);
        files.extend([None, Some(3)].map(|zstd_level| written(&map, zstd_level, false)));
    }
    files
}

/// A target: its name, its body, and inputs to start from.
pub type Target = (&'static str, fn(&[u8]), fn() -> Vec<Vec<u8>>);

/// All targets.
pub const TARGETS: [Target; 12] = [
    ("map_file", map_file, || map_and_cloud_seeds().0),
    ("insert", insert, || map_and_cloud_seeds().1),
    ("message", received::message, received::message_seeds),
    ("cloud", received::cloud, received::cloud_seeds),
    ("follower", received::follower, received::follower_seeds),
    ("params", read::params, read::params_seeds),
    ("ros_args", read::ros_args, read::ros_args_seeds),
    ("bag", read::bag, read::bag_seeds),
    ("points", read::points, read::points_seeds),
    ("mesh", read::mesh, read::mesh_seeds),
    ("http_head", connected::http_head, connected::head_seeds),
    (
        "client_message",
        connected::client_message,
        connected::client_seeds,
    ),
];

/// Map files, and clouds to insert.
fn map_and_cloud_seeds() -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let mut maps = detailed_maps();
    let mut clouds = Vec::new();
    for (number, kind) in (0_u8..).zip(LatticeKind::ALL) {
        let lattice = Lattice::new(kind, 0.125).unwrap();
        let datum_m = Vector3::new(100.0, -2000.0, 30.0);
        let mut list = VoxelList::new(lattice, datum_m, usize::MAX).unwrap();
        list.insert(&Cloud {
            stamp_ns: 0,
            datum_m,
            offsets_m: (0..40)
                .map(|i| [0.3 * (i % 9) as f32, -0.2 * (i % 7) as f32, 0.1 * i as f32])
                .collect(),
        });
        let map = MapContents::from_list(&list);
        for (zstd_level, occupancy_only) in [(None, true), (None, false), (Some(3), false)] {
            maps.push(written(&map, zstd_level, occupancy_only));
        }
        // Kind, volume, bound, repeats, six coordinates (one kind of each), form and points.
        let head = [number, 27, 0, number, 1, 0, 8, 2, 1, 2, 3, 4, 3, 1, 9, 9];
        let small: Vec<u8> = (0..90_u8).map(|i| i.wrapping_mul(37)).collect();
        clouds.push([&head[..], &[3, 3, 1], &small].concat());
        clouds.push([&[number, 20, 5, 250, 3, 3, 3, 3, 3, 3, 1][..], &small].concat());
        let special = [
            f32::NAN,
            f32::INFINITY,
            f32::MIN,
            f32::MAX,
            f32::MIN_POSITIVE,
        ];
        let plain = [0.0, -0.0, 1e-45, 0.25, 1048575.5, -3e7, 1.0];
        let floats = special.into_iter().chain(plain);
        let floats: Vec<u8> = floats.flat_map(f32::to_le_bytes).collect();
        clouds.push([&[number, 30, 0, 0, 3, 3, 3, 3, 3, 3, 0][..], &floats].concat());
        let far = [&[0][..], &1e300_f64.to_le_bytes()].concat();
        clouds.push([&[number, 30, 0, 0, 3, 3, 3][..], &far, &[3, 3, 0], &floats].concat());
    }
    (maps, clouds)
}
