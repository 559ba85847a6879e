//! Tests of the list; those over threads are in the test crate.

use super::*;
use crate::lattice::LatticeKind;
use crate::voxels::OFFSET_UNIT_M;

fn list(kind: LatticeKind, datum: [f64; 3], max_voxels: usize) -> VoxelList {
    VoxelList::new(Lattice::new(kind, 0.125).unwrap(), datum.into(), max_voxels).unwrap()
}

fn cloud(datum: [f64; 3], offsets_m: &[[f32; 3]]) -> Cloud {
    Cloud {
        stamp_ns: 0,
        datum_m: datum.into(),
        offsets_m: offsets_m.to_vec(),
    }
}

fn key(w: [i32; 3]) -> MortonKey {
    MortonKey::pack(w).unwrap()
}

fn changes(changed: &[MortonKey], removed: &[MortonKey]) -> Changes {
    Changes {
        changed: changed.to_vec(),
        removed: removed.to_vec(),
    }
}

#[test]
fn a_cloud_becomes_voxels_with_counts_and_mean_offsets() {
    let mut map = list(LatticeKind::Cubic, [0.0; 3], 10);
    let offsets = [[0.125, 0.0, 0.0], [-0.0625, 0.25, 0.0], [0.5, 0.5, 0.5]];
    let report = map.insert(&cloud([0.0; 3], &offsets));
    let expected = InsertReport {
        points: 3,
        inserted: 3,
        new_voxels: 2,
        ..Default::default()
    };
    assert_eq!(report, expected);
    let mean = |w| {
        map.get(key(w))
            .map(|voxel| (voxel.count, voxel.mean_offset_m()))
    };
    assert_eq!(mean([0; 3]), Some((2, [0.03125, 0.125, 0.0])));
    assert_eq!(mean([1; 3]), Some((1, [0.0; 3])));
    assert_eq!(mean([2; 3]), None);
    assert_eq!(map.center_m(key([1, 2, 3])), Vector3::new(0.5, 1.0, 1.5));
    map.validate().unwrap();
}

#[test]
fn points_are_counted_by_reason() {
    let far = (1 << 20) as f32;
    let mut map = list(LatticeKind::Bcc, [0.0; 3], 1);
    let lost = [
        [f32::NAN, 0.0, 0.0],
        [0.0, f32::NEG_INFINITY, 0.0],
        [0.0, 0.0, far],
    ];
    let offsets = [&lost[..], &[[0.0; 3], [5.0; 3], [0.01; 3]]].concat();
    let report = map.insert(&cloud([0.0; 3], &offsets));
    let expected = InsertReport {
        points: 6,
        inserted: 2,
        not_finite: 2,
        out_of_range: 1,
        list_full: 1,
        new_voxels: 1,
        forgotten_voxels: 0,
    };
    assert_eq!(report, expected);
    assert_eq!(map.distortion().points, 2);
    let report = map.insert(&cloud([f64::NAN, 0.0, 0.0], &[[0.0; 3]]));
    assert_eq!((report.not_finite, report.inserted), (1, 0));
    map.validate().unwrap();
}

#[test]
fn a_datum_beyond_reach_is_refused() {
    let lattice = Lattice::new(LatticeKind::Hex, 1.0).unwrap();
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let error = VoxelList::new(lattice.clone(), Vector3::new(0.0, bad, 0.0), 1).unwrap_err();
        assert!(error.to_string().contains("datum"));
    }
}

#[test]
fn a_far_datum_keeps_the_offsets_exact() {
    for kind in LatticeKind::ALL {
        for far in [1e5, 1e7, -1e7] {
            let mut map = list(kind, [far, -0.7 * far, 300.0], 100);
            let near = Vector3::new(far, -0.7 * far, 300.0);
            assert!((map.datum_m() - near).norm() <= map.lattice().covering_radius_m() + 1e-8);
            // A cloud at the datum: its offsets are the local coordinates, without rounding.
            let offsets = [[0.1, -0.2, 0.05], [3.3, 2.25, -1.0]];
            let report = map.insert(&cloud(map.datum_m().into(), &offsets));
            assert_eq!(report.inserted, 2);
            for offset in offsets {
                let local = Vector3::from(offset.map(f64::from));
                let w = map.lattice().quantize(&local).unwrap();
                let mean = Vector3::from(map.get(key(w)).unwrap().mean_offset_m());
                let off = mean + map.lattice().center(w) - local;
                assert!(off.amax() <= 1.01 * OFFSET_UNIT_M, "{kind}");
            }
            map.validate().unwrap();
        }
    }
}

