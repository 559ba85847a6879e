//! A cloud under random rotations, in all lattices.

use super::measure::{Laid, Measured, Turns};
use crate::paper::estimate::Estimate;
use crate::paper::voxels::scan::Scan;
use lattice_core::lattice::LatticeKind;

/// The lattices that are rounder than cubes.
pub const ROUND: [LatticeKind; 3] = [LatticeKind::Bcc, LatticeKind::Fcc, LatticeKind::Mcc];

/// A cloud in cells of a size under turns of a kind.
pub struct TurnedCloud<'a> {
    pub scan: &'a Scan,
    pub volume_m3: f64,
    pub turns: Turns,
    pub measured: Vec<Measured>,
}

impl TurnedCloud<'_> {
    pub fn of(&self, laid: Laid) -> Option<&Measured> {
        self.measured.iter().find(|measured| measured.laid == laid)
    }

    pub fn paper(&self, kind: LatticeKind) -> Option<&Measured> {
        self.of(Laid::paper(kind))
    }

    pub fn cubic(&self) -> Option<&Measured> {
        self.paper(LatticeKind::Cubic)
    }

    pub fn count_change(&self, kind: LatticeKind) -> Option<Estimate> {
        Some(self.paper(kind)?.count_to(self.cubic()?))
    }

    pub fn is_drawn(&self) -> bool {
        self.scan.volumes_m3.first() == Some(&self.volume_m3)
    }

    pub fn name(&self) -> String {
        let TurnedCloud { scan, turns, .. } = self;
        format!("{}, {} m³, {}", scan.title, self.volume_m3, turns.name())
    }
}
