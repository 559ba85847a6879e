//! Image convolution as sums of shifted rows in bands, in place of tract's gathering of every pixel per tap.

use std::cell::RefCell;
use std::ops::Range;

use pulp::Arch;
use rayon::prelude::*;
use tract_linalg::multithread::{Executor, current_tract_executor};
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::internal::*;
use tract_onnx::tract_hir::tract_core::op_out_of_plan;

use super::planes::Layout;
use super::taps::{MAX_LANES, OUTPUTS, Sums};

/// Convolution of one image (1 x channels x rows x columns), with weights and bias in the order of [`packed`].
#[derive(Clone, Debug, Hash, PartialEq, Eq)]
pub(super) struct Convolution {
    pub layout: Layout,
    /// Shape of the output: 1 x channels x rows x columns.
    pub output: [usize; 4],
}

/// Packs weights (outputs x `taps`) in groups of [`OUTPUTS`], contiguous per tap, padded with zeros.
pub(super) fn packed(values: &[f32], outputs: usize) -> Vec<f32> {
    let taps = values.len() / outputs.max(1);
    let mut packed = vec![0.0; outputs.next_multiple_of(OUTPUTS) * taps];
    for (block, values) in packed
        .chunks_exact_mut((OUTPUTS * taps).max(1))
        .zip(values.chunks((OUTPUTS * taps).max(1)))
    {
        for (output, values) in values.chunks_exact(taps.max(1)).enumerate() {
            for (to, value) in block.iter_mut().skip(output).step_by(OUTPUTS).zip(values) {
                *to = *value;
            }
        }
    }
    packed
}

/// Output rows of a band, and its part of each channel.
struct Band<'a> {
    rows: Range<usize>,
    outputs: Vec<&'a mut [f32]>,
}

thread_local! {
    /// Planes and sums of a band, reused: buffers of this size would be allocated from the system each time.
    static SCRATCH: RefCell<[Vec<f32>; 2]> = const { RefCell::new([Vec::new(), Vec::new()]) };
}

impl Convolution {
    fn bands<'a>(&self, output: &'a mut [f32]) -> Vec<Band<'a>> {
        let [_, _, rows, columns] = self.output;
        let band = self.layout.band;
        let begins = (0..rows).step_by(band);
        let mut bands: Vec<Band> = begins
            .map(|begin| Band {
                rows: begin..rows.min(begin + band),
                outputs: Vec::new(),
            })
            .collect();
        for plane in output.chunks_exact_mut((rows * columns).max(1)) {
            for (band, rows) in bands.iter_mut().zip(plane.chunks_mut(band * columns)) {
                band.outputs.push(rows);
            }
        }
        bands
    }

    fn fill(&self, band: &mut Band, image: &[f32], weights: &[f32], bias: &[f32], taps: &[usize]) {
        let arch = Arch::new();
        let width = self.layout.width();
        let positions = band.rows.len() * width;
        SCRATCH.with_borrow_mut(|[planes, sums]| {
            self.layout.fill(image, &band.rows, planes);
            sums.resize(OUTPUTS * (positions + MAX_LANES), 0.0);
            let (weights, _) = weights.as_chunks::<OUTPUTS>();
            let (bias, _) = bias.as_chunks::<OUTPUTS>();
            let weights = weights.chunks_exact((weights.len() / bias.len().max(1)).max(1));
            let outputs = band.outputs.chunks_mut(OUTPUTS);
            for ((weights, bias), outputs) in weights.zip(bias).zip(outputs) {
                arch.dispatch(Sums {
                    weights,
                    bias: *bias,
                    planes,
                    channel: self.layout.channel(),
                    taps,
                    positions,
                    rows: sums,
                });
                let rows = sums.chunks_exact(positions + MAX_LANES);
                for (output, sums) in outputs.iter_mut().zip(rows) {
                    let [.., columns] = self.output;
                    let rows = output.chunks_exact_mut(columns);
                    for (to, from) in rows.zip(sums.chunks_exact(width)) {
                        let from = from.get(..columns).unwrap_or_default();
                        to.copy_from_slice(from);
                    }
                }
            }
        });
    }
}

impl Op for Convolution {
    fn name(&self) -> StaticName {
        "Convolution".into()
    }

    fn validation(&self) -> Validation {
        Validation::Rounding
    }

    op_as_typed_op!();
}

impl EvalOp for Convolution {
    op_out_of_plan!();

    fn eval(&self, _: &EvalContext, inputs: TVec<TValue>) -> TractResult<TVec<TValue>> {
        let (image, weights, bias) = args_3!(inputs);
        let (image, weights) = (image.try_as_plain_ram()?, weights.try_as_plain_ram()?);
        let bias = bias.try_as_plain_ram()?;
        let (image, weights) = (image.as_slice::<f32>()?, weights.as_slice::<f32>()?);
        let bias = bias.as_slice::<f32>()?;
        let mut output = Tensor::zero::<f32>(&self.output)?;
        let mut values = output.try_as_plain_ram_mut()?;
        let mut bands = self.bands(values.as_slice_mut::<f32>()?);
        let taps = self.layout.taps();
        let fill = |band: &mut Band| self.fill(band, image, weights, bias, &taps);
        match current_tract_executor() {
            Executor::MultiThread(pool) => pool.install(|| bands.par_iter_mut().for_each(fill)),
            _ => bands.iter_mut().for_each(fill),
        }
        Ok(tvec!(output.into_tvalue()))
    }
}

impl TypedOp for Convolution {
    fn output_facts(&self, _: &[&TypedFact]) -> TractResult<TVec<TypedFact>> {
        Ok(tvec!(f32::fact(self.output)))
    }

    as_op!();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_four_outputs_stand_side_by_side() {
        let weights: Vec<f32> = (0..15).map(|i| i as f32).collect();
        let expected = [
            [0., 3., 6., 9.],
            [1., 4., 7., 10.],
            [2., 5., 8., 11.],
            [12., 0., 0., 0.],
            [13., 0., 0., 0.],
            [14., 0., 0., 0.],
        ];
        assert_eq!(packed(&weights, 5), expected.concat());
        assert!(packed(&[], 0).is_empty());
    }
}
