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
    /// Its values.
    pub values: Values,
}

/// Reason why a model cannot be used.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The program does not have the backend.
    #[error("this program was built without the feature `{0}`: build it with `--features {0}`")]
    NotBuilt(&'static str),
    /// The library of ONNX Runtime cannot be used.
    #[error("ONNX Runtime: {0}")]
    Library(String),
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    File {
        /// Its path.
        path: PathBuf,
        /// Why not.
        error: std::io::Error,
    },
    /// More bytes than are read.
    #[error("{}: {bytes} bytes, more than {max}", path.display())]
    Large {
        /// Its path.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The limit.
        max: u64,
    },
    /// It is no model, or one that asks for what is not offered.
    #[error("{}: {problem}", path.display())]
    Unusable {
        /// Path of the model.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

/// A network that labels images.
pub trait Network: Send {
    /// Size of the images that it takes.
    fn input(&self) -> Size;

    /// Names of its classes by their numbers; empty if it does not say.
    fn names(&self) -> &[String];

    /// Output for an image: red, green and blue planes of the size of the input, normalised.
    ///
    /// Errors: the network cannot be run, or its output is of another kind than it says.
    fn run(&self, planes: Vec<f32>) -> Result<Scores, String>;
}
