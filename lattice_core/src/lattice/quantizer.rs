//! Selection of the closed form of a lattice.

use std::sync::Arc;

use nalgebra::Matrix3;

use super::basis::Basis;
use super::closed_form::{Bcc, Cubic, Fcc, Hex, Mcc};
use super::kind::LatticeKind;

/// Closed form of a lattice; a custom basis uses a short search instead.
#[derive(Clone, Debug)]
pub(super) enum Quantizer {
    Cubic(Cubic),
    Bcc(Bcc),
    Fcc(Fcc),
    Mcc(Mcc),
    Hex(Hex),
    Basis(Arc<Basis>),
}

/// Dispatches on the form once, outside the loop.
macro_rules! with_form {
    ($quantizer:expr, $form:ident => $body:expr) => {
        match $quantizer {
            &Quantizer::Cubic($form) => $body,
            &Quantizer::Bcc($form) => $body,
            &Quantizer::Fcc($form) => $body,
            &Quantizer::Mcc($form) => $body,
            &Quantizer::Hex($form) => $body,
            Quantizer::Basis(basis) => {
                let $form = basis.as_ref();
                $body
            }
        }
    };
}
pub(super) use with_form;

impl Quantizer {
    /// Form of a generator in metres, oriented as in the paper; `None` for `Custom`.
    pub(super) fn new(kind: LatticeKind, g: &Matrix3<f64>) -> Option<Quantizer> {
        Some(match kind {
            LatticeKind::Cubic => Self::Cubic(Cubic {
                per_metre: 1.0 / g.m11,
            }),
            LatticeKind::Bcc => Self::Bcc(Bcc {
                per_metre: 1.0 / g.m11,
            }),
            LatticeKind::Fcc => Self::Fcc(Fcc {
                per_metre: 1.0 / g.m12,
            }),
            LatticeKind::Mcc => Self::Mcc(Mcc {
                turn: cuboid_axes(g),
            }),
            LatticeKind::Hex | LatticeKind::HexOptimal => Self::Hex(Hex {
                per_metre: [1.0 / g.m11, 0.5 / g.m22, 1.0 / g.m33],
            }),
            LatticeKind::Custom => return None,
        })
    }
}

/// Rows that map a point to units of the sides of the MCC cuboid: S G^-1 / 2.
///
/// S (rows 1,1,-1; -1,1,1; 1,-1,1) expresses the paper's basis as half diagonals. S G^-1 is a rotation up to the
/// sides, so it preserves distances.
pub(super) fn cuboid_axes(g: &Matrix3<f64>) -> [[f64; 3]; 3] {
    // Inverse of an upper triangular matrix.
    let (i11, i22, i33) = (1.0 / g.m11, 1.0 / g.m22, 1.0 / g.m33);
    let (i12, i23) = (-g.m12 * i11 * i22, -g.m23 * i22 * i33);
    let i13 = (g.m12 * g.m23 * i22 - g.m13) * i11 * i33;
    [
        [0.5 * i11, 0.5 * (i12 + i22), 0.5 * (i13 + i23 - i33)],
        [-0.5 * i11, 0.5 * (i22 - i12), 0.5 * (i23 - i13 + i33)],
        [0.5 * i11, 0.5 * (i12 - i22), 0.5 * (i13 - i23 + i33)],
    ]
}
