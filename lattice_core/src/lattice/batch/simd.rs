//! Instruction sets of the kernel.
//!
//! The kernel is plain code, vectorized by the compiler. AVX2 is twice as fast as the baseline. AVX-512 is not
//! offered: the compiler then gathers the coordinates at a quarter of the speed. Fused multiply-add is not used,
//! since it changes bits.

use super::form::Form;
use super::kernel::{self, BLOCK, Constants, LaneSums, Lanes};

/// Kernel of one lattice and instruction set.
pub(super) type Run = fn(&Constants, &[[f32; 3]; BLOCK], &mut Lanes) -> LaneSums;

/// Instruction set; all yield the same bits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Simd {
    /// Baseline instructions of the target.
    Portable,
    /// 256-bit vectors on x86-64; the portable code on other machines.
    Avx2,
}

impl Simd {
    /// Detects the best instruction set.
    pub fn detect() -> Simd {
        if avx2_is_here() {
            Simd::Avx2
        } else {
            Simd::Portable
        }
    }

    pub(super) fn run<F: Form, const DIAGONAL: bool, const STATISTICS: bool>(self) -> Run {
        match self {
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 if avx2_is_here() => checked_avx2::<F, DIAGONAL, STATISTICS>,
            _ => kernel::block::<F, DIAGONAL, STATISTICS>,
        }
    }
}

fn avx2_is_here() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Called only by `Simd::run`, which detected AVX2.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
fn checked_avx2<F: Form, const DIAGONAL: bool, const STATISTICS: bool>(
    c: &Constants,
    points: &[[f32; 3]; BLOCK],
    out: &mut Lanes,
) -> LaneSums {
    // SAFETY: `run` returns this function only if AVX2 was detected.
    unsafe { avx2::<F, DIAGONAL, STATISTICS>(c, points, out) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<F: Form, const DIAGONAL: bool, const STATISTICS: bool>(
    c: &Constants,
    points: &[[f32; 3]; BLOCK],
    out: &mut Lanes,
) -> LaneSums {
    kernel::block::<F, DIAGONAL, STATISTICS>(c, points, out)
}
