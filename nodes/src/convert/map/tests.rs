use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::VoxelList;
use lattice_msgs::lattice::LatticeInfo;
use lattice_msgs::std_msgs::Header;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::*;
use crate::hurry::Hurry;

fn list(lattice: &Lattice) -> VoxelList {
    VoxelList::new(lattice.clone(), Vector3::new(100.0, -50.0, 3.0), 10).unwrap()
}

fn info(list: &VoxelList) -> LatticeInfo {
    let stamp = MapStamp {
        header: Header::default(),
        epoch: 1,
        sequence: 0,
        history: History::default(),
        origin: None,
        hurry: Hurry::default(),
        chunk_bytes: 60_000,
    };
    info_of(list.lattice(), list.datum_m(), &stamp)
}

fn lattices() -> Vec<Lattice> {
    let mut lattices = Vec::new();
    for kind in LatticeKind::ALL {
        for name in ["paper", "ground"] {
            let lattice = Lattice::new(kind, 0.1).unwrap();
            lattices.push(lattice.with_orientation(name.parse().unwrap()).unwrap());
        }
    }
    let skew = Matrix3::new(0.5, 0.1, 0.0, 0.0, 0.4, 0.1, 0.2, 0.0, 0.6);
    let turn = UnitQuaternion::from_euler_angles(0.1, -0.4, 2.0);
    lattices.push(Lattice::from_basis(skew).unwrap());
    lattices.push(Lattice::from_basis(skew).unwrap().oriented(turn));
    lattices
}

#[test]
fn lattices_come_back_as_they_were_to_the_bit() {
    for lattice in lattices() {
        let list = list(&lattice);
        let info = info(&list);
        let (back, datum_m) = lattice_from(&info).unwrap();
        assert_eq!(back, lattice);
        assert_eq!(datum_m, list.datum_m());
        let row = Matrix3::from_row_slice(&info.generator);
        assert_eq!(row, lattice.unoriented_generator());
        let q = &info.map_from_lattice.orientation;
        assert_eq!(
            [q.x, q.y, q.z, q.w],
            <[f64; 4]>::from(lattice.orientation().coords)
        );
    }
}

#[test]
fn a_description_that_contradicts_itself_is_refused() {
    for lattice in lattices() {
        let good = info(&list(&lattice));
        let refused = |change: &dyn Fn(&mut LatticeInfo)| {
            let mut info = good.clone();
            change(&mut info);
            lattice_from(&info).unwrap_err().to_string()
        };
        let error = refused(&|info| info.cell_volume_m3 *= 1.001);
        assert!(error.contains("not those of the lattice"), "{error}");
        assert!(refused(&|info| info.generator[8] = f64::NAN).contains("lattice '"));
        assert!(refused(&|info| info.lattice = "bccc".into()).contains("unknown lattice"));
        refused(&|info| info.map_from_lattice.orientation.x = f64::NAN);
        refused(&|info| info.map_from_lattice.position.x = f64::INFINITY);
        if lattice.kind() != LatticeKind::Custom {
            let error = refused(&|info| info.generator[0] += 1e-3);
            assert!(error.contains("not those of the lattice"), "{error}");
        }
    }
}
