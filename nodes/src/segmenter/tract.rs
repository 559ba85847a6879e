//! ONNX networks, run by tract.

mod convolution;
mod planes;
mod replace;
mod resize;
mod taps;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tract_linalg::multithread::Executor;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::tract_core::plan::{self, SimplePlan};
use tract_onnx::tract_hir::tract_core::runtime::RunOptions;

use super::checks::{PANICKED, first_line};
use super::network::{Interrupter, ModelError, Network, Scores, Size, Values};
use super::{file, sizes};

/// Network of a file, prepared for images of one size.
pub(super) struct OnnxNetwork {
    plan: Arc<TypedSimplePlan>,
    input: Size,
    names: Vec<String>,
    interrupted: Arc<AtomicBool>,
}

impl OnnxNetwork {
    /// Loads the model of a file. `size` is its input size if dynamic.
    ///
    /// Errors name the file and the problem: not ONNX, unknown operators, tensors above the
    /// limit, inputs or outputs that are not images.
    pub(super) fn read(
        path: &Path,
        size: Option<Size>,
        threads: usize,
    ) -> Result<Self, ModelError> {
        let bytes = file::read(path)?;
        // The library may panic on invalid graphs.
        let made = catch_unwind(AssertUnwindSafe(|| made_of(bytes, path, size, threads)));
        let made = made.unwrap_or_else(|_| Err("the graph cannot be parsed".to_owned()));
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
            let mut state = self.plan.spawn()?;
            // Between operators.
            state.run_plan_with_eval(
                tvec!(tensor.into()),
                |context, state, node, inputs| match self.interrupted.load(Ordering::Relaxed) {
                    true => Err(TractError::msg("interrupted")),
                    false => plan::eval(context, state, node, inputs),
                },
            )
        };
        let outputs = catch_unwind(AssertUnwindSafe(run))
            .map_err(|_| PANICKED.to_owned())?
            .map_err(|error| first_line(&error))?;
        let output = outputs.first().ok_or("the network has no output")?;
        scores_of(output)
    }

    fn interrupter(&self) -> Interrupter {
        let interrupted = Arc::clone(&self.interrupted);
        Box::new(move || interrupted.store(true, Ordering::Relaxed))
    }
}

fn made_of(
    bytes: Vec<u8>,
    path: &Path,
    size: Option<Size>,
    threads: usize,
) -> Result<OnnxNetwork, String> {
    let onnx = tract_onnx::onnx();
    let known = |operator: &str| onnx.op_register.0.contains_key(operator);
    let (proto, names) = file::checked(&bytes, path, &onnx, known)?;
    drop(bytes);
    let (model, input) = sizes::analysed(&onnx, &proto, size)?;
    let in_words = |error: TractError| first_line(&error);
    let model = model.into_typed().map_err(in_words)?;
    sizes::bounded(&model)?;
    let model = replace::replaced(model).map_err(in_words)?;
    let model = model.into_optimized().map_err(in_words)?;
    sizes::bounded(&model)?;
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
    file::tried(OnnxNetwork {
        plan,
        input,
        names,
        interrupted: Arc::default(),
    })
}

/// Output as scores (1 x classes x rows x columns) or classes (1 x rows x columns, optionally with another 1).
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
            return Err(file::other_output(output.datum_type(), shape));
        }
    };
    let (size, values) = scores;
    if size.pixels() == 0 {
        return Err("its output is empty".to_owned());
    }
    Ok(Scores { size, values })
}
