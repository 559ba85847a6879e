//! Checks of a model file before it is loaded.

use tract_onnx::pb::tensor_proto::DataLocation;
use tract_onnx::pb::{AttributeProto, GraphProto, ModelProto, NodeProto, TensorProto};
use tract_onnx::prelude::TractError;

/// Limit of values per tensor: 1 GiB of floats.
pub(super) const MAX_TENSOR_VALUES: usize = 1 << 28;
/// Limit of operators per graph: preparation time grows with the square. Chosen, not measured;
/// slow graphs below it end at the load timeout.
const MAX_OPERATORS: usize = 4000;
/// Longest quoted text of a file, characters.
const SHOWN: usize = 160;

/// Text of a file, shortened to one line for messages.
pub(super) fn shown(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    line.chars()
        .filter(|c| !c.is_control())
        .take(SHOWN)
        .collect()
}

/// Error for a panic of the backend's library.
pub(super) const PANICKED: &str =
    "the backend panicked on an image, see standard error; set the other `backend`";

/// First line of an error, without the chain of operators.
pub(super) fn first_line(error: &TractError) -> String {
    let text = error.chain().map(|cause| shown(&cause.to_string()));
    let text: Vec<String> = text.collect();
    text.join(": ")
}

/// Checks that all operators are known and that tensors contain their stated values.
pub(super) fn model(model: &ModelProto, known: impl Fn(&str) -> bool) -> Result<(), String> {
    let graph = model
        .graph
        .as_ref()
        .ok_or("not an ONNX file: the graph is missing")?;
    let mut unknown = Vec::new();
    self::graph(graph, &known, &mut unknown)?;
    unknown.sort();
    unknown.dedup();
    if unknown.is_empty() {
        return Ok(());
    }
    Err(format!(
        "unknown operators: {}; export the model with others, or set `backend: ort`",
        unknown.join(", ")
    ))
}

fn graph(
    graph: &GraphProto,
    known: &impl Fn(&str) -> bool,
    unknown: &mut Vec<String>,
) -> Result<(), String> {
    let operators = graph.node.len();
    if operators > MAX_OPERATORS {
        return Err(format!("{operators} operators, more than {MAX_OPERATORS}"));
    }
    for given in &graph.initializer {
        tensor(given)?;
    }
    for node in &graph.node {
        if !known(&node.op_type) && unknown.len() < 20 {
            unknown.push(shown(&node.op_type));
        }
        made(node, graph)?;
        for attribute in &node.attribute {
            let AttributeProto { t, tensors, .. } = attribute;
            t.iter().chain(tensors).try_for_each(tensor)?;
            // Tensor sizes inside subgraphs could not be bounded.
            if attribute.g.is_some() || !attribute.graphs.is_empty() {
                let operator = shown(&node.op_type);
                return Err(format!("subgraphs are not supported: operator {operator}"));
            }
        }
    }
    let names = graph.node.iter().flat_map(|node| &node.output);
    let names: std::collections::HashSet<&str> = (names.map(String::as_str))
        .chain(graph.input.iter().map(|input| input.name.as_str()))
        .chain(graph.initializer.iter().map(|tensor| tensor.name.as_str()))
        .collect();
    let lost = graph
        .output
        .iter()
        .find(|o| !names.contains(o.name.as_str()));
    match lost {
        Some(output) => Err(format!(
            "no operator computes the output '{}'",
            shown(&output.name)
        )),
        None => Ok(()),
    }
}

/// Number of values of a shape.
fn volume(dims: &[i64]) -> Option<usize> {
    dims.iter().try_fold(1usize, |volume, dim| {
        volume.checked_mul(usize::try_from(*dim).ok()?)
    })
}

fn bounded(name: &str, dims: &[i64]) -> Result<usize, String> {
    let values = volume(dims).filter(|values| *values <= MAX_TENSOR_VALUES);
    values.ok_or_else(|| {
        let name = shown(name);
        format!("tensor '{name}' has the shape {dims:?}, more than {MAX_TENSOR_VALUES} values")
    })
}

fn tensor(tensor: &TensorProto) -> Result<(), String> {
    let name = shown(&tensor.name);
    let is_elsewhere = tensor.data_location == Some(DataLocation::External as i32);
    if is_elsewhere || !tensor.external_data.is_empty() {
        return Err(format!(
            "the values of tensor '{name}' are in an external file: save the model as one file"
        ));
    }
    let values = bounded(&name, &tensor.dims)?;
    // Smallest size of a value in each list.
    let there = [
        tensor.raw_data.len(),
        tensor.float_data.len(),
        2 * tensor.int32_data.len(),
        tensor.int64_data.len(),
        tensor.double_data.len(),
        tensor.uint64_data.len(),
        tensor.string_data.len(),
    ];
    match there.iter().any(|there| *there >= values) {
        true => Ok(()),
        false => Err(format!(
            "tensor '{name}' states {values} values and has fewer"
        )),
    }
}

/// Checks operators whose output shape is given in the file.
fn made(node: &NodeProto, graph: &GraphProto) -> Result<(), String> {
    let shape = match node.op_type.as_str() {
        "ConstantOfShape" => node.input.first(),
        "Expand" | "Tile" => node.input.get(1),
        "Range" => node.input.get(1),
        _ => None,
    };
    let Some(shape) = shape else {
        return Ok(());
    };
    let given = graph
        .initializer
        .iter()
        .find(|tensor| tensor.name == *shape);
    let constants = graph.node.iter().filter(|node| node.op_type == "Constant");
    let constant = || {
        let mut constants = constants;
        let found = constants.find(|node| node.output.first() == Some(shape))?;
        found
            .attribute
            .iter()
            .find_map(|attribute| attribute.t.as_ref())
    };
    let Some(tensor) = given.or_else(constant) else {
        return Ok(());
    };
    let (numbers, _) = tensor.raw_data.as_chunks::<8>();
    let numbers = numbers.iter().map(|bytes| i64::from_le_bytes(*bytes));
    let dims: Vec<i64> = tensor.int64_data.iter().copied().chain(numbers).collect();
    // -1 keeps the length.
    let dims: Vec<i64> = dims
        .into_iter()
        .map(|dim| if dim == -1 { 1 } else { dim })
        .collect();
    bounded(&node.name, &dims).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn graphs_of_too_many_operators_are_refused() {
        let of = |operators: usize| ModelProto {
            graph: Some(GraphProto {
                node: vec![NodeProto::default(); operators],
                ..GraphProto::default()
            }),
            ..ModelProto::default()
        };
        assert_eq!(model(&of(MAX_OPERATORS), |_| true), Ok(()));
        for operators in [MAX_OPERATORS + 1, 5000, 100_000] {
            let error = model(&of(operators), |_| true).unwrap_err();
            assert!(error.contains(&operators.to_string()), "{error}");
        }
    }
}