#[test]
fn the_datum_is_part_of_the_lattice_of_the_map_frame() {
    // Two lists with other datums see the same cells in the map frame.
    for kind in LatticeKind::ALL {
        let mut here = list(kind, [0.0; 3], 100);
        let mut there = list(kind, [700.0, -300.0, 20.0], 100);
        let points = cloud([5.0, 6.0, 7.0], &[[0.1, 0.2, 0.3], [-2.0, 0.4, 0.9]]);
        here.insert(&points);
        there.insert(&points);
        let shift = there.datum_index().map(|i| i as i32);
        let moved = there.sorted_keys().into_iter().map(|key| {
            let w = key.unpack();
            self::key([w[0] + shift[0], w[1] + shift[1], w[2] + shift[2]])
        });
        assert!(moved.map(|key| here.get(key).unwrap().count).eq([1, 1]));
    }
}

#[test]
fn changes_are_taken_once() {
    let mut map = list(LatticeKind::Cubic, [0.0; 3], 10);
    map.insert(&cloud([0.0; 3], &[[0.5, 0.0, 0.0], [0.0; 3], [0.0; 3]]));
    let (first, second) = (key([0; 3]), key([1, 0, 0]));
    assert_eq!(map.take_changes(), changes(&[first, second], &[]));
    assert_eq!(map.take_changes(), Changes::default());
    map.insert(&cloud([0.0; 3], &[[0.5, 0.0, 0.0]]));
    assert_eq!(map.take_changes(), changes(&[second], &[]));
    map.validate().unwrap();
}

#[test]
fn clearing_removes_what_was_taken_and_only_that() {
    let mut map = list(LatticeKind::Cubic, [0.0; 3], 10);
    map.insert(&cloud([0.0; 3], &[[0.5, 0.0, 0.0], [0.0; 3]]));
    map.take_changes();
    map.insert(&cloud([0.0; 3], &[[1.0, 0.0, 0.0]]));
    map.clear();
    assert_eq!((map.len(), map.distortion().points), (0, 0));
    // One of the two comes back before anybody asks, and goes and comes again.
    map.insert(&cloud([0.0; 3], &[[0.0; 3]]));
    map.clear();
    map.insert(&cloud([0.0; 3], &[[0.0; 3]]));
    map.validate().unwrap();
    let first = key([0; 3]);
    assert_eq!(map.take_changes(), changes(&[first], &[key([1, 0, 0])]));
    map.clear();
    assert_eq!(map.take_changes(), changes(&[], &[first]));
}

#[test]
fn points_fill_a_list_alike_in_one_cloud_or_in_many() {
    for kind in LatticeKind::ALL {
        let at =
            |i: u32, m: u32| (i.wrapping_mul(2_654_435_761).wrapping_mul(m) >> 18) as f32 * 1e-3;
        let mut points: Vec<[f32; 3]> = (0..20_000)
            .map(|i| [at(i, 3), at(i, 7) - 8.0, 0.1 * at(i, 11)])
            .collect();
        // Some too far for fixed point of 32 bits, some without a cell.
        points[77] = [3000.0, -2500.0, 1.0];
        points[500] = [f32::NAN; 3];
        points[9000] = [1e9, 0.0, 0.0];
        let datum = [1e5, -7.0, 3.0];
        let mut whole = list(kind, [1e5, 0.0, 0.0], 1 << 20);
        let report = whole.insert(&cloud(datum, &points));
        let mut parts = list(kind, [1e5, 0.0, 0.0], 1 << 20);
        let mut total = 0;
        for part in points.chunks(97) {
            total += parts.insert(&cloud(datum, part)).inserted;
        }
        assert_eq!((report.inserted, total), (19_998, 19_998), "{kind}");
        assert_eq!(whole.sorted(), parts.sorted(), "{kind}");
        assert_eq!(whole.distortion(), parts.distortion(), "{kind}");
        whole.validate().unwrap();
        parts.validate().unwrap();
    }
}

