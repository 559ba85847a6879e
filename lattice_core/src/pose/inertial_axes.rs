//! Hypotheses of axes and signs that relate an inertial sensor to attitudes.
//!
//! A wrong sign of roll or pitch turns the specific force and the turning rate in different ways, as a rate is a pseudo-vector:
//! the components of gravity that one reflects, the other keeps. Turned or left-handed axes of a sensor do the same to both.

use nalgebra::{Matrix2, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::attitude_convention::AttitudeConvention;

/// Fault that a hypothesis stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    /// Measurements and attitudes agree.
    None,
    /// Attitudes of a convention, or of wrong signs that no convention has.
    Attitude(Option<AttitudeConvention>),
    /// Sensor turned on the machine: `base_from_stated_base`.
    Turned(UnitQuaternion<f64>),
    /// Sensor with left-handed axes.
    LeftHanded,
    /// Accelerations in other axes than rates and attitudes, or of opposite sign.
    Force {
        /// True if all signs are opposite.
        is_opposite: bool,
    },
    /// Rates in other axes than accelerations and attitudes.
    Rate,
}

/// Axes of the measurements, `measured = matrix * expected`, under a fault.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hypothesis {
    pub fault: Fault,
    pub force: Matrix3<f64>,
    pub rate: Matrix3<f64>,
}

/// Signs of roll and pitch, or their exchange, with what is their name where yaw is counterclockwise.
const ROLL_PITCH: [([f64; 4], Option<AttitudeConvention>); 4] = [
    ([1.0, 0.0, 0.0, -1.0], Some(AttitudeConvention::PitchUp)),
    ([-1.0, 0.0, 0.0, 1.0], Some(AttitudeConvention::RollLeft)),
    ([0.0, 1.0, 1.0, 0.0], Some(AttitudeConvention::Swapped)),
    ([0.0, -1.0, -1.0, 0.0], None),
];

/// All hypotheses; of those that fit alike the first is the most frequent fault.
pub(super) fn hypotheses() -> Vec<Hypothesis> {
    let identity = Matrix3::identity();
    let mut all = vec![Hypothesis {
        fault: Fault::None,
        force: identity,
        rate: identity,
    }];
    let is_clockwise = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let mut add = |fault, force, rate| {
        all.push(Hypothesis { fault, force, rate });
    };
    let compass = Fault::Attitude(Some(AttitudeConvention::Compass));
    add(compass, identity, is_clockwise);
    for yaw in [1.0, -1.0] {
        for (signs, name) in ROLL_PITCH {
            let name = match (yaw > 0.0, name) {
                (true, name) => name,
                (false, Some(AttitudeConvention::PitchUp)) => Some(AttitudeConvention::Ned),
                (false, _) => None,
            };
            let of_angles = Matrix2::from_row_slice(&signs);
            // Up is (-pitch, roll, 1): turned by 90 degrees, a reflection has the other sign.
            let (force, rate) = (block(&-of_angles, 1.0), block(&of_angles, yaw));
            add(Fault::Attitude(name), force, rate);
        }
    }
    let turns = || axes().filter(|axes| axes.determinant() > 0.0 && *axes != identity);
    for axes in turns() {
        let turn = Rotation3::from_matrix_unchecked(axes.transpose());
        add(Fault::Turned(turn.into()), axes, axes);
    }
    let opposite = -identity;
    let is_opposite = true;
    add(Fault::Force { is_opposite }, opposite, identity);
    for axes in axes().filter(|axes| axes.determinant() < 0.0) {
        add(Fault::LeftHanded, axes, axes);
    }
    let is_opposite = false;
    for axes in axes().filter(|axes| *axes != identity && *axes != opposite) {
        add(Fault::Force { is_opposite }, axes, identity);
    }
    for axes in axes().filter(|axes| *axes != identity) {
        add(Fault::Rate, identity, axes);
    }
    all
}

fn block(xy: &Matrix2<f64>, z: f64) -> Matrix3<f64> {
    let mut whole = Matrix3::zeros();
    whole.fixed_view_mut::<2, 2>(0, 0).copy_from(xy);
    whole.m33 = z;
    whole
}

/// The 48 permutations of axes with signs; those that exchange none come first, then those about z.
fn axes() -> impl Iterator<Item = Matrix3<f64>> {
    let orders: [[usize; 3]; 6] = [
        [0, 1, 2],
        [1, 0, 2],
        [0, 2, 1],
        [2, 1, 0],
        [1, 2, 0],
        [2, 0, 1],
    ];
    orders.into_iter().flat_map(|order| {
        (0..8_u8).map(move |bits| {
            let signs = [4, 2, 1].map(|bit| if bits & bit == 0 { 1.0 } else { -1.0 });
            Matrix3::from_fn(|row, column| match order.get(row) == Some(&column) {
                true => signs.get(row).copied().unwrap_or(0.0),
                false => 0.0,
            })
        })
    })
}

