//! SICK LMS200: one turn of the mirror every 1/75 s, of which half a turn measures 181 beams, 1 degree apart.

use super::random::Stream;
use super::site::Hit;
use nalgebra::{Isometry3, Vector3};

/// Beams of a scan, from -90 to +90 degrees about the scanner's z axis.
pub const BEAMS: u16 = 181;
pub const SCAN_RATE_HZ: u64 = 75;
/// Time from the first beam to the last, ns: half a turn of the mirror.
pub const SCAN_SPAN_NS: i64 = beam_offset_ns(BEAMS - 1) as i64;
pub const MIN_RANGE_M: f64 = 0.2;
pub const MAX_RANGE_M: f64 = 80.0;
/// Standard deviation of a range, m.
pub const RANGE_NOISE_M: f64 = 0.012;
/// Least `reflectivity cos(incidence) / range^2` (1/m^2) that gives a return: a target of 10 % is seen to 20 m.
const SENSITIVITY_PER_M2: f64 = 0.1 / (25.0 * 25.0);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lms200Return {
    pub beam: u16,
    /// Time since the start of the scan, ns.
    pub offset_ns: u32,
    /// Measured range, with noise, m.
    pub range_m: f32,
    /// Measured point in the scanner's frame, with range noise, m.
    pub point_m: [f32; 3],
    /// Remission, 0..255: reflectivity times cosine of incidence.
    pub intensity: f32,
    /// The same return without noise, in the map frame, m.
    pub truth_m: Vector3<f64>,
}

/// One scan. Beams without an echo, outside the range limits or upon the machine itself have no return.
#[derive(Clone, Debug, PartialEq)]
pub struct Lms200Scan {
    /// First beam, ns since the start of the log.
    pub start_ns: i64,
    /// Returns in the order of the beams.
    pub returns: Vec<Lms200Return>,
}

/// Time of a beam since the first one, ns.
pub(super) const fn beam_offset_ns(beam: u16) -> u32 {
    (beam as u32 * 1_000_000 + 13) / 27
}

/// Direction of a beam in the scanner's frame: +90 degrees is y, the middle beam is x.
fn beam_direction(beam: u16) -> Vector3<f64> {
    let (sin, cos) = (f64::from(beam) - 90.0).to_radians().sin_cos();
    Vector3::new(cos, sin, 0.0)
}

/// Measures one scan. `cast` gives the first surface on a ray at a time (ns), `map_from_laser` gives the scanner's pose at a time (ns); `own_body_m` gives the distance
/// at which a beam meets the carrying machine, whose returns the driver removes.
pub(super) fn scan(
    cast: impl Fn(i64, &Vector3<f64>, &Vector3<f64>) -> Option<Hit>,
    start_ns: i64,
    noise: &mut Stream,
    map_from_laser: impl Fn(i64) -> Isometry3<f64>,
    own_body_m: impl Fn(i64, &Vector3<f64>) -> Option<f64>,
) -> Lms200Scan {
    let mut returns = Vec::with_capacity(usize::from(BEAMS));
    for beam in 0..BEAMS {
        // Drawn for every beam, so that what a beam meets does not change the noise of the others.
        let error_m = RANGE_NOISE_M * noise.normal();
        let offset_ns = beam_offset_ns(beam);
        let time_ns = start_ns + i64::from(offset_ns);
        let in_laser = beam_direction(beam);
        let pose = map_from_laser(time_ns);
        let (origin, direction) = (pose.translation.vector, pose.rotation * in_laser);
        let Some(hit) = cast(time_ns, &origin, &direction) else {
            continue;
        };
        let measured_m = hit.range_m + error_m;
        let echo = hit.reflectivity * hit.cos_incidence;
        let seen = echo >= SENSITIVITY_PER_M2 * hit.range_m * hit.range_m
            && hit.range_m >= MIN_RANGE_M
            && (MIN_RANGE_M..=MAX_RANGE_M).contains(&measured_m)
            && own_body_m(time_ns, &in_laser).is_none_or(|body_m| body_m > hit.range_m);
        if seen {
            let point = in_laser * measured_m;
            returns.push(Lms200Return {
                beam,
                offset_ns,
                range_m: measured_m as f32,
                point_m: [point.x as f32, point.y as f32, point.z as f32],
                intensity: (255.0 * echo) as f32,
                truth_m: origin + direction * hit.range_m,
            });
        }
    }
    Lms200Scan { start_ns, returns }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beams_take_half_a_turn_of_the_mirror() {
        assert_eq!(beam_offset_ns(0), 0);
        assert_eq!(SCAN_SPAN_NS, 6_666_667);
        for beam in 1..BEAMS {
            let step_ns = beam_offset_ns(beam) - beam_offset_ns(beam - 1);
            assert!((37_037..=37_038).contains(&step_ns));
        }
    }

    #[test]
    fn beams_sweep_counter_clockwise() {
        assert!((beam_direction(0) + Vector3::y()).norm() < 1e-15);
        assert!((beam_direction(90) - Vector3::x()).norm() < 1e-15);
        assert!((beam_direction(180) - Vector3::y()).norm() < 1e-15);
    }
}