/// The voxels of points, summed in 64 bits, from the definition.
fn voxels_of(map: &VoxelList, offsets_m: &[[f32; 3]]) -> Vec<(MortonKey, Voxel)> {
    let mut voxels = std::collections::BTreeMap::<MortonKey, Voxel>::new();
    let fixed = |metres: f64| (metres / OFFSET_UNIT_M).round_ties_even() as i64;
    for offset in offsets_m {
        let point = offset.map(f64::from);
        let w = map.lattice().quantize(&point.into()).unwrap();
        let center: [f64; 3] = map.lattice().center(w).into();
        let sum = [0, 1, 2].map(|i| fixed(point[i]) - fixed(center[i]));
        voxels
            .entry(key(w))
            .or_default()
            .add(&Voxel { count: 1, sum });
    }
    voxels.into_iter().collect()
}

#[test]
fn sums_of_any_number_of_points_are_exact() {
    for (side_m, kind) in [(1000.0, LatticeKind::Cubic), (200.0, LatticeKind::Fcc)]
        .into_iter()
        .chain([(40.0, LatticeKind::Bcc), (0.5, LatticeKind::Hex)])
    {
        // In a few corners of a few cells, so that the sums of many points are large.
        let near = |i: usize, axis: usize| ((i * (7 + 2 * axis) + i / 5) % 11) as f64 - 5.0;
        let place = |i: usize| [0, 1, 2].map(|axis| (near(i, axis) * 0.25 * side_m) as f32);
        let offsets: Vec<[f32; 3]> = (0..40_000).map(|i| place(i % 24)).collect();
        let lattice = Lattice::new(kind, side_m * side_m * side_m).unwrap();
        let empty = VoxelList::new(lattice, Vector3::zeros(), 1000).unwrap();
        let full = VoxelList::new(empty.lattice().clone(), Vector3::zeros(), 40_001).unwrap();
        let expected = voxels_of(&empty, &offsets);

        // Point by point, then gathered.
        let (mut singly, mut gathered) = (empty.clone(), full);
        singly.insert(&cloud([0.0; 3], &offsets));
        gathered.insert(&cloud([0.0; 3], &offsets));
        for map in [&singly, &gathered] {
            map.validate().unwrap();
            assert_eq!(map.sorted(), expected, "{:?}", map.lattice());
        }

        let twice: Vec<_> = offsets.iter().chain(&offsets).copied().collect();
        singly.insert(&cloud([0.0; 3], &offsets));
        singly.validate().unwrap();
        assert_eq!(singly.sorted(), voxels_of(&empty, &twice));

        // Voxels that come back start at nothing.
        let (first, voxel) = expected[0];
        assert!(singly.remove(first) && singly.remove(expected[1].0));
        singly.validate().unwrap();
        singly.insert(&cloud([0.0; 3], &offsets));
        assert_eq!(singly.get(first), Some(voxel));
        singly.validate().unwrap();

        #[cfg(feature = "file")]
        {
            let contents = crate::voxels::file::MapContents::from_list(&singly);
            assert_eq!(contents.into_list(1000).sorted(), singly.sorted());
        }
        singly.clear();
        singly.insert(&cloud([0.0; 3], &offsets));
        assert_eq!(singly.sorted(), expected);
    }
}

