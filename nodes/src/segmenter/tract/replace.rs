//! Replacement of slow tract operators by our own.

use tract_onnx::prelude::*;
use tract_onnx::tract_hir::internal::*;
use tract_onnx::tract_hir::tract_core::ops::binary::TypedBinOp;
use tract_onnx::tract_hir::tract_core::ops::cnn::Conv;
use tract_onnx::tract_hir::tract_core::ops::cnn::conv::KernelFormat;
use tract_onnx::tract_hir::tract_core::ops::nn::DataFormat;
use tract_onnx::tract_hir::tract_core::ops::nn::resize::{self, Interpolator};

use super::convolution::{Convolution, packed};
use super::planes::{Axis, Layout};
use super::resize::Resize;

/// Smallest output size (pixels) worth replacing.
const MIN_PIXELS: usize = 64;

/// Decluttered model with our operators.
pub(super) fn replaced(mut model: TypedModel) -> TractResult<TypedModel> {
    let convolutions = Rewriter::default().with_rule_for("convolution", convolution);
    // Decluttering converts single-pixel convolutions to matrix products, and folds norms into the others.
    convolutions.rewrite(&false, &mut model)?;
    let mut model = model.into_decluttered()?;
    let rest =
        convolutions.with_rule_for("resize", |_, model, node, _, op| resized(model, node, op));
    rest.rewrite(&true, &mut model)?;
    Ok(model)
}

type Patch = TractResult<Option<TypedModelPatch>>;

fn convolution(last: &bool, model: &TypedModel, node: &TypedNode, name: &str, op: &Conv) -> Patch {
    let pool = &op.pool_spec;
    rule_if!(op.group == 1 && op.q_params.is_none() && op.kernel_fmt == KernelFormat::OIHW);
    rule_if!(pool.data_format == DataFormat::NCHW && node.inputs.len() == 3);
    rule_if!(*last || !is_scaled(model, node));
    let inputs = model.node_input_facts(node.id)?;
    let [image, weights, bias] = inputs.as_slice() else {
        return Ok(None);
    };
    rule_if!(image.datum_type == f32::datum_type());
    let (Some(weights), Some(bias)) = (&weights.konst, &bias.konst) else {
        return Ok(None);
    };
    rule_if_some!(shape = image.shape.as_concrete());
    let &[1, channels, rows, columns] = shape else {
        return Ok(None);
    };
    let padding = pool.computed_padding(&[rows, columns]);
    let axis = |at: usize, input: usize| {
        Some(Axis {
            input,
            output: padding.get(at)?.convoluted,
            kernel: *pool.kernel_shape.get(at)?,
            stride: pool.stride(at),
            dilation: pool.dilation(at),
            padding: padding.get(at)?.pad_before,
        })
    };
    let (Some(rows), Some(columns)) = (axis(0, rows), axis(1, columns)) else {
        return Ok(None);
    };
    let (height, width) = (rows.output, columns.output);
    rule_if!(height * width >= MIN_PIXELS);
    let outputs = pool.output_channels;
    rule_if_some!(layout = Layout::new(channels, rows, columns));
    let output = [1, outputs, height, width];
    let weights = weights.try_as_plain_ram()?.as_slice::<f32>()?;
    rule_if!(weights.len() == outputs * channels * rows.kernel * columns.kernel);
    let bias = bias.try_as_plain_ram()?.as_slice::<f32>()?.to_vec();
    let bias = match *bias.as_slice() {
        [bias] => vec![bias; outputs],
        _ => bias,
    };
    rule_if!(bias.len() == outputs);
    let (weights, bias) = (packed(weights, outputs), packed(&bias, outputs));
    let mut patch = TypedModelPatch::default();
    rule_if_some!(image = node.inputs.first());
    let image = patch.tap_model(model, *image)?;
    let constant = |values: &[f32]| Tensor::from_shape(&[values.len()], values);
    let weights = patch.add_const(format!("{name}.weights"), constant(&weights)?)?;
    let bias = patch.add_const(format!("{name}.bias"), constant(&bias)?)?;
    let made = patch.wire_node(
        name,
        Convolution { layout, output },
        &[image, weights, bias],
    )?;
    rule_if_some!(made = made.first());
    patch.shunt_outside(model, node.id.into(), *made)?;
    Ok(Some(patch))
}

/// True if the only successor of a node is a scale or offset, as of a norm.
fn is_scaled(model: &TypedModel, node: &TypedNode) -> bool {
    let mut after = node.outputs.iter().flat_map(|output| &output.successors);
    let (Some(next), None) = (after.next(), after.next()) else {
        return false;
    };
    let next = model.node(next.node).op_as::<TypedBinOp>();
    next.is_some_and(|next| matches!(next.0.name(), "Mul" | "Add" | "Sub" | "Div"))
}

