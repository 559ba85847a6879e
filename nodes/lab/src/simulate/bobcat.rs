//! The machine: mounts, timing and the simulation itself.

use super::lms200::{self, Lms200Scan, MAX_RANGE_M, SCAN_RATE_HZ, SCAN_SPAN_NS};
use super::loader::Loader;
use super::obstacles::Block;
use super::person::Person;
use super::random::{Purpose, Stream};
use super::site::Site;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};
use thiserror::Error;

/// From `base_link` to the IMU, in `base_link`'s axes (the lever arm), m. The IMU's axes are those of `base_link`.
pub const BASE_FROM_IMU_M: [f64; 3] = [-0.35, 0.12, 1.25];
/// From `base_link` to the turntable's origin, m; the turntable turns counter-clockwise about `base_link`'s z.
pub const BASE_FROM_TURNTABLE_M: [f64; 3] = [-0.20, 0.0, 2.45];
/// One turn of the turntable (0.5 Hz), ns.
pub const TURNTABLE_PERIOD_NS: i64 = 2_000_000_000;
/// Time between INS epochs (100 Hz), ns.
pub const INS_PERIOD_NS: i64 = 10_000_000;
/// Longest log, s.
pub const MAX_DURATION_S: f64 = 86_400.0;
/// Shortest log: two INS epochs about every scanner's first scan, s.
const MIN_DURATION_S: f64 = 0.1;

/// The three scanners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Laser {
    /// On the left side, scanning an upright leaning plane ahead and to the left.
    Left,
    /// On the right side, mirrored.
    Right,
    /// On the turntable, scanning a leaning plane.
    Top,
}

impl Laser {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Left, Self::Right, Self::Top];

    pub(crate) fn frame(self) -> &'static str {
        match self {
            Self::Left => "left_laser",
            Self::Right => "right_laser",
            Self::Top => "top_laser",
        }
    }

    /// The fixed mount: `base_from_laser` at the sides, `turntable_from_laser` for the top.
    pub(crate) fn mount(self) -> Isometry3<f64> {
        let about = |axis, angle: f64| UnitQuaternion::from_axis_angle(&axis, angle);
        let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
        let side = |sign: f64| {
            let azimuth = about(z, sign * 70f64.to_radians());
            let plane = about(x, FRAC_PI_2 - sign * 20f64.to_radians());
            Isometry3::from_parts(Translation3::new(0.30, sign * 0.95, 1.50), azimuth * plane)
        };
        match self {
            Self::Left => side(1.0),
            Self::Right => side(-1.0),
            Self::Top => Isometry3::from_parts(
                Translation3::new(0.10, 0.0, 0.15),
                about(y, 20f64.to_radians()) * about(x, 40f64.to_radians()),
            ),
        }
    }

    /// Start of the first scan, ns: the scanners are not synchronised.
    fn first_scan_ns(self) -> i64 {
        match self {
            Self::Left => 20_000_000,
            Self::Right => 24_300_000,
            Self::Top => 28_900_000,
        }
    }
}

/// The lever arm and (identity) boresight of the IMU: `base_from_imu`.
pub fn base_from_imu() -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::from(BASE_FROM_IMU_M)),
        UnitQuaternion::identity(),
    )
}

/// Reason why a simulation is refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SimulationError {
    /// The duration is out of bounds or not a number.
    #[error(
        "cannot simulate {duration_s} s; give a duration between {MIN_DURATION_S} s and {MAX_DURATION_S} s"
    )]
    Duration {
        /// Duration asked for, s.
        duration_s: f64,
    },
    /// The log begins before its tour, or ends too late.
    #[error(
        "cannot begin {begin_s} s after the start of the tour; a log ends within {MAX_DURATION_S} s of it"
    )]
    Begin {
        /// Begin asked for, s.
        begin_s: f64,
    },
}

/// The simulated loader with its sensors on its site.
#[derive(Clone, Debug)]
pub struct Bobcat {
    seed: u64,
    begin_ns: i64,
    duration_ns: i64,
    site: Site,
    loader: Loader,
    body: [Block; 2],
    person: bool,
    ins_offset: Isometry3<f64>,
}

impl Bobcat {
    /// A log of `duration_s`; the seed sets all noise and the vibration, but neither site nor tour.
    pub fn new(seed: u64, duration_s: f64) -> Result<Self, SimulationError> {
        if !(MIN_DURATION_S..=MAX_DURATION_S).contains(&duration_s) {
            return Err(SimulationError::Duration { duration_s });
        }
        let block = |x: f64, z: [f64; 2], length: f64, width: f64| {
            let center = Vector3::new(x, 0.0, 0.5 * (z[0] + z[1]));
            Block::new(center, Vector3::new(length, width, z[1] - z[0]), 0.0)
        };
        Ok(Self {
            seed,
            begin_ns: 0,
            duration_ns: (duration_s * 1e9).round() as i64,
            site: Site::earth_moving(),
            loader: Loader::new(seed),
            body: [
                block(0.0, [0.2, 1.2], 2.3, 1.6),
                block(-0.1, [1.2, 2.05], 1.2, 1.0),
            ],
            person: false,
            ins_offset: Isometry3::identity(),
        })
    }

