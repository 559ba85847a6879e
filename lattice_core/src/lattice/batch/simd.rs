//! Instruction sets that the kernel is compiled for.
//!
//! The kernel is plain code; the compiler vectorises it for what a function allows. AVX2 is worth a
//! factor of two over the baseline; AVX-512 is not offered, since the compiler then gathers the
//! coordinates at a quarter of the speed. No fused multiply-add: it would change bits.

use super::form::Form;
use super::kernel::{self, BLOCK, Constants, LaneSums, Lanes};

/// The kernel for some lattice and instruction set.
pub(super) type Run = fn(&Constants, &[[f32; 3]; BLOCK], &mut Lanes) -> LaneSums;

/// An instruction set; all give the same bits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Simd {
    /// Instructions of every machine of the target.
    Portable,
    /// 256-bit vectors on x86-64; the portable code on a machine without them.
    Avx2,
}

impl Simd {
    /// The best that this machine has.
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

/// Called only through `Simd::run`, which has looked whether the machine has AVX2.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
fn checked_avx2<F: Form, const DIAGONAL: bool, const STATISTICS: bool>(
    c: &Constants,
    points: &[[f32; 3]; BLOCK],
    out: &mut Lanes,
) -> LaneSums {
    // SAFETY: `run` hands this function out only where the machine has AVX2.
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
