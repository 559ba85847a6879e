//! Progress of a calibration.

use std::ops::ControlFlow;
use std::time::Instant;

use lattice_core::registration::Stage;

use crate::progress::Progress;

pub(super) fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

/// Progress display of a calibration.
pub(super) struct Shown<'a>(pub &'a Progress);

impl lattice_core::registration::Progress for Shown<'_> {
    fn report(&self, stage: Stage, fraction: f64) -> ControlFlow<()> {
        self.0.set(fraction);
        self.0.say(match stage {
            Stage::Prepare => "clouds",
            Stage::Search => "search",
            Stage::Refine => "refine",
            Stage::Judge => "judge",
        });
        ControlFlow::Continue(())
    }
}