fn resized(model: &TypedModel, node: &TypedNode, op: &resize::Resize) -> Patch {
    rule_if!(op.interpolator == Interpolator::Linear);
    let facts = model.node_input_facts(node.id)?;
    rule_if_some!(input = facts.first());
    rule_if!(input.datum_type == f32::datum_type());
    let output = model.node_output_facts(node.id)?;
    rule_if_some!(output = output.first());
    let (Some(from), Some(to)) = (input.shape.as_concrete(), output.shape.as_concrete()) else {
        return Ok(None);
    };
    let (&[1, channels, rows, columns], &[1, same, height, width]) = (from, to) else {
        return Ok(None);
    };
    rule_if!(channels == same && rows * columns * height * width > 0);
    let given = op.optional_scales_input.and_then(|at| facts.get(at));
    let given = given.filter(|given| given.shape.volume() == 4.to_dim());
    let scales = match given {
        None => [height as f32 / rows as f32, width as f32 / columns as f32],
        Some(given) => {
            rule_if_some!(given = &given.konst);
            let given = given.cast_to::<f32>()?;
            match *given.try_as_plain_ram()?.as_slice::<f32>()? {
                [1.0, 1.0, vertical, horizontal] => [vertical, horizontal],
                _ => return Ok(None),
            }
        }
    };
    let op = Resize {
        asked: op.clone(),
        scales: scales.map(f32::to_bits),
        output: [1, channels, height, width],
    };
    rule_if_some!(input = node.inputs.first());
    TypedModelPatch::replace_single_op(model, node, &[*input], op).map(Some)
}

#[cfg(test)]
mod tests {
    use tract_onnx::tract_hir::tract_core::ops::cnn::{PaddingSpec, PoolSpec};
    use tract_onnx::tract_hir::tract_core::ops::math::{add, mul};

    use super::*;

    fn numbers(shape: &[usize]) -> Tensor {
        let values: Vec<f32> = (0..shape.iter().product())
            .map(|i: usize| (i as f32 * 1.7).sin())
            .collect();
        Tensor::from_shape(shape, &values).unwrap()
    }

    /// A convolution of 6 channels to 7, with a factor and a term for each channel after it.
    fn model([kernel, stride, dilation, padding]: [usize; 4], group: usize) -> TypedModel {
        let mut model = TypedModel::default();
        let image = model
            .add_source("image", f32::fact([1, 6, 19, 30]))
            .unwrap();
        let outputs = if group == 1 { 7 } else { 6 };
        let weights = numbers(&[outputs, 6 / group, kernel, kernel]);
        let weights = model.add_const("weights", weights).unwrap();
        let bias = model.add_const("bias", numbers(&[outputs])).unwrap();
        let op = Conv {
            pool_spec: PoolSpec {
                data_format: DataFormat::NCHW,
                kernel_shape: tvec!(kernel, kernel),
                padding: PaddingSpec::Explicit(tvec!(padding, padding), tvec!(padding, padding)),
                dilations: Some(tvec!(dilation, dilation)),
                strides: Some(tvec!(stride, stride)),
                input_channels: 6,
                output_channels: outputs,
            },
            kernel_fmt: KernelFormat::OIHW,
            group,
            q_params: None,
        };
        let made = model
            .wire_node("convolution", op, &[image, weights, bias])
            .unwrap();
        let per_channel = [1, outputs, 1, 1];
        let factor = model.add_const("factor", numbers(&per_channel)).unwrap();
        let term = model.add_const("term", numbers(&per_channel)).unwrap();
        let made = model
            .wire_node("scaled", mul(), &[made[0], factor])
            .unwrap();
        let made = model.wire_node("moved", add(), &[made[0], term]).unwrap();
        model.select_output_outlets(&made).unwrap();
        model
    }

    fn ours(model: &TypedModel) -> usize {
        let nodes = model.nodes.iter();
        nodes
            .filter(|node| node.op_is::<Convolution>() || node.op_is::<Resize>())
            .count()
    }

    fn run(model: TypedModel) -> Tensor {
        let plan = model.into_optimized().unwrap().into_runnable().unwrap();
        let image = numbers(&[1, 6, 19, 30]);
        plan.run(tvec!(image.into()))
            .unwrap()
            .remove(0)
            .into_tensor()
    }

    #[test]
    fn convolutions_are_those_of_tract_and_norms_are_taken_in() {
        for case in [
            [3, 1, 1, 1],
            [3, 2, 1, 1],
            [3, 1, 4, 4],
            [7, 2, 1, 3],
            [5, 1, 1, 0],
        ] {
            let replaced = replaced(model(case, 1)).unwrap();
            assert_eq!(ours(&replaced), 1);
            assert!(!replaced.nodes.iter().any(|node| node.op_is::<TypedBinOp>()));
            let expected = run(model(case, 1));
            run(replaced)
                .close_enough(&expected, Approximation::Approximate)
                .unwrap();
        }
    }

    #[test]
    fn groups_and_small_outputs_are_left_to_tract() {
        for model in [model([3, 1, 1, 1], 6), model([3, 4, 1, 1], 1)] {
            assert_eq!(ours(&replaced(model).unwrap()), 0);
        }
    }
}