/// Sums over pairs of a measured vector and the one that attitudes make expect.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct VectorPairs {
    pub count: f64,
    measured: Vector3<f64>,
    expected: Vector3<f64>,
    products: Matrix3<f64>,
    /// Sums of squared norms.
    squares: [f64; 2],
}

impl VectorPairs {
    pub fn add(&mut self, measured: &Vector3<f64>, expected: &Vector3<f64>) {
        self.count += 1.0;
        self.measured += measured;
        self.expected += expected;
        self.products += measured * expected.transpose();
        self.squares[0] += measured.norm_squared();
        self.squares[1] += expected.norm_squared();
    }

    /// Means of both vectors.
    pub fn means(&self) -> [Vector3<f64>; 2] {
        [self.measured, self.expected].map(|sum| sum / self.count.max(1.0))
    }

    /// Pairs of the deviations from the means.
    pub fn centred(&self) -> Self {
        let [measured, expected] = self.means();
        Self {
            count: self.count,
            measured: Vector3::zeros(),
            expected: Vector3::zeros(),
            products: self.products - measured * expected.transpose() * self.count,
            squares: [
                self.squares[0] - measured.norm_squared() * self.count,
                self.squares[1] - expected.norm_squared() * self.count,
            ],
        }
    }

    /// Pairs with measurements in another unit.
    pub fn scaled(&self, unit: f64) -> Self {
        Self {
            measured: self.measured * unit,
            products: self.products * unit,
            squares: [self.squares[0] * unit * unit, self.squares[1]],
            ..*self
        }
    }

    /// Root of the mean squared norm of the measured vectors, and of the expected ones.
    pub fn sizes(&self) -> [f64; 2] {
        self.squares
            .map(|sum| (sum.max(0.0) / self.count.max(1.0)).sqrt())
    }

    /// Sum of the squared residuals under axes.
    pub fn residual(&self, axes: &Matrix3<f64>) -> f64 {
        let fit = (axes.transpose() * self.products).trace();
        (self.squares[0] + self.squares[1] - 2.0 * fit).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_48_axes_and_half_are_turns() {
        let all: Vec<_> = axes().collect();
        assert_eq!(all.len(), 48);
        let different = |a: &Matrix3<f64>| all.iter().filter(|b| *b == a).count() == 1;
        assert!(all.iter().all(different));
        let turns = all.iter().filter(|axes| axes.determinant() > 0.0);
        assert_eq!(turns.count(), 24);
        assert_eq!(all[0], Matrix3::identity());
    }

    /// Up and the turning rate of attitudes in each convention, by their definition.
    #[test]
    fn conventions_have_the_axes_of_their_hypothesis() {
        let rates = |to: &UnitQuaternion<f64>, from: &UnitQuaternion<f64>| {
            (from.inverse() * to).scaled_axis()
        };
        for convention in AttitudeConvention::ALL.into_iter().skip(1) {
            let is_it = |one: &&Hypothesis| one.fault == Fault::Attitude(Some(convention));
            let all = hypotheses();
            let found = all.iter().find(is_it).unwrap();
            for (roll, pitch, yaw) in [(0.05, 0.0, 0.0), (0.0, 0.05, 0.3), (-0.03, 0.04, -2.0)] {
                let step = 0.01;
                for turn in [
                    [step, 0.0, 0.0],
                    [0.0, step, 0.0],
                    [0.0, 0.0, step],
                    [step, -step, step],
                ] {
                    let of = UnitQuaternion::from_euler_angles;
                    let truth = [
                        of(roll, pitch, yaw),
                        of(roll + turn[0], pitch + turn[1], yaw + turn[2]),
                    ];
                    let stated = truth.map(|one| convention.to_enu(&one));
                    let up = truth[0].inverse() * Vector3::z();
                    let of_stated = stated[0].inverse() * Vector3::z();
                    assert!(
                        (up - found.force * of_stated).norm() < 0.01,
                        "{convention:?}"
                    );
                    let rate = rates(&truth[1], &truth[0]);
                    let of_stated = rates(&stated[1], &stated[0]);
                    let apart = (rate - found.rate * of_stated).norm();
                    assert!(apart < 0.2 * step, "{convention:?} {apart}");
                }
            }
        }
    }
}
