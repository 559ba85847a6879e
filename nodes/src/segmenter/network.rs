//! Network interface: a colour tensor in, scores or classes of pixels out.

use std::path::PathBuf;

use thiserror::Error;

/// Limit of classes: their numbers have 16 bits, and one is reserved.
pub(super) const MAX_CLASSES: usize = u16::MAX as usize;

/// Size of an image or of the output of a network, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Size {
    /// Number of pixels.
    pub fn pixels(self) -> usize {
        self.width.saturating_mul(self.height)
    }
}

/// Library that runs a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// tract, built in with the feature `onnx`.
    #[default]
    Tract,
    /// ONNX Runtime, a dynamically loaded library, with the feature `ort`.
    Ort,
}

impl Backend {
    /// All backends, by their names in parameters and options.
    pub const ALL: [(&'static str, Self); 2] = [("tract", Self::Tract), ("ort", Self::Ort)];
}

/// Output of a network, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Scores by class, planar.
    Scores {
        /// Number of classes, at least 1.
        classes: usize,
        /// `classes` times the pixels.
        values: Vec<f32>,
    },
    /// Class of each pixel, chosen by the network.
    Classes(Vec<i64>),
}

/// Output of a network with its size, which may differ from that of its input.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// Size of the output.
    pub size: Size,
    /// Values of the output.
    pub values: Values,
}

/// Reason why a model cannot be used.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The backend is not built in.
    #[error("this program was built without the feature `{0}`: build it with `--features {0}`")]
    NotBuilt(&'static str),
    /// The ONNX Runtime library is unusable.
    #[error("ONNX Runtime: {0}")]
    Library(String),
    /// The file is unreadable.
    #[error("{}: {error}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        error: std::io::Error,
    },
    /// File size above the limit.
    #[error("{}: {bytes} bytes, more than {max}", path.display())]
    Large {
        /// Path of the file.
        path: PathBuf,
        /// Size of the file.
        bytes: u64,
        /// The limit.
        max: u64,
    },
    /// Not a model, or an unsupported one.
    #[error("{}: {problem}", path.display())]
    Unusable {
        /// Path of the model.
        path: PathBuf,
        /// Fault of the network.
        problem: String,
    },
}

/// Function that interrupts a network from another thread.
pub type Interrupter = Box<dyn Fn() + Send + Sync>;

/// A network that labels images.
pub trait Network: Send {
    /// Input size.
    fn input(&self) -> Size;

    /// Class names by their numbers; empty if unknown.
    fn names(&self) -> &[String];

    /// Output for an image: red, green and blue planes of the input size, normalised.
    ///
    /// Errors: inference fails, or the output differs from its declaration.
    fn run(&self, planes: Vec<f32>) -> Result<Scores, String>;

    /// Function that ends the inference in progress, and all later ones, with an error.
    fn interrupter(&self) -> Interrupter {
        Box::new(|| ())
    }
}
