//! ONNX networks, run by the ONNX Runtime library.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use ort::logging::LogLevel;
use ort::session::builder::GraphOptimizationLevel;
use ort::session::{RunOptions, Session};
use ort::value::{DynValue, TensorElementType, TensorRef};

use super::checks::PANICKED;
use super::network::{Interrupter, ModelError, Network, Scores, Size, Values};
use super::{checks, file, sizes};

/// Library name unless `ORT_DYLIB_PATH` is set.
const LIBRARY: &str = "libonnxruntime.so";

/// Network of a file in an ONNX Runtime session.
pub(super) struct OrtNetwork {
    session: Mutex<Session>,
    /// Terminated by an interruption.
    options: Arc<RunOptions>,
    input: Size,
    names: Vec<String>,
}

impl OrtNetwork {
    /// Loads the model of a file as tract's backend does; the first call loads the library.
    ///
    /// Errors: the library is missing or too old; else they name the file and the problem.
    pub(super) fn read(
        path: &Path,
        size: Option<Size>,
        threads: usize,
    ) -> Result<Self, ModelError> {
        load().map_err(ModelError::Library)?;
        let bytes = file::read(path)?;
        // The library may panic on invalid graphs.
        let made = catch_unwind(AssertUnwindSafe(|| made_of(&bytes, path, size, threads)));
        let made = made.unwrap_or_else(|_| Err("the graph cannot be parsed".to_owned()));
        made.map_err(|problem| ModelError::Unusable {
            path: path.to_owned(),
            problem,
        })
    }
}

