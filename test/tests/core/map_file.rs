//! Map files over any map: exact round trips, and no damage that goes unseen.

#[allow(dead_code)] // The bodies of the fuzz targets.
use crate::fuzz;

use fuzz::{crc32, mend_checksums};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::codec::decode_keys;
use lattice_core::voxels::file::{
    MapContents, WriteOptions, max_voxels_of, read_map, read_occupancy,
};
use lattice_core::voxels::{OccupancyList, Payload, PointColumns, VoxelList, VoxelStore};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::prelude::*;

fn any_lattice() -> impl Strategy<Value = Lattice> {
    let kind = prop::sample::select(&LatticeKind::ALL[..]);
    let named = (kind, -12.0..9.0_f64)
        .prop_map(|(kind, exponent)| Lattice::new(kind, exponent.exp2()).unwrap());
    let basis = prop::array::uniform9(-1.0..1.0_f64);
    let custom = basis.prop_filter_map("too skewed", |entries| {
        Lattice::from_basis(Matrix3::from_row_slice(&entries)).ok()
    });
    let turn = prop::option::of(prop::array::uniform3(-3.0..3.0_f64));
    (prop_oneof![2 => named, 1 => custom], turn).prop_map(|(lattice, turn)| match turn {
        Some([roll, pitch, yaw]) => {
            lattice.oriented(UnitQuaternion::from_euler_angles(roll, pitch, yaw))
        }
        None => lattice,
    })
}

fn any_payload() -> impl Strategy<Value = Payload> {
    let kept = any::<(bool, bool, bool)>();
    kept.prop_map(|(stamps, labels, color)| Payload {
        stamps,
        labels,
        color,
    })
}

fn any_map() -> impl Strategy<Value = MapContents> {
    let coordinate = prop_oneof![
        8 => -2.0..2.0_f32,
        2 => (-8..8_i32).prop_map(|i| i as f32 * 0.25),
        1 => -1e4..1e4_f32,
    ];
    let offsets = prop::collection::vec(prop::array::uniform3(coordinate), 0..150);
    let stamp = prop_oneof![any::<i64>(), Just(0)];
    let inputs = (any_lattice(), any_payload(), offsets, stamp);
    inputs.prop_map(|(lattice, payload, offsets_m, stamp_ns)| {
        let datum_m = Vector3::new(1e6, -2e6, 30.0);
        let list = VoxelList::new(lattice, datum_m, usize::MAX).unwrap();
        let mut list = list.with_payload(payload);
        let labels: Vec<u16> = (0..offsets_m.len() as u16).map(|i| i % 3 * 3000).collect();
        let mut cloud = Cloud {
            stamp_ns,
            datum_m,
            offsets_m,
        };
        let colors: Vec<_> = (0..cloud.len() as u8)
            .map(|i| (i % 4 > 0).then_some([i, 255 - i, 9]))
            .collect();
        let columns = PointColumns {
            stamp_ns,
            labels: &labels,
            colors: &colors,
            ..PointColumns::default()
        };
        list.insert_points(datum_m, &cloud.offsets_m, columns);
        cloud.offsets_m.truncate(20);
        cloud.stamp_ns = stamp_ns.wrapping_add(1 << 60);
        list.insert(&cloud);
        MapContents::from_list(&list)
    })
}

fn any_options() -> impl Strategy<Value = WriteOptions> {
    (prop::option::of(1..=19_i32), any::<bool>()).prop_map(|(zstd_level, occupancy_only)| {
        WriteOptions {
            zstd_level,
            occupancy_only,
        }
    })
}

fn bytes(map: &MapContents, options: &WriteOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    map.write(&mut bytes, options).unwrap();
    bytes
}

fn read(bytes: &[u8]) -> Result<MapContents, String> {
    MapContents::read(bytes, max_voxels_of(bytes.len() as u64)).map_err(|e| e.to_string())
}

