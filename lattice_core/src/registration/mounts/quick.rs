//! Test of a stated mount without a search: a few steps of the refinement from it.

use super::refine::{LEVELS, iterate, kind, sigmas};
use super::{MountCorrection, MountError, MountOptions, MountSamples};

/// Steps at each cell size: those from a stated mount that fits are small at once.
const STEPS: usize = 3;
/// Standard deviations above which a correction is certain.
pub(super) const CERTAIN: f64 = 3.0;

/// True if no observable correction near the stated mount is certain and above `least` (rad, m, s).
///
/// Standard deviations are without the jackknife: they are not above those of an estimate, so that no correction of
/// it is missed for them.
pub(super) fn fits_as_stated(
    samples: &MountSamples,
    options: &MountOptions,
    least: [f64; 3],
) -> Result<bool, MountError> {
    let limits = options.max_sigmas();
    let mut is_free = [true; 7];
    is_free[6] = options.with_time;
    loop {
        let mut correction = MountCorrection::identity(samples.sensor_m);
        let mut cell_m = 0.0;
        for (level_m, _) in LEVELS {
            cell_m = level_m;
            iterate(samples, &mut correction, cell_m, STEPS, &is_free)?;
        }
        let found = sigmas(samples, &correction, cell_m, &is_free, options);
        let vector = correction.vector();
        let mut is_observable = is_free;
        for (i, sigma) in found.iter().enumerate() {
            is_observable[i] &= *sigma <= limits[kind(i)];
            if is_observable[i] && vector[i].abs() > least[kind(i)].max(CERTAIN * sigma) {
                return Ok(false);
            }
        }
        // As the estimate: the others with those without evidence as stated.
        if is_observable == is_free {
            return Ok(true);
        }
        is_free = is_observable;
    }
}
