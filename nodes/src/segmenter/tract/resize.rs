//! Linear image resizing: rows first, then columns, in place of tract's pass over all values per tap.

use std::cell::RefCell;

use tract_linalg::multithread::par_chunks_mut;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::internal::*;
use tract_onnx::tract_hir::tract_core::op_out_of_plan;
use tract_onnx::tract_hir::tract_core::ops::nn::resize::{self, AxisPlan};

/// Resizing of rows and columns of images (1 x channels x rows x columns).
#[derive(Clone, Debug, Hash, PartialEq, Eq)]
pub(super) struct Resize {
    /// Operator of tract, which computes the coordinates.
    pub asked: resize::Resize,
    /// Bits of the row and column scales.
    pub scales: [u32; 2],
    /// Shape of the output.
    pub output: [usize; 4],
}

thread_local! {
    /// Resized rows of a channel, reused: buffers of this size would be allocated from the system each time.
    static SCRATCH: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

/// Two source indices per output, and their weights.
fn taps(plan: &AxisPlan) -> Vec<([usize; 2], [f32; 2])> {
    let (places, _) = plan.indices.as_chunks::<2>();
    let (weights, _) = plan.weights.as_chunks::<2>();
    places
        .iter()
        .copied()
        .zip(weights.iter().copied())
        .collect()
}

impl Op for Resize {
    fn name(&self) -> StaticName {
        "LinearResize".into()
    }

    fn validation(&self) -> Validation {
        Validation::Rounding
    }

    op_as_typed_op!();
}

impl EvalOp for Resize {
    op_out_of_plan!();

    fn eval(&self, _: &EvalContext, inputs: TVec<TValue>) -> TractResult<TVec<TValue>> {
        let input = args_1!(inputs);
        let &[_, _, rows, columns] = input.shape() else {
            bail!("{:?} is not an image", input.shape());
        };
        let [_, _, height, width] = self.output;
        let [vertical, horizontal] = self.scales.map(f32::from_bits);
        let vertical = taps(&self.asked.plan_axis(vertical, rows, height));
        let horizontal = taps(&self.asked.plan_axis(horizontal, columns, width));
        let input = input.try_as_plain_ram()?;
        let input = input.as_slice::<f32>()?;
        let mut output = Tensor::zero::<f32>(&self.output)?;
        let mut values = output.try_as_plain_ram_mut()?;
        let values = values.as_slice_mut::<f32>()?;
        let (from, to) = (rows * columns, height * width);
        par_chunks_mut(
            values,
            to,
            input.len().max(self.output.iter().product()),
            |first, output| {
                let input = input.chunks_exact(from).skip(first);
                SCRATCH.with_borrow_mut(|scaled| {
                    for (input, output) in input.zip(output.chunks_exact_mut(to)) {
                        scale_rows(input, columns, &horizontal, scaled);
                        scale_columns(scaled, width, &vertical, output);
                    }
                });
                Ok(())
            },
        )?;
        Ok(tvec!(output.into_tvalue()))
    }
}

fn scale_rows(
    input: &[f32],
    columns: usize,
    taps: &[([usize; 2], [f32; 2])],
    scaled: &mut Vec<f32>,
) {
    scaled.clear();
    let value = |row: &[f32], at: usize| row.get(at).copied().unwrap_or_default();
    for row in input.chunks_exact(columns) {
        scaled.extend(
            taps.iter()
                .map(|([a, b], [of_a, of_b])| of_a * value(row, *a) + of_b * value(row, *b)),
        );
    }
}

fn scale_columns(
    scaled: &[f32],
    width: usize,
    taps: &[([usize; 2], [f32; 2])],
    output: &mut [f32],
) {
    let row = |at: usize| scaled.get(at * width..).unwrap_or_default();
    for (([a, b], [of_a, of_b]), output) in taps.iter().zip(output.chunks_exact_mut(width)) {
        for ((value, a), b) in output.iter_mut().zip(row(*a)).zip(row(*b)) {
            *value = of_a * a + of_b * b;
        }
    }
}

impl TypedOp for Resize {
    fn output_facts(&self, _: &[&TypedFact]) -> TractResult<TVec<TypedFact>> {
        Ok(tvec!(f32::fact(self.output)))
    }

    as_op!();
}

#[cfg(test)]
mod tests {
    use tract_onnx::tract_hir::tract_core::ops::nn::resize::{
        CoordTransformer, Interpolator, Nearest,
    };

    use super::*;

    #[test]
    fn images_are_those_of_tract() {
        let modes = [
            CoordTransformer::HalfPixel,
            CoordTransformer::AlignCorners,
            CoordTransformer::Asymmetric,
        ];
        for (coord_transformer, [height, width]) in modes
            .into_iter()
            .flat_map(|mode| [[14, 33], [7, 4], [3, 9]].map(|size| (mode.clone(), size)))
        {
            let asked = resize::Resize {
                coord_transformer,
                interpolator: Interpolator::Linear,
                nearest: Nearest::Floor,
                optional_scales_input: None,
                optional_sizes_input: Some(1),
            };
            let values: Vec<f32> = (0..2 * 7 * 9).map(|i| (i as f32 * 0.7).sin()).collect();
            let image = Tensor::from_shape(&[1, 2, 7, 9], &values)
                .unwrap()
                .into_tvalue();
            let output = [1, 2, height, width];
            let sizes = tensor1(&output.map(|n| n as i64)).into_tvalue();
            let context = EvalContext::out_of_plan();
            let expected = asked.eval(&context, tvec!(image.clone(), sizes)).unwrap();
            let scales = [height as f32 / 7.0, width as f32 / 9.0].map(f32::to_bits);
            let ours = Resize {
                asked,
                scales,
                output,
            };
            let found = ours.eval(&context, tvec!(image)).unwrap();
            found[0]
                .close_enough(&expected[0], Approximation::Close)
                .unwrap();
        }
    }
}
