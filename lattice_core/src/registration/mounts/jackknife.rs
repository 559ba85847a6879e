//! Standard deviations by leaving out segments of the log, one at a time (jackknife).

use super::planes::Vector7;
use super::{MountCorrection, MountError, MountSamples};

/// Number of segments, of equal numbers of points.
const SEGMENTS: usize = 12;

/// Standard deviations of the numbers of a correction; infinite where an estimate without a segment fails.
pub(super) fn sigmas(
    samples: &MountSamples,
    found: &MountCorrection,
    estimate: impl Fn(&MountSamples, &mut MountCorrection) -> Result<(), MountError>,
) -> [f64; 7] {
    let stamp_s = |place: u32| samples.poses.get(place as usize).map_or(0.0, |p| p.stamp_s);
    let mut points = samples.points.clone();
    points.sort_by(|a, b| stamp_s(a.0).total_cmp(&stamp_s(b.0)));
    let length = points.len().div_ceil(SEGMENTS).max(1);
    let mut changes: Vec<Vector7> = Vec::new();
    let mut part = samples.clone();
    for segment in 0..SEGMENTS {
        let (from, to) = (segment * length, (segment + 1) * length);
        let others = points.iter().take(from).chain(points.iter().skip(to));
        part.points = others.copied().collect();
        let mut without = found.clone();
        if estimate(&part, &mut without).is_err() {
            return [f64::INFINITY; 7];
        }
        let mut change = without.vector() - found.vector();
        let turn = (without.rotation * found.rotation.inverse()).scaled_axis();
        change.fixed_rows_mut::<3>(0).copy_from(&turn);
        changes.push(change);
    }
    let count = SEGMENTS as f64;
    let mean = changes.iter().sum::<Vector7>() / count;
    let squares = changes
        .iter()
        .map(|change| (change - mean).map(|value| value * value));
    let variance = squares.sum::<Vector7>() * ((count - 1.0) / count);
    variance.map(f64::sqrt).into()
}