    /// The part of the tour from `begin_s` on, of the same duration; stamps begin as much later.
    pub fn starting_at(self, begin_s: f64) -> Result<Self, SimulationError> {
        let duration_s = self.duration_ns as f64 * 1e-9 + begin_s;
        if begin_s.is_nan() || begin_s < 0.0 || duration_s > MAX_DURATION_S {
            return Err(SimulationError::Begin { begin_s });
        }
        // At an epoch, so that every scan lies between two.
        let epochs = (begin_s * 1e9 / INS_PERIOD_NS as f64).round();
        Ok(Self {
            begin_ns: epochs as i64 * INS_PERIOD_NS,
            ..self
        })
    }

    /// With a [`Person`] who walks through the yard; all else is the same.
    pub fn with_person(self, person: bool) -> Self {
        Self { person, ..self }
    }

    /// With an INS whose whole map lies elsewhere, as by a base station at wrong coordinates.
    pub fn with_ins_offset(self, ins_offset: Isometry3<f64>) -> Self {
        Self { ins_offset, ..self }
    }

    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Begin of the log, ns since the start of the tour.
    pub fn begin_ns(&self) -> i64 {
        self.begin_ns
    }

    /// End of the log, ns since the start of the tour.
    pub fn end_ns(&self) -> i64 {
        self.begin_ns.saturating_add(self.duration_ns)
    }

    pub fn site(&self) -> &Site {
        &self.site
    }

    pub fn loader(&self) -> &Loader {
        &self.loader
    }

    /// True pose of the loader.
    pub fn map_from_base(&self, time_ns: i64) -> Isometry3<f64> {
        self.loader.map_from_base(time_ns as f64 * 1e-9)
    }

    /// Pose of the turntable, exact at any time.
    pub fn base_from_turntable(&self, time_ns: i64) -> Isometry3<f64> {
        let angle_rad =
            TAU * (time_ns.rem_euclid(TURNTABLE_PERIOD_NS) as f64 / TURNTABLE_PERIOD_NS as f64);
        Isometry3::from_parts(
            Translation3::from(Vector3::from(BASE_FROM_TURNTABLE_M)),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad),
        )
    }

    /// Pose of a scanner on the machine.
    pub fn base_from_laser(&self, laser: Laser, time_ns: i64) -> Isometry3<f64> {
        match laser {
            Laser::Left | Laser::Right => laser.mount(),
            Laser::Top => self.base_from_turntable(time_ns) * laser.mount(),
        }
    }

    /// Start of a scan, ns since the start of the tour.
    pub fn scan_start_ns(&self, laser: Laser, index: u64) -> i64 {
        let rate = i128::from(SCAN_RATE_HZ);
        let since_first = (i128::from(index) * 1_000_000_000 + rate / 2) / rate;
        let since_first = i64::try_from(since_first).unwrap_or(i64::MAX);
        laser.first_scan_ns().saturating_add(since_first)
    }

    /// Number of scans of the tour that start before the log.
    pub fn first_scan(&self, laser: Laser) -> u64 {
        let before_ns = i128::from(self.begin_ns - laser.first_scan_ns());
        let guess = before_ns * i128::from(SCAN_RATE_HZ) / 1_000_000_000;
        // Starts are rounded to ns.
        let mut first = u64::try_from(guess).unwrap_or(0);
        while self.scan_start_ns(laser, first) < self.begin_ns {
            first += 1;
        }
        first
    }

    /// Number of scans of the tour that end before the last INS epoch of the log.
    pub fn scan_count(&self, laser: Laser) -> u64 {
        let last_epoch_ns = self.end_ns() / INS_PERIOD_NS * INS_PERIOD_NS;
        let room_ns = last_epoch_ns - laser.first_scan_ns() - SCAN_SPAN_NS - 1;
        let scans = i128::from(room_ns) * i128::from(SCAN_RATE_HZ) / 1_000_000_000;
        u64::try_from(scans).map_or(0, |n| n + 1)
    }

    /// One scan: a function of the seed, the scanner and the index alone.
    pub fn scan(&self, laser: Laser, index: u64) -> Lms200Scan {
        let mut noise = Stream::new(self.seed, Purpose::LaserRange, laser as u64, index);
        let base_from_laser = |time_ns: i64| self.base_from_laser(laser, time_ns);
        let map_from_laser = |time_ns: i64| self.map_from_base(time_ns) * base_from_laser(time_ns);
        let own_body_m = |time_ns: i64, in_laser: &Vector3<f64>| {
            self.own_body_m(&base_from_laser(time_ns), in_laser)
        };
        let cast = |time_ns: i64, origin: &Vector3<f64>, direction: &Vector3<f64>| {
            let hit = self.site.cast(origin, direction, MAX_RANGE_M);
            match self.person {
                true => Person::before(hit, time_ns as f64 * 1e-9, origin, direction),
                false => hit,
            }
        };
        let start_ns = self.scan_start_ns(laser, index);
        lms200::scan(cast, start_ns, &mut noise, map_from_laser, own_body_m)
    }

    /// Distance along a ray in a sensor's frame at which it meets the machine itself, m.
    pub(super) fn own_body_m(
        &self,
        base_from_sensor: &Isometry3<f64>,
        in_sensor: &Vector3<f64>,
    ) -> Option<f64> {
        let origin = base_from_sensor.translation.vector;
        let direction = base_from_sensor.rotation * in_sensor;
        let hits = self.body.iter().filter_map(|b| b.cast(&origin, &direction));
        hits.map(|(distance_m, _)| distance_m)
            .min_by(f64::total_cmp)
    }

    /// `measured_from_map`: the constant error of the INS.
    pub(super) fn ins_offset(&self) -> &Isometry3<f64> {
        &self.ins_offset
    }
}
