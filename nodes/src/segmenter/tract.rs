//! Networks in ONNX files, run by tract.

use std::fs::File;
use std::io::{Cursor, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use tract_linalg::multithread::Executor;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::Factoid;
use tract_onnx::tract_hir::internal::DimLike;
use tract_onnx::tract_hir::tract_core::plan::SimplePlan;
use tract_onnx::tract_hir::tract_core::runtime::RunOptions;

use super::checks::{self, MAX_TENSOR_VALUES};
use super::names;
use super::network::{ModelError, Network, Scores, Size, Values};

/// Largest model that is read, bytes: the format holds no more than 2 GiB.
const MAX_MODEL_BYTES: u64 = 1 << 30;

/// A network of a file, made ready for images of one size.
pub(super) struct OnnxNetwork {
    plan: Arc<TypedSimplePlan>,
    input: Size,
    names: Vec<String>,
}

impl OnnxNetwork {
    /// Reads the model of a file. `size` is that of its input where the model leaves that open.
    ///
    /// Errors name the file and what is wrong: no ONNX, operators that there are not, tensors beyond any
    /// bound, inputs or outputs of another shape than images.
    pub(super) fn read(
        path: &Path,
        size: Option<Size>,
        threads: usize,
    ) -> Result<Self, ModelError> {
        let bytes = read(path)?;
        // Whatever a graph makes of the library, it ends here.
        let made = catch_unwind(AssertUnwindSafe(|| made_of(bytes, path, size, threads)));
        let made = made.unwrap_or_else(|_| Err("the graph cannot be read".to_owned()));
        made.map_err(|problem| ModelError::Unusable {
            path: path.to_owned(),
            problem,
        })
    }
}

impl Network for OnnxNetwork {
    fn input(&self) -> Size {
        self.input
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn run(&self, planes: Vec<f32>) -> Result<Scores, String> {
        let run = || -> TractResult<TVec<TValue>> {
            let shape = [1, 3, self.input.height, self.input.width];
            let tensor = Tensor::from_shape(&shape, &planes)?;
            self.plan.run(tvec!(tensor.into()))
        };
        let outputs = catch_unwind(AssertUnwindSafe(run))
            .map_err(|_| "the network failed".to_owned())?
            .map_err(|error| first_line(&error))?;
        let output = outputs.first().ok_or("the network has no output")?;
        scores_of(output)
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ModelError> {
    let on_error = |error| ModelError::File {
        path: path.to_owned(),
        error,
    };
    let file = File::open(path).map_err(on_error)?;
    let bytes = file.metadata().map_err(on_error)?.len();
    if bytes > MAX_MODEL_BYTES {
        return Err(ModelError::Large {
            path: path.to_owned(),
            bytes,
            max: MAX_MODEL_BYTES,
        });
    }
    let mut read = Vec::new();
    file.take(MAX_MODEL_BYTES)
        .read_to_end(&mut read)
        .map_err(on_error)?;
    Ok(read)
}

fn made_of(
    bytes: Vec<u8>,
    path: &Path,
    size: Option<Size>,
    threads: usize,
) -> Result<OnnxNetwork, String> {
    let onnx = tract_onnx::onnx();
    let proto = onnx
        .proto_model_for_read(&mut Cursor::new(bytes))
        .map_err(|_| "this is no ONNX file".to_owned())?;
    let known = |operator: &str| onnx.op_register.0.contains_key(operator);
    checks::model(&proto, known)?;
    let metadata = proto.metadata_props.iter();
    let metadata = metadata.map(|entry| (entry.key.as_str(), entry.value.as_str()));
    let names = names::of_model(metadata, path)?;
    let in_words = |error: TractError| first_line(&error);
    let model = onnx.model_for_proto_model(&proto).map_err(in_words)?;
    let input = input_of(&model, size)?;
    let shape = [1, 3, input.height, input.width];
    let model = model
        .with_input_fact(0, InferenceFact::dt_shape(f32::datum_type(), shape))
        .map_err(in_words)?;
    let model = model.into_typed().map_err(in_words)?;
    for node in model.nodes() {
        for fact in node.outputs.iter().map(|output| &output.fact) {
            let values = fact.shape.volume().to_usize().unwrap_or(usize::MAX);
            if values > MAX_TENSOR_VALUES {
                let name = checks::shown(&node.name);
                return Err(format!("'{name}' has {values} values, more than are made"));
            }
        }
    }
    let model = model.into_optimized().map_err(in_words)?;
    if model.outputs.is_empty() {
        return Err("it has no output".to_owned());
    }
    let options = RunOptions {
        executor: Some(match threads {
            1 => Executor::SingleThread,
            threads => Executor::multithread_with_name(threads, "segmenter"),
        }),
        ..RunOptions::default()
    };
    let plan = SimplePlan::new_with_options(model, &options).map_err(in_words)?;
    let network = OnnxNetwork { plan, input, names };
    // What does not fit shows now, not at the first image.
    let scores = network.run(vec![0.0; 3 * input.pixels()])?;
    if let Values::Scores { classes, .. } = scores.values
        && !network.names.is_empty()
        && network.names.len() != classes
    {
        let names = network.names.len();
        return Err(format!("it has {classes} classes and {names} names"));
    }
    Ok(network)
}

/// Size of the images that a model takes: its own, or the given one where that is open.
fn input_of(model: &InferenceModel, size: Option<Size>) -> Result<Size, String> {
    let [_] = model.inputs.as_slice() else {
        let inputs = model.inputs.len();
        return Err(format!("it has {inputs} inputs, expected one: the image"));
    };
    let fact = model.input_fact(0).map_err(|error| first_line(&error))?;
    let wrong = || format!("its input is {fact:?}, expected f32 of 1 x 3 x rows x columns");
    if fact
        .datum_type
        .concretize()
        .is_some_and(|kind| kind != f32::datum_type())
    {
        return Err(wrong());
    }
    let dims: Vec<Option<usize>> = fact
        .shape
        .dims()
        .map(|dim| dim.concretize().and_then(|dim| dim.to_usize().ok()))
        .collect();
    let [batch, channels, height, width] = dims[..] else {
        return Err(wrong());
    };
    if batch.unwrap_or(1) != 1 || channels.unwrap_or(3) != 3 {
        return Err(wrong());
    }
    let own = |own: Option<usize>, given: Option<usize>| match (own, given) {
        (Some(own), Some(given)) if own != given => Err(format!(
            "its input has {own} pixels, not {given} as `input_size` says"
        )),
        (None, None) => Err("it leaves the size of its input open: set `input_size`".to_owned()),
        (own, given) => Ok(own.or(given).unwrap_or(1)),
    };
    let size = Size {
        width: own(width, size.map(|s| s.width))?,
        height: own(height, size.map(|s| s.height))?,
    };
    let pixels = size.pixels();
    if pixels == 0 || pixels > MAX_TENSOR_VALUES / 3 {
        return Err(format!("its input has {pixels} pixels"));
    }
    Ok(size)
}

/// Output as scores (1 x classes x rows x columns) or classes (1 x rows x columns, with another 1 or not).
fn scores_of(output: &Tensor) -> Result<Scores, String> {
    let shape = output.shape();
    let in_words = |error: TractError| first_line(&error);
    let size = |height: usize, width: usize| Size { width, height };
    let is_float = output.datum_type().is_float();
    let scores = match *shape {
        [1, classes, height, width] if is_float => {
            let values = output.cast_to::<f32>().map_err(in_words)?;
            let values = values.try_as_plain_ram().map_err(in_words)?;
            let values = values.as_slice::<f32>().map_err(in_words)?;
            let values = values.to_vec();
            let values = Values::Scores { classes, values };
            (size(height, width), values)
        }
        [1, height, width] | [1, 1, height, width] if !is_float => {
            let classes = output.cast_to::<i64>().map_err(in_words)?;
            let classes = classes.try_as_plain_ram().map_err(in_words)?;
            let classes = classes.as_slice::<i64>().map_err(in_words)?;
            (size(height, width), Values::Classes(classes.to_vec()))
        }
        _ => {
            return Err(format!(
                "its output is {:?} of {shape:?}, expected scores of 1 x classes x rows x columns or whole \
                 numbers of 1 x rows x columns",
                output.datum_type()
            ));
        }
    };
    let (size, values) = scores;
    if size.pixels() == 0 {
        return Err("its output is empty".to_owned());
    }
    Ok(Scores { size, values })
}

/// What went wrong, without the operators on the way to it.
fn first_line(error: &TractError) -> String {
    let text = error.chain().map(|cause| checks::shown(&cause.to_string()));
    let text: Vec<String> = text.collect();
    text.join(": ")
}