#[test]
fn doubles_give_the_voxels_of_the_same_floats() {
    for kind in LatticeKind::ALL {
        let at =
            |i: u32, m: u32| (i.wrapping_mul(2_654_435_761).wrapping_mul(m) >> 18) as f32 * 1e-3;
        let mut points: Vec<[f32; 3]> = (0..10_000)
            .map(|i| [at(i, 3), at(i, 7) - 8.0, 0.1 * at(i, 11)])
            .collect();
        points[77] = [3000.0, -2500.0, 1.0];
        points[500] = [f32::NAN; 3];
        points[900] = [1e9, 0.0, 0.0];
        let doubles: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        for max_voxels in [1 << 20, 300] {
            let mut singles = list(kind, [3.0, -7.0, 0.3], max_voxels);
            let mut exact = singles.clone();
            let columns = PointColumns::default();
            let report = singles.insert_points(Vector3::zeros(), &points, columns);
            assert_eq!(
                report,
                exact.insert_points(Vector3::zeros(), &doubles, columns)
            );
            assert_eq!(singles.sorted(), exact.sorted(), "{kind}");
            let (floats, doubles) = (singles.distortion(), exact.distortion());
            assert_eq!(floats.points, doubles.points);
            assert!((floats.rms_m - doubles.rms_m).abs() < 1e-6, "{kind}");
            exact.validate().unwrap();
        }
    }
}

#[test]
fn doubles_far_from_the_datum_are_in_the_cells_of_the_closed_form() {
    for kind in LatticeKind::ALL {
        let mut map = list(kind, [450_000.0, 5_400_000.0, 300.0], 1 << 20);
        let far = [50_000.0, 20_000.0, -100.0];
        let at = |i: u32, m: u32| f64::from(i.wrapping_mul(2_654_435_761).wrapping_mul(m)) * 1e-8;
        let points: Vec<[f64; 3]> = (0..5000)
            .map(|i| {
                [0, 1, 2].map(|axis| map.datum_m()[axis] + far[axis] + at(i, 3 + 4 * axis as u32))
            })
            .collect();
        let report = map.insert_points(Vector3::zeros(), &points, PointColumns::default());
        assert_eq!(report.inserted, 5000, "{kind}");
        let mut expected = std::collections::BTreeMap::<MortonKey, u32>::new();
        for point in &points {
            let local = Vector3::from(*point) - map.datum_m();
            *expected
                .entry(key(map.lattice().quantize(&local).unwrap()))
                .or_default() += 1;
        }
        let found = map
            .sorted()
            .into_iter()
            .map(|(key, voxel)| (key, voxel.count));
        assert!(found.eq(expected), "{kind}");
        map.validate().unwrap();
    }
    let mut map = list(LatticeKind::Fcc, [0.0; 3], 10);
    let report = map.insert_points(
        Vector3::zeros(),
        &[[1e300, 0.0, 0.0]],
        PointColumns::default(),
    );
    assert_eq!((report.out_of_range, report.inserted), (1, 0));
}

#[test]
fn stamps_labels_and_colours_go_with_their_points() {
    let kept = Payload {
        stamps: true,
        labels: true,
        color: true,
    };
    let mut map = list(LatticeKind::Cubic, [0.0; 3], 10).with_payload(kept);
    let columns = PointColumns {
        stamp_ns: 9,
        stamps_ns: &[4, 2],
        labels: &[5, 6],
        colors: &[Some([255, 7, 0]), None, Some([1, 2, 3])],
    };
    map.insert_points(
        Vector3::zeros(),
        &[[0.0_f64; 3], [0.1, 0.0, 0.0], [1.0; 3]],
        columns,
    );
    let stamps = |w| {
        map.stamps(key(w))
            .map(|stamps| (stamps.first_ns, stamps.last_ns))
    };
    assert_eq!(
        (stamps([0; 3]), stamps([2; 3])),
        (Some((2, 4)), Some((9, 9)))
    );
    let labels = map.labels(key([0; 3])).into_iter().map(|known| known.label);
    assert!(labels.eq([5, 6]) && map.labels(key([2; 3])).is_empty());
    let mean = |w| map.color(key(w)).and_then(|color| color.mean());
    assert_eq!(mean([0; 3]), Some([255, 7, 0]));
    assert_eq!(mean([2; 3]), Some([1, 2, 3]));
    assert_eq!(map.color(key([1; 3])), None);
    map.validate().unwrap();
}
