//! Trials of one scene, and the change against cubic of scenes taken together.

use super::compare::{Estimate, Quantiles, change};
use super::scenes::Scene;
use super::trials::Trials;
use crate::report::plot::title;
use lattice_core::lattice::LatticeKind;

/// Names of [`SHARES`](super::compare::SHARES).
pub(super) const SHARE_NAMES: [&str; 2] = ["median", "95th percentile"];
/// Places in [`LatticeKind::ALL`].
pub(super) const BCC: usize = 1;
pub(super) const FCC: usize = 2;
pub(super) const MCC: usize = 3;
pub(super) const HEX: usize = 4;
pub(super) const BEST_HEX: usize = 5;

/// A scene with its trials.
pub(super) struct Played {
    pub(super) scene: Scene,
    pub(super) trials: Trials,
    pub(super) quantiles: Quantiles,
}

/// Scenes taken together: change of errors by share and lattice and of the poses tried, both against cubic, %.
#[derive(Clone)]
pub(super) struct Group {
    pub(super) change: [[Estimate; 6]; 2],
    pub(super) evaluations: [f64; 6],
}

impl Group {
    pub(super) fn of(members: &[&Played]) -> Option<Group> {
        let quantiles: Vec<&Quantiles> = members.iter().map(|p| &p.quantiles).collect();
        let lattices = [0, 1, 2, 3, 4, 5];
        let evaluations = |lattice: usize| {
            let ratio = |p: &&Played| p.trials.evaluations(lattice) / p.trials.evaluations(0);
            let sum: f64 = members.iter().map(ratio).sum();
            100.0 * (sum / members.len() as f64 - 1.0)
        };
        (!members.is_empty()).then(|| Group {
            change: [0, 1].map(|share| lattices.map(|l| change(&quantiles, share, l))),
            evaluations: lattices.map(evaluations),
        })
    }

    /// "median -5.1 % (-9.0 to -1.2), 95th percentile ...".
    pub(super) fn words(&self, lattice: usize) -> String {
        let one = |(name, of): (&str, &[Estimate; 6])| {
            let Estimate { value, low, high } = of[lattice];
            format!("{name} {value:+.1} % ({low:+.1} to {high:+.1})")
        };
        let shares = SHARE_NAMES.into_iter().zip(&self.change);
        shares.map(one).collect::<Vec<_>>().join(", ")
    }

    /// True if both shares are below cubic, and true if one of them is so with all of its interval.
    pub(super) fn better(&self, lattice: usize) -> (bool, bool) {
        let below = self.change.iter().all(|of| of[lattice].value < 0.0);
        let surely = self.change.iter().any(|of| of[lattice].high < 0.0);
        (below, below && surely)
    }

    /// True if no interval of a lattice leaves out 0.
    pub(super) fn as_cubic(&self, lattice: usize) -> bool {
        let both = |e: &Estimate| e.low <= 0.0 && e.high >= 0.0;
        self.change.iter().all(|of| both(&of[lattice]))
    }

    /// True if a lattice has no larger error than FCC in either share.
    pub(super) fn at_least_fcc(&self, lattice: usize) -> bool {
        let no_worse = |of: &[Estimate; 6]| of[lattice].value <= of[FCC].value;
        self.change.iter().all(no_worse)
    }
}

/// A lattice's name, by its place.
pub(super) fn name(lattice: usize) -> &'static str {
    let kind = LatticeKind::ALL.get(lattice);
    kind.map_or("", |kind| title(*kind))
}