impl Network for OrtNetwork {
    fn input(&self) -> Size {
        self.input
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn run(&self, planes: Vec<f32>) -> Result<Scores, String> {
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let shape = [1, 3, self.input.height, self.input.width];
        let run = AssertUnwindSafe(|| {
            let tensor =
                TensorRef::from_array_view((shape, planes.as_slice())).map_err(in_words)?;
            let outputs = session
                .run_with_options(ort::inputs![tensor], &self.options)
                .map_err(in_words)?;
            let output = outputs.values().next();
            let output = output.ok_or("the network has no output")?;
            scores_of(&output)
        });
        catch_unwind(run).unwrap_or_else(|_| Err(PANICKED.to_owned()))
    }

    fn interrupter(&self) -> Interrupter {
        let options = Arc::clone(&self.options);
        Box::new(move || {
            if let Err(error) = options.terminate() {
                log::debug!("the network is not interrupted: {error}");
            }
        })
    }
}

/// Loads the library once per process.
fn load() -> Result<(), String> {
    let path = std::env::var_os("ORT_DYLIB_PATH").filter(|path| !path.is_empty());
    let path = path.map_or_else(|| PathBuf::from(LIBRARY), PathBuf::from);
    // A path is relative to the working directory; a bare name is searched in the library path.
    let path = match path.components().count() {
        0 | 1 => path,
        _ => std::path::absolute(&path).unwrap_or(path),
    };
    let loaded = catch_unwind(AssertUnwindSafe(|| -> Result<(), String> {
        let environment = ort::init_from(&path).map_err(|error| error.to_string())?;
        environment.commit();
        // Panics if the library is older than the required version.
        let _ = ort::api();
        Ok(())
    }));
    let loaded =
        loaded.unwrap_or_else(|_| Err("it lacks the interface of version 1.17".to_owned()));
    loaded.map_err(|problem| {
        let path = path.display();
        let problem = checks::shown(&problem);
        format!("{path}: {problem}; set ORT_DYLIB_PATH to the library, version 1.17 or later")
    })
}

fn made_of(
    bytes: &[u8],
    path: &Path,
    size: Option<Size>,
    threads: usize,
) -> Result<OrtNetwork, String> {
    let onnx = tract_onnx::onnx();
    // The library itself rejects unknown operators.
    let (proto, names) = file::checked(bytes, path, &onnx, |_| true)?;
    let known = |operator: &str| onnx.op_register.0.contains_key(operator);
    if checks::model(&proto, known).is_ok() {
        // Sizes from shape inference; graphs that tract cannot analyse are left to the library.
        match sizes::analysed(&onnx, &proto, size) {
            Err(sizes::Problem::Size(problem)) => return Err(problem),
            Err(sizes::Problem::Other(problem)) => log::warn!(
                "{}: the sizes of its tensors are unknown and not checked: {problem}",
                path.display()
            ),
            Ok(_) => {}
        }
    }
    drop(proto);
    let builder = Session::builder().map_err(in_words)?;
    let builder = builder.with_log_level(LogLevel::Error);
    let builder = builder.map_err(in_words)?.with_intra_threads(threads);
    let builder = builder.map_err(in_words)?.with_inter_threads(1);
    let level = GraphOptimizationLevel::All;
    let builder = builder.map_err(in_words)?.with_optimization_level(level);
    let session = builder.map_err(in_words)?.commit_from_memory(bytes);
    let session = session.map_err(in_words)?;
    let input = input_of(&session, size)?;
    file::tried(OrtNetwork {
        session: Mutex::new(session),
        options: Arc::new(RunOptions::new().map_err(in_words)?),
        input,
        names,
    })
}

/// Input size of a model.
fn input_of(session: &Session, size: Option<Size>) -> Result<Size, String> {
    let [input] = session.inputs() else {
        let inputs = session.inputs().len();
        return Err(format!("it has {inputs} inputs, expected one: the image"));
    };
    let kind = input.dtype();
    let wrong = || format!("its input is {kind:?}, expected f32 of 1 x 3 x rows x columns");
    let shape = kind.tensor_shape().ok_or_else(wrong)?;
    if kind.tensor_type() != Some(TensorElementType::Float32) {
        return Err(wrong());
    }
    let dims = shape.iter().map(|dim| usize::try_from(*dim).ok());
    let dims: Vec<Option<usize>> = dims.collect();
    file::input_size(&dims, size).unwrap_or_else(|| Err(wrong()))
}

/// Output as scores (1 x classes x rows x columns) or classes (1 x rows x columns, optionally with another 1).
fn scores_of(output: &DynValue) -> Result<Scores, String> {
    let kind = output.dtype();
    let dims = kind.tensor_shape().map(|shape| shape.to_vec());
    let dims = dims.unwrap_or_default();
    let sizes: Option<Vec<usize>> = dims.iter().map(|dim| usize::try_from(*dim).ok()).collect();
    let sizes = sizes.unwrap_or_default();
    let size = |height: usize, width: usize| Size { width, height };
    let floats = match kind.tensor_type() {
        Some(TensorElementType::Float32) => Some(values_of(output, |v: f32| v)?),
        Some(TensorElementType::Float64) => Some(values_of(output, |v: f64| v as f32)?),
        _ => None,
    };
    let numbers = match kind.tensor_type() {
        Some(TensorElementType::Int64) => Some(values_of(output, |v: i64| v)?),
        Some(TensorElementType::Int32) => Some(values_of(output, |v: i32| v.into())?),
        Some(TensorElementType::Uint8) => Some(values_of(output, |v: u8| v.into())?),
        _ => None,
    };
    let (size, values) = match (sizes.as_slice(), floats, numbers) {
        (&[1, classes, height, width], Some(values), _) => {
            (size(height, width), Values::Scores { classes, values })
        }
        (&[1, height, width] | &[1, 1, height, width], _, Some(numbers)) => {
            (size(height, width), Values::Classes(numbers))
        }
        _ => return Err(file::other_output(kind.tensor_type(), dims)),
    };
    if size.pixels() == 0 {
        return Err("its output is empty".to_owned());
    }
    Ok(Scores { size, values })
}

fn values_of<T, V>(output: &DynValue, value: impl Fn(T) -> V) -> Result<Vec<V>, String>
where
    T: ort::value::PrimitiveTensorElementType + Copy,
{
    let (_, values) = output.try_extract_tensor::<T>().map_err(in_words)?;
    Ok(values.iter().map(|v| value(*v)).collect())
}

/// Error text on one line.
fn in_words<R>(error: ort::Error<R>) -> String {
    checks::shown(&error.to_string())
}
