//! Weighted sums of shifted rows: the inner loop of a convolution, vectorised for the running processor.

use pulp::{Simd, WithSimd};

/// Outputs summed together: each loaded value is used for all of them.
pub(super) const OUTPUTS: usize = 4;
/// Limit of positions summed together; as many values are read beyond the last, and sums written.
pub(super) const MAX_LANES: usize = 64;

/// Sums of some outputs at all positions: at position `p` the sum over all taps of `planes[at + p]` times the weight,
/// where `at` is the offset of the tap in its channel.
pub(super) struct Sums<'a> {
    /// Weight of each output at each tap, channel by channel.
    pub weights: &'a [[f32; OUTPUTS]],
    /// Bias of each output.
    pub bias: [f32; OUTPUTS],
    /// Values of all channels in sequence.
    pub planes: &'a [f32],
    /// Values of each channel in `planes`.
    pub channel: usize,
    /// Offset of each tap in a channel.
    pub taps: &'a [usize],
    /// Number of positions.
    pub positions: usize,
    /// One row per output, of `positions` plus [`MAX_LANES`].
    pub rows: &'a mut [f32],
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // As many sums as registers, besides the loaded values.
        if S::REGISTER_COUNT >= 32 {
            self.of_all::<S, 4>(simd);
        } else {
            self.of_all::<S, 2>(simd);
        }
    }
}

impl Sums<'_> {
    #[inline(always)]
    fn of_all<S: Simd, const N: usize>(self, simd: S) {
        let lanes = N * S::F32_LANES;
        let length = self.positions + MAX_LANES;
        for begin in (0..self.positions).step_by(lanes) {
            let sums = self.at::<S, N>(simd, begin);
            for (row, sums) in self.rows.chunks_exact_mut(length).zip(sums) {
                let row = row.get_mut(begin..begin + lanes).unwrap_or_default();
                let (row, _) = S::as_mut_simd_f32s(row);
                for (value, sum) in row.iter_mut().zip(sums) {
                    *value = sum;
                }
            }
        }
    }

    /// Sums from a position on.
    #[inline(always)]
    fn at<S: Simd, const N: usize>(&self, simd: S, begin: usize) -> [[S::f32s; N]; OUTPUTS] {
        let mut sums = self.bias.map(|bias| [simd.splat_f32s(bias); N]);
        let mut channel = self.planes.get(begin..).unwrap_or_default();
        for weights in self.weights.chunks_exact(self.taps.len()) {
            for (weights, tap) in weights.iter().zip(self.taps) {
                let values = channel.get(*tap..).unwrap_or_default();
                let values = values.get(..N * S::F32_LANES).unwrap_or_default();
                let Some(values) = S::as_simd_f32s(values).0.first_chunk::<N>() else {
                    continue;
                };
                for (sums, weight) in sums.iter_mut().zip(weights) {
                    let weight = simd.splat_f32s(*weight);
                    for (sum, value) in sums.iter_mut().zip(values) {
                        *sum = simd.mul_add_e_f32s(weight, *value, *sum);
                    }
                }
            }
            channel = channel.get(self.channel..).unwrap_or_default();
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use pulp::Arch;

    use super::*;

    #[test]
    fn sums_are_those_of_each_tap_and_channel() {
        let channel = 40;
        let planes: Vec<f32> = (0..2 * channel + MAX_LANES).map(|i| i as f32).collect();
        let weights = [
            [1.0, 0.0, 2.0, 0.5],
            [0.0, 1.0, -1.0, 0.5],
            [0.0; 4],
            [1.0; 4],
        ];
        let taps = [3, 7];
        let positions = 30;
        for arch in [Arch::new(), Arch::Scalar] {
            let mut rows = vec![f32::NAN; OUTPUTS * (positions + MAX_LANES)];
            arch.dispatch(Sums {
                weights: &weights,
                bias: [0.0, 1.0, 2.0, 3.0],
                planes: &planes,
                channel,
                taps: &taps,
                positions,
                rows: &mut rows,
            });
            for (output, row) in rows.chunks_exact(positions + MAX_LANES).enumerate() {
                for (p, sum) in row.iter().take(positions).enumerate() {
                    let (a, b) = (planes[p + 3], planes[p + 7]);
                    let second = planes[channel + p + 7];
                    let [first, last] = [weights[0][output], weights[1][output]];
                    assert_eq!(*sum, output as f32 + first * a + last * b + second);
                }
            }
        }
    }
}
