//! Tensor sizes of a graph, inferred before allocation.

use std::collections::{BTreeMap, BTreeSet};

use tract_onnx::Onnx;
use tract_onnx::pb::ModelProto;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::Factoid;
use tract_onnx::tract_hir::internal::DimLike;

use super::checks::{self, MAX_TENSOR_VALUES, first_line};
use super::file;
use super::network::Size;

/// Limit of shape inference rounds; each covers the whole graph in order.
const MAX_ROUNDS: usize = 32;
/// Limit of constant values as input of a tensor of unknown size.
const MAX_UNFORESEEN: usize = 1 << 12;

/// Reason why a graph cannot be used.
pub(super) enum Problem {
    /// Tensor size above the limit.
    Size(String),
    /// Other reason: unknown operators, or an invalid graph.
    Other(String),
}

impl From<Problem> for String {
    fn from(problem: Problem) -> Self {
        match problem {
            Problem::Size(text) | Problem::Other(text) => text,
        }
    }
}

/// Model of a graph with its input size and the inferred shapes; tensors above the limit are
/// rejected before allocation.
pub(super) fn analysed(
    onnx: &Onnx,
    proto: &ModelProto,
    size: Option<Size>,
) -> Result<(InferenceModel, Size), Problem> {
    let in_words = |error: TractError| Problem::Other(first_line(&error));
    let model = onnx.model_for_proto_model(proto).map_err(in_words)?;
    let input = input_of(&model, size).map_err(Problem::Other)?;
    let shape = [1, 3, input.height, input.width];
    let mut model = model
        .with_input_fact(0, InferenceFact::dt_shape(f32::datum_type(), shape))
        .map_err(in_words)?;
    analyse(&mut model)?;
    Ok((model, input))
}

/// Propagates shapes and constants from node to node. tract computes constant expressions during analysis,
/// so their sizes must be known first.
fn analyse(model: &mut InferenceModel) -> Result<(), Problem> {
    let in_words = |error: TractError| Problem::Other(first_line(&error));
    let mut order = model.eval_order().map_err(in_words)?;
    // Includes nodes that no output depends on.
    let reached: BTreeSet<usize> = order.iter().copied().collect();
    let nodes = 0..model.nodes().len();
    order.extend(nodes.filter(|node| !reached.contains(node)));
    // Values computed from constants alone, which stay in memory.
    let mut made = BTreeMap::new();
    for _ in 0..MAX_ROUNDS {
        let mut changed = false;
        for node in &order {
            if let Some(values) = foresee(model, *node)? {
                made.insert(*node, values);
                let all = made.values().fold(0usize, |all, n| all.saturating_add(*n));
                if all > MAX_TENSOR_VALUES {
                    return Err(Problem::Size(format!(
                        "{all} values are computed from constants, more than {MAX_TENSOR_VALUES}"
                    )));
                }
            }
            changed |= pass_on(model, *node).map_err(in_words)?;
        }
        if !changed {
            return Ok(());
        }
    }
    let problem = format!("shape inference does not converge within {MAX_ROUNDS} rounds");
    Err(Problem::Size(problem))
}

/// Facts of a node's inputs, its outputs, and of further nodes that it observes.
type Facts = [TVec<InferenceFact>; 3];

fn facts(model: &InferenceModel, node: usize) -> TractResult<(Facts, Vec<OutletId>)> {
    let observed_at = model
        .node(node)
        .op
        .observe_outlets(model, model.node(node))?;
    let (inputs, outputs) = model.node_facts(node)?;
    let observed = observed_at.iter().map(|at| model.outlet_fact(*at).cloned());
    let cloned = |facts: TVec<&InferenceFact>| facts.into_iter().cloned().collect();
    let facts = [
        cloned(inputs),
        cloned(outputs),
        observed.collect::<TractResult<_>>()?,
    ];
    Ok((facts, observed_at))
}

