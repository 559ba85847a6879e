//! Axis or unit convention of a cloud.

use nalgebra::{Matrix3, Vector3};

use crate::pose::Axes;

/// Axis or unit convention that differs from forward, left, up in metres.
///
/// The search covers rotations about the vertical, so the up axis and the handedness identify a convention.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct AxisHypothesis {
    /// Matrix that converts the points to forward, left, up in metres.
    pub matrix: Matrix3<f64>,
}

impl AxisHypothesis {
    /// Mirrored: one axis has the wrong sign.
    pub(super) const MIRRORED: AxisHypothesis = AxisHypothesis {
        matrix: Matrix3::new(1., 0., 0., 0., -1., 0., 0., 0., 1.),
    };

    /// All conventions with another up axis, right-handed and left-handed.
    pub(super) fn with_other_up_axes() -> Vec<AxisHypothesis> {
        let signed = |i: usize| [1.0, -1.0].map(|sign| (i, sign));
        let up = (0..3).flat_map(signed).filter(|up| *up != (2, 1.0));
        let hands = |(i, sign): (usize, f64)| {
            [1.0, -1.0].map(|hand| {
                let unit = |i: usize| Vector3::ith(i % 3, 1.0);
                let (up, forward) = (sign * unit(i), unit(i + 1));
                let left = hand * up.cross(&forward);
                let matrix = Matrix3::from_columns(&[forward, left, up]).transpose();
                AxisHypothesis { matrix }
            })
        };
        up.flat_map(hands).collect()
    }

    /// Lengths multiplied by a factor.
    pub(super) fn scaled(by: f64) -> AxisHypothesis {
        AxisHypothesis {
            matrix: Matrix3::identity() * by,
        }
    }

    /// Factor on lengths.
    pub fn scale(&self) -> f64 {
        self.matrix.determinant().abs().cbrt()
    }

    /// Tests whether the convention changes lengths.
    pub fn is_scaled(&self) -> bool {
        (self.scale() - 1.0).abs() > 1e-6
    }

    /// Tests whether two conventions differ only by a rotation about the vertical.
    fn is_like(&self, matrix: &Matrix3<f64>) -> bool {
        let same_up = self.matrix.row(2) == matrix.row(2);
        same_up && self.matrix.determinant() * matrix.determinant() > 0.0
    }

    /// Describes the convention for a cloud declared as `axes`.
    pub fn reason(&self, axes: Axes) -> String {
        if self.is_scaled() {
            return format!(
                "fits with its points multiplied by about {:.2}: it is of another scale, check its unit",
                self.scale()
            );
        }
        let back = axes.matrix().transpose();
        let mut all = Axes::ALL.into_iter();
        if let Some(right) = all.clone().find(|a| self.is_like(&(a.matrix() * back))) {
            return match right {
                Axes::RosFlu => "fits as ros_flu: the cloud was converted twice".to_owned(),
                _ => format!("fits as {right}, not as {axes}: name its axes"),
            };
        }
        if axes == Axes::RosFlu
            && let Some(twice) = all.find(|a| self.is_like(&a.matrix().transpose()))
        {
            return format!(
                "fits with a conversion from {twice} undone: the cloud was converted twice"
            );
        }
        let mirrored = match self.matrix.determinant() < 0.0 {
            true => "mirrored",
            false => "turned",
        };
        let up = self.matrix.row(2);
        let name = ["x", "y", "z"].into_iter().zip(up.iter());
        let up = name.fold(String::new(), |text, (name, c)| match *c {
            c if c > 0.0 => name.to_owned(),
            c if c < 0.0 => format!("-{name}"),
            _ => text,
        });
        format!("fits only {mirrored}, with its {up} axis up: check its axes")
    }
}