proptest! {
    #[test]
    fn files_read_back_to_the_bit(map in any_map(), options in any_options()) {
        let file = bytes(&map, &options);
        let back = read(&file).unwrap();
        prop_assert_eq!(&bytes(&back, &options), &file);
        let mut expected = map;
        if options.occupancy_only {
            expected.drop_payload();
        }
        prop_assert_eq!(&back, &expected);
        let cells = read_occupancy(&file[..], 1 << 30).unwrap();
        cells.validate().unwrap();
        prop_assert_eq!(&cells.sorted_keys()[..], expected.keys());
        let list = back.into_list(usize::MAX);
        list.validate().unwrap();
        let cells: Vec<MortonKey> = list.sorted().into_iter().map(|(key, _)| key).collect();
        prop_assert_eq!(&cells[..], expected.keys());
        if expected.voxels().is_some() {
            prop_assert_eq!(MapContents::from_list(&list), expected);
        }
    }

    #[test]
    fn a_damaged_file_is_refused(
        map in any_map(), options in any_options(), at in any::<prop::sample::Index>(), flip in 1..=255_u8,
    ) {
        let mut file = bytes(&map, &options);
        let cut = at.index(file.len());
        let error = read(&file[..cut]).unwrap_err();
        prop_assert!(error.contains("cut short") || error.contains("allowed"), "{}", error);
        file[cut] ^= flip;
        let error = read(&file).unwrap_err();
        prop_assert!(error.contains("map file") && (error.contains("byte") || cut < 8), "{}", error);
    }

    #[test]
    fn a_forged_file_is_refused_or_is_a_map(
        map in any_map(),
        options in any_options(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        // Every checksum is right, so that only the content can give the forgery away.
        let mut file = bytes(&map, &options);
        for (at, byte) in edits {
            let at = at.index(file.len());
            file[at] = byte;
        }
        mend_checksums(&mut file);
        if let Ok(map) = read(&file) {
            map.clone().into_list(usize::MAX).validate().unwrap();
            let options = WriteOptions { occupancy_only: map.voxels().is_none(), zstd_level: None };
            let again = bytes(&map, &options);
            prop_assert_eq!(read(&again).unwrap(), map);
        }
    }

    #[test]
    fn noise_is_no_map(noise in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(read_map(&noise[..], 1000).is_err());
        let mut disguised = [&b"LATTICE2fcc"[..], &[0; 13], &0.125_f64.to_le_bytes(), &noise].concat();
        disguised.resize(disguised.len().max(232), 0);
        mend_checksums(&mut disguised);
        prop_assert!(read_map(&disguised[..], usize::MAX).is_err());
    }
}

#[test]
fn absurd_counts_cost_no_memory() {
    let lattice = Lattice::new(LatticeKind::Fcc, 0.125).unwrap();
    let mut list = OccupancyList::new(lattice, Vector3::zeros(), 1 << 20).unwrap();
    assert!(list.add(MortonKey::pack([0; 3]).unwrap()));
    let map = MapContents::from_store(&list);
    let mut file = bytes(&map, &WriteOptions::default());
    // 2^60 voxels in as many bytes, of which ten come.
    file[208..216].copy_from_slice(&(1_u64 << 60).to_le_bytes());
    file[248..256].copy_from_slice(&(1_u64 << 60).to_le_bytes());
    file[256..264].copy_from_slice(&(1_u64 << 60).to_le_bytes());
    let crc = crc32(&file[..220]);
    file[220..224].copy_from_slice(&crc);
    let crc = crc32(&file[224..268]);
    file[268..272].copy_from_slice(&crc);
    let error = read_map(&file[..], usize::MAX).unwrap_err().to_string();
    assert!(
        error.contains("cut short") && error.contains("section keys"),
        "{error}"
    );
    let error = read_map(&file[..], 1000).unwrap_err().to_string();
    assert!(error.contains("1000"), "{error}");
    assert!(decode_keys(&[0x80], usize::MAX).is_err());
}

#[test]
fn a_surface_takes_little_more_than_a_byte_for_a_voxel() {
    // Rolling ground of 80 m by 80 m in cells of 0.1 m.
    let points = (0..1600 * 1600).map(|i| {
        let (x, y) = ((i % 1600) as f32 * 0.05, (i / 1600) as f32 * 0.05);
        [x, y, 2.0 * (0.11 * x).sin() + (0.23 * y).cos()]
    });
    let cloud = Cloud {
        stamp_ns: 0,
        datum_m: Vector3::zeros(),
        offsets_m: points.collect(),
    };
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.001).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), usize::MAX).unwrap();
        list.insert(&cloud);
        let map = MapContents::from_list(&list);
        let a_voxel = |zstd_level| {
            let options = WriteOptions {
                zstd_level,
                occupancy_only: true,
            };
            bytes(&map, &options).len() as f64 / map.keys().len() as f64
        };
        let (plain, packed) = (a_voxel(None), a_voxel(Some(3)));
        println!(
            "{kind}: {} voxels, {plain:.3} B each, {packed:.3} by zstd",
            map.keys().len()
        );
        assert!(plain < 1.25 && packed < plain, "{kind}: {plain} {packed}");
    }
}