/// Infers facts at a node; true if any changed.
fn pass_on(model: &mut InferenceModel, node: usize) -> TractResult<bool> {
    let ([inputs, outputs, observed], observed_at) = facts(model, node)?;
    let op = &mut model.node_mut(node).op;
    let found = op.infer(
        inputs.iter().collect(),
        outputs.iter().collect(),
        observed.iter().collect(),
    )?;
    let inputs_at = model.node(node).inputs.clone();
    let outputs_at = (0..outputs.len()).map(|slot| OutletId::new(node, slot));
    let places = inputs_at.into_iter().chain(outputs_at).chain(observed_at);
    let (inputs, outputs, observed) = found;
    let mut changed = false;
    for (at, fact) in places.zip(inputs.into_iter().chain(outputs).chain(observed)) {
        let old = model.outlet_fact(at)?;
        let new = old.unify(&fact)?;
        if new != *old {
            model.set_outlet_fact(at, new)?;
            changed = true;
        }
    }
    Ok(changed)
}

/// Checks the output sizes of a node: known ones against the limit, and unknown ones if the node is about to be
/// computed from constants. Returns the number of values in the latter
/// case.
fn foresee(model: &InferenceModel, node: usize) -> Result<Option<usize>, Problem> {
    let in_words = |error: TractError| Problem::Other(first_line(&error));
    let name = || checks::shown(&model.node(node).name);
    let ([inputs, outputs, observed], _) = facts(model, node).map_err(in_words)?;
    let mut op = model.node(node).op.clone();
    let facts = op.infer_facts(
        inputs.iter().collect(),
        outputs.iter().collect(),
        observed.iter().collect(),
    );
    let (inputs, outputs, _) = facts.map_err(in_words)?;
    let constants: Option<Vec<usize>> = inputs
        .iter()
        .map(|input| Some(input.value.concretize()?.len()))
        .collect();
    let constants: Option<usize> = constants
        .filter(|inputs| !inputs.is_empty())
        .map(|inputs| inputs.iter().sum());
    let mut made = 0usize;
    for output in &outputs {
        let dims = output.shape.concretize();
        let dims = dims.and_then(|dims| {
            let dims = dims.iter().map(|dim| dim.to_usize().ok());
            dims.collect::<Option<Vec<usize>>>()
        });
        match (dims, constants) {
            (Some(dims), _) => {
                let values = dims
                    .iter()
                    .try_fold(1usize, |all, dim| all.checked_mul(*dim));
                let Some(values) = values.filter(|values| *values <= MAX_TENSOR_VALUES) else {
                    return Err(Problem::Size(format!(
                        "'{}' has the output shape {dims:?}, more than {MAX_TENSOR_VALUES} values",
                        name()
                    )));
                };
                made = made.saturating_add(values);
            }
            (None, Some(values)) if values > MAX_UNFORESEEN => {
                return Err(Problem::Size(format!(
                    "the output size of '{}' with {values} constant values is unknown",
                    name()
                )));
            }
            (None, _) => {}
        }
    }
    Ok(constants.map(|_| made))
}

/// Checks the tensors of a fully inferred model.
pub(super) fn bounded(model: &TypedModel) -> Result<(), String> {
    for node in model.nodes() {
        for fact in node.outputs.iter().map(|output| &output.fact) {
            let values = fact.shape.volume().to_usize().unwrap_or(usize::MAX);
            if values > MAX_TENSOR_VALUES {
                let name = checks::shown(&node.name);
                return Err(format!(
                    "'{name}' has {values} values, more than {MAX_TENSOR_VALUES}"
                ));
            }
        }
    }
    Ok(())
}

/// Input size of a model.
fn input_of(model: &InferenceModel, size: Option<Size>) -> Result<Size, String> {
    let [_] = model.inputs.as_slice() else {
        let inputs = model.inputs.len();
        return Err(format!("it has {inputs} inputs, expected one: the image"));
    };
    let fact = model.input_fact(0).map_err(|error| first_line(&error))?;
    let wrong = || format!("its input is {fact:?}, expected f32 of 1 x 3 x rows x columns");
    let kind = fact.datum_type.concretize();
    if kind.is_some_and(|kind| kind != f32::datum_type()) {
        return Err(wrong());
    }
    let dims = fact.shape.dims();
    let dims: Vec<Option<usize>> = dims
        .map(|dim| dim.concretize().and_then(|dim| dim.to_usize().ok()))
        .collect();
    file::input_size(&dims, size).unwrap_or_else(|| Err(wrong()))
}
