//! Parameters of the node.

use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use super::backends::read_network_by;
use super::network::{Backend, ModelError, Network, Size};
use super::options::{SegmenterOptions, input_size};
use crate::compute::ComputeLimits;
use crate::{options, report};
use lattice_runtime::params::{About, ParamError, Params};
use lattice_runtime::{Shutdown, about};

const MODEL: &str = "the network is made at the start";
const ABOUT: &[About] = about! {
    "model" fixed(MODEL): "Network, an ONNX file: one image in (1 x 3 x rows x columns), scores of classes or classes out.";
    "compressed" fixed(options::TOPIC): "Whether images are taken from rgb/image_rect_color/compressed (JPEG).";
};

/// Parameters of a network, in any node.
pub(crate) const NETWORK: &[About] = about! {
    "model" fixed(MODEL): "A network that labels the images of colours inside this node, an ONNX file as segmenter takes it; empty: labels come from a topic.";
    "backend" fixed(MODEL): "What runs the network: tract, which is built in, or ort, the library of ONNX Runtime that ORT_DYLIB_PATH names (feature ort).";
    "input_size" fixed(MODEL): "Input width and height of the network, if dynamic in its file.";
    "mean": "Means of red, green and blue, for colours from 0 to 1, as in the training of the network.";
    "std": "Standard deviations of red, green and blue, as in the training of the network.";
    "scores": "Whether the scores of the network are logits or probabilities.";
    "names": "Class names in the order of their numbers; none: those of the model.";
    "label_probs": "Whether points have label_probs, the probabilities of the four best classes of their pixel, with model.";
    "compressed_color" fixed(options::TOPIC): "Whether colour images are compressed (JPEG), on the topic with the suffix /compressed.";
};

/// Timeout of loading a network, about as long as an operator waits for a node to start.
const MAX_LOAD: Duration = Duration::from_secs(60);
/// Period of checks for a shutdown request.
const POLL: Duration = Duration::from_millis(50);

/// Result of `make` on a separate thread, which is abandoned at the timeout or a shutdown request.
fn within<T: Send + 'static>(
    most: Duration,
    shutdown: &Shutdown,
    make: impl FnOnce() -> T + Send + 'static,
) -> Result<T, String> {
    let (done, made) = channel();
    let thread = thread::Builder::new().name("read network".to_owned());
    thread
        .spawn(move || {
            // The receiver may be gone.
            let _ = done.send(make());
        })
        .map_err(|error| error.to_string())?;
    let begin = Instant::now();
    loop {
        match made.recv_timeout(POLL) {
            Ok(made) => return Ok(made),
            Err(RecvTimeoutError::Disconnected) => {
                return Err("it cannot be parsed: the thread that read it ended".to_owned());
            }
            Err(RecvTimeoutError::Timeout) if shutdown.is_requested() => {
                return Err("reading it was interrupted".to_owned());
            }
            Err(RecvTimeoutError::Timeout) if begin.elapsed() > most => {
                let seconds = most.as_secs_f64();
                return Err(format!(
                    "loading takes more than {seconds} s: use a smaller model"
                ));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Network settings from parameters.
#[derive(Clone)]
pub(crate) struct NetworkSettings {
    model: PathBuf,
    backend: Backend,
    input_size: Option<Size>,
    threads: usize,
}

impl NetworkSettings {
    /// Reads the parameters of a network; `None` without a model.
    pub(crate) fn from_params(params: &Params) -> Result<Option<Self>, ParamError> {
        let model: PathBuf = params.string("model", "")?.into();
        let found = Self {
            backend: options::one_of(params, "backend", &Backend::ALL)?,
            input_size: input_size(params)?,
            threads: options::threads(params, 0)?,
            model,
        };
        Ok(Some(found).filter(|found| !found.model.as_os_str().is_empty()))
    }

    /// Loads the network within [`MAX_LOAD`], or until a shutdown request.
    pub(crate) fn read(
        &self,
        params: &Params,
        shutdown: &Shutdown,
    ) -> Result<Box<dyn Network>, ParamError> {
        let threads = match self.threads {
            0 => {
                let cores = std::thread::available_parallelism().map_or(1, usize::from);
                cores.saturating_sub(1).max(1)
            }
            threads => threads,
        };
        let began = Instant::now();
        let Self {
            backend,
            model,
            input_size,
            ..
        } = self.clone();
        let read = move || read_network_by(backend, &model, input_size, threads);
        let found = within(MAX_LOAD, shutdown, read).map_err(|problem| {
            let model = self.model.display();
            params.invalid("model", format!("{model}: {problem}"))
        })?;
        let network = found.map_err(|error| {
            let name = match error {
                ModelError::Library(_) | ModelError::NotBuilt("ort") => "backend",
                _ => "model",
            };
            params.invalid(name, error.to_string())
        })?;
        let size = network.input();
        log::info!(
            "{}: images of {} x {}, {} names of classes, ready in {:.1} s",
            self.model.display(),
            size.width,
            size.height,
            network.names().len(),
            began.elapsed().as_secs_f64()
        );
        Ok(network)
    }
}

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub segmenter: SegmenterOptions,
    /// `None`: no model is given.
    pub network: Option<NetworkSettings>,
    pub compressed: bool,
    pub limits: ComputeLimits,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(NETWORK);
        params.describe(options::COMMON);
        Ok(Self {
            segmenter: SegmenterOptions::from_params(params)?,
            network: NetworkSettings::from_params(params)?,
            compressed: params.bool("compressed", false)?,
            limits: ComputeLimits {
                events: 16,
                // Only the newest image waits.
                bytes: usize::MAX,
                threads: 1,
            },
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_too_long_is_left_and_a_request_to_end_is_heard() {
        let shutdown = Shutdown::default();
        assert_eq!(within(MAX_LOAD, &shutdown, || 7), Ok(7));
        let late = |shutdown: &Shutdown, most| {
            let begin = Instant::now();
            let (never, wait) = channel::<()>();
            let error = within(most, shutdown, move || wait.recv()).unwrap_err();
            drop(never);
            assert!(begin.elapsed() < Duration::from_secs(2), "{error}");
            error
        };
        assert!(
            late(&shutdown, Duration::from_millis(1)).contains("loading takes more than 0.001 s")
        );
        let panics = within(MAX_LOAD, &shutdown, || -> u8 { panic!("on purpose") });
        assert!(panics.is_err());
        shutdown.request();
        assert!(late(&shutdown, MAX_LOAD).contains("interrupted"));
    }
}
