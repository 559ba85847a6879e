//! Robust kernels: cost of a squared distance and its derivative.

/// Cost of a correspondence with weight w and squared Mahalanobis distance d2.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kernel {
    /// w d2
    None,
    /// w a2 ln(1 + d2 / a2)
    Cauchy { a2: f64 },
    /// a2 ln(1 + w d2 / a2), as printed in the seed paper
    CauchyAround { a2: f64 },
    /// w a2 / 2 ln(1 + d2^2 / a2), a Cauchy loss on the residual d2
    CauchyOfSquare { a2: f64 },
}

impl Kernel {
    /// Cost and its derivative by d2.
    #[inline(always)]
    pub fn apply(self, weight: f64, squared: f64) -> (f64, f64) {
        match self {
            Kernel::None => (weight * squared, weight),
            Kernel::Cauchy { a2 } => {
                let x = squared / a2;
                (weight * a2 * x.ln_1p(), weight / (1.0 + x))
            }
            Kernel::CauchyAround { a2 } => {
                let x = weight * squared / a2;
                (a2 * x.ln_1p(), weight / (1.0 + x))
            }
            Kernel::CauchyOfSquare { a2 } => {
                let x = squared * squared / a2;
                let slope = weight * squared / (1.0 + x);
                (0.5 * weight * a2 * x.ln_1p(), slope)
            }
        }
    }
}
