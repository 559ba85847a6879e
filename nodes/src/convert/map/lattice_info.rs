//! Lattice, frame and epoch of map messages.

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_msgs::geographic_msgs::GeoPoint;
use lattice_msgs::lattice::LatticeInfo;
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::checksum::History;
use super::error::MapMessageError;
use crate::convert::geometry;
use crate::hurry::Hurry;

/// Relative tolerance of generator, cell volume and quaternion.
const TOLERANCE: f64 = 1e-9;

/// Header and state common to all messages of one map state.
pub struct MapStamp<'a> {
    /// Frame and time.
    pub header: Header,
    /// Epoch; it changes when the map is reset.
    pub epoch: u64,
    /// Sequence number of the state.
    pub sequence: u64,
    /// Checksum of the updates up to the state.
    pub history: History,
    /// Geodetic origin of the map frame, if known.
    pub origin: Option<&'a GeoPoint>,
    /// Largest serialized chunk, bytes.
    pub chunk_bytes: usize,
    /// Request to leave a keyframe out.
    pub hurry: Hurry,
}

/// Lattice, its frame and the epoch as a message: the generator is in the
/// lattice's own axes, which `map_from_lattice` rotates.
pub fn info_of(lattice: &Lattice, datum_m: Vector3<f64>, stamp: &MapStamp) -> LatticeInfo {
    let g = lattice.unoriented_generator().transpose();
    let mut generator = [0.0; 9];
    generator.copy_from_slice(g.as_slice());
    let datum = Isometry3::from_parts(Translation3::from(datum_m), lattice.orientation());
    LatticeInfo {
        lattice: lattice.kind().name().to_owned(),
        cell_volume_m3: lattice.cell_volume_m3(),
        generator,
        map_from_lattice: geometry::pose_from(&datum),
        origin: stamp.origin.copied().unwrap_or_default(),
        has_origin: stamp.origin.is_some(),
        epoch: stamp.epoch,
    }
}

/// Lattice of a message, rotated into the map frame, and its datum in that frame.
///
/// Rejected if generator, name and cell volume disagree; a custom lattice is that of its generator.
pub fn lattice_from(info: &LatticeInfo) -> Result<(Lattice, Vector3<f64>), MapMessageError> {
    let refuse = |reason: String| MapMessageError::Lattice {
        lattice: info.lattice.chars().take(32).collect(),
        cell_volume_m3: info.cell_volume_m3,
        reason,
    };
    let generator = Matrix3::from_row_slice(&info.generator);
    let lattice = if info.lattice == LatticeKind::Custom.name() {
        Lattice::from_basis(generator)
    } else {
        let kind = info.lattice.parse::<LatticeKind>();
        kind.and_then(|kind| Lattice::new(kind, info.cell_volume_m3))
    };
    let lattice = lattice.map_err(|e| refuse(format!("{e}")))?;
    let volume_m3 = lattice.cell_volume_m3();
    let volume_off = (info.cell_volume_m3 - volume_m3).abs() / volume_m3;
    let generator_off = (generator - lattice.unoriented_generator()).abs().sum();
    let agrees = volume_off <= TOLERANCE && generator_off <= TOLERANCE * lattice.cell_side_m();
    if !agrees {
        let expected = lattice.unoriented_generator();
        return Err(refuse(format!(
            "generator and volume are not those of the lattice, {:?} row by row and {volume_m3} m^3",
            expected.transpose().as_slice()
        )));
    }
    let place =
        geometry::isometry_from_pose(&info.map_from_lattice).ok_or(MapMessageError::Frame)?;
    let q = &info.map_from_lattice.orientation;
    let sent = Quaternion::new(q.w, q.x, q.y, q.z);
    // Bit-exact as sent, if its norm is 1 within rounding.
    let rotation = if (sent.norm_squared() - 1.0).abs() <= TOLERANCE {
        UnitQuaternion::new_unchecked(sent)
    } else {
        place.rotation
    };
    Ok((lattice.oriented(rotation), place.translation.vector))
}
